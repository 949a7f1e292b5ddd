# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
YAML files: anyone's, read within bounds; those of parameters as ROS reads them, without ROS.

Aliases are refused, as they expand beyond any memory.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
import re
from typing import Any

import yaml

from dp_swing_ros.errors import one_line
from dp_swing_ros.parameters import ParameterError

SIZE = 1 << 20   # [bytes] of a text
SCALAR = 1 << 16  # [characters] of a scalar
NODES = 50_000   # that a text may begin
DEPTH = 32       # of nested nodes
BITS = 64        # of a whole number

OF_EVERY_NODE = ('use_sim_time', 'start_type_description_service')  # rclpy's own
QOS_OVERRIDES = 'qos_overrides.'  # how rclpy's parameters of a topic begin
ANY_NODE = ('**', '*')            # ends of a pattern that are no name of a node
PACKAGE = Path(__file__).parents[1]
# where config/ lies: beside the package in a checkout, below share/ where it is installed
HOMES = [PACKAGE.parent, *(folder / 'share' / PACKAGE.name for folder in PACKAGE.parents[:4])]


class YamlError(ValueError):
    """A text is no YAML, or beyond the bounds; the message is one line."""


class PlainLoader(getattr(yaml, 'CSafeLoader', yaml.SafeLoader)):  # type: ignore[misc]
    """
    Constructs plain data; whole numbers are those that ROS has, and 1:30 is a text, as there.

    Numbers of base 60 would take the square of their length to read.
    """

    def construct_yaml_float(self, node: yaml.ScalarNode) -> float | str:
        """Return a number, or the text that is of base 60."""
        number: float | str = node.value if ':' in node.value else \
            super().construct_yaml_float(node)
        return number

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int | str:
        """Return a whole number; raises ConstructorError where no message could hold it."""
        if ':' in node.value:
            return str(node.value)
        number: int = super().construct_yaml_int(node)
        if number.bit_length() > BITS:
            raise yaml.constructor.ConstructorError(
                problem=f'a whole number of {number.bit_length()} bits; expected {BITS} at most')
        return number


for _kind in ('int', 'float'):
    PlainLoader.add_constructor(f'tag:yaml.org,2002:{_kind}',
                                getattr(PlainLoader, f'construct_yaml_{_kind}'))


def parse(text: str | bytes, loader: type[PlainLoader] = PlainLoader, nodes: int = NODES) -> Any:
    """
    Return the content of a text of YAML, which may have so many nodes.

    Raises YamlError, before anything is constructed where the text is beyond the bounds.
    """
    try:
        _check(text, loader, nodes)
        return yaml.load(text, loader)
    except Exception as error:  # noqa: B902
        # A text such as '!!int ""' fails within the types that YAML knows.
        raise YamlError(one_line(error)) from None


def parse_file(path: Path, loader: type[PlainLoader] = PlainLoader) -> Any:
    """Return the content of a file of YAML; raises YamlError, and OSError if it is unreadable."""
    with path.open('rb') as file:
        return parse(file.read(SIZE + 1), loader)


def _check(text: str | bytes, loader: type[PlainLoader], most: int) -> None:
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
        for found, limit, what in ((nodes, most, 'nodes'), (depth, DEPTH, 'levels'),
                                   (size, SCALAR, 'characters in one value')):
            if found > limit:
                raise YamlError(f'it has more than {limit} {what}')


def is_of_rclpy(name: str) -> bool:
    """Return whether a parameter is one that rclpy gives to every node or topic."""
    return name in OF_EVERY_NODE or name.startswith(QOS_OVERRIDES)


class _Loader(PlainLoader):
    """YAML as rcl reads it: 1e-4 is a number too, though YAML 1.1 wants 1.0e-4."""


_Loader.add_implicit_resolver('tag:yaml.org,2002:float', re.compile(r'[-+]?\d+[eE][-+]?\d+$'),
                              list('-+0123456789'))


def value_of(text: str) -> Any:
    """Return the value of a parameter given as text, as ROS does; raises ParameterError."""
    try:
        return parse(text, _Loader)
    except YamlError as error:
        raise ParameterError(f'{text[:80]!r} is not the value of a parameter: {error}') from None


def locate(path: Path) -> Path:
    """Return where a parameter file is: as named from here, or else among the package's own."""
    places = (path, *(home / path for home in HOMES))
    return next((place for place in places if place.is_file()), path)


def sections(path: Path) -> list[tuple[str, dict[str, Any]]]:
    """Return the node patterns of a parameter file, each with its values; or ParameterError."""
    try:
        content = parse_file(path, _Loader)
    except OSError as error:
        raise ParameterError(f'cannot read the parameter file {path}: {error}') from None
    except YamlError as error:
        raise ParameterError(f'the parameter file {path} is not YAML: {error}') from None
    found = list(_sections(content))
    if not found or not all(isinstance(values, dict) for _, values in found):
        raise ParameterError(f'{path} is not a ROS parameter file; expected '
                             '`/**/mpc:` with `ros__parameters:` below, as in config/paper.yaml')
    return [(pattern, dict(_flat(values))) for pattern, values in found]


def _sections(content: Any, pattern: str = '') -> Iterable[tuple[str, Any]]:
    """Yield the patterns and what is below ros__parameters, None where nothing is."""
    if not isinstance(content, dict):
        yield pattern, None
    elif 'ros__parameters' in content:
        yield pattern, content['ros__parameters']
    else:   # a namespace may be a level of its own
        for name, below in content.items():
            yield from _sections(below, f'{pattern}/{name}'.replace('//', '/') if pattern
                                 else str(name))


def _flat(values: Mapping[str, Any], prefix: str = '') -> Iterable[tuple[str, Any]]:
    """Name what is nested as ROS does: mppi: {samples: 9} is mppi.samples."""
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _flat(value, f'{prefix}{name}.')
        else:
            yield f'{prefix}{name}', value
