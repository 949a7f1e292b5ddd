# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""YAML from anywhere, read within bounds and without aliases, which expand beyond any memory."""

from pathlib import Path
from typing import Any

import yaml

from dp_swing_ros.errors import one_line

SIZE = 1 << 20   # [bytes] of a text
SCALAR = 1 << 16  # [characters] of a scalar: numbers of base 60 take the square of their length
NODES = 50_000   # that a text may begin
DEPTH = 32       # of nested nodes
BITS = 64        # of a whole number


class YamlError(ValueError):
    """A text is no YAML, or beyond the bounds; the message is one line."""


class PlainLoader(getattr(yaml, 'CSafeLoader', yaml.SafeLoader)):  # type: ignore[misc]
    """Constructs plain data; whole numbers are those that ROS has."""

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int:
        """Return a whole number; raises ConstructorError where no message could hold it."""
        number: int = super().construct_yaml_int(node)
        if number.bit_length() > BITS:
            raise yaml.constructor.ConstructorError(
                problem=f'a whole number of {number.bit_length()} bits; expected {BITS} at most')
        return number


PlainLoader.add_constructor('tag:yaml.org,2002:int', PlainLoader.construct_yaml_int)


def parse(text: str | bytes, loader: type[PlainLoader] = PlainLoader) -> Any:
    """
    Return the content of a text of YAML.

    Raises YamlError, before anything is constructed where the text is beyond the bounds.
    """
    try:
        _check(text, loader)
        return yaml.load(text, loader)
    except Exception as error:  # noqa: B902
        # A text such as '!!int ""' fails within the types that YAML knows.
        raise YamlError(one_line(error)) from None


def parse_file(path: Path, loader: type[PlainLoader] = PlainLoader) -> Any:
    """Return the content of a file of YAML; raises YamlError, and OSError if it is unreadable."""
    with path.open('rb') as file:
        return parse(file.read(SIZE + 1), loader)


def _check(text: str | bytes, loader: type[PlainLoader]) -> None:
    """Go through the events of a text, which take no memory; raises YamlError at a bound."""
    if len(text) > SIZE:
        raise YamlError(f'it is longer than {SIZE} bytes')
    nodes = depth = 0
    for event in yaml.parse(text, loader):
        if isinstance(event, yaml.AliasEvent):
            raise YamlError('it has an alias; write what it stands for')
        nodes += isinstance(event, yaml.NodeEvent)
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        size = len(event.value) if isinstance(event, yaml.ScalarEvent) else 0
        for found, limit, what in ((nodes, NODES, 'nodes'), (depth, DEPTH, 'levels'),
                                   (size, SCALAR, 'characters in one value')):
            if found > limit:
                raise YamlError(f'it has more than {limit} {what}')
