# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
YAML files: anyone's, read within bounds; those of parameters as ROS reads them, without ROS.

Aliases are refused, as they expand beyond any memory.
"""

from collections.abc import Iterable, Mapping
import ctypes
from pathlib import Path
import re
from typing import Any

import yaml

from dp_swing_ros.errors import one_line
from dp_swing_ros.parameters import ParameterError, SHOWN

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


C = ctypes.CDLL(None, use_errno=True)
C.strtol.restype, C.strtod.restype = ctypes.c_long, ctypes.c_double
TRUE, FALSE = ([form for word in words.split() for form in (word, word.title(), word.upper())]
               for words in ('y yes true on', 'n no false off'))
WITH_POINT = [sign + word for word in ('.inf', '.Inf', '.INF') for sign in ('', '+', '-')] + [
    '.nan', '.NaN', '.NAN']


class _Loader(PlainLoader):
    """YAML as rcl reads it, which looks at the text of a value alone."""

    yaml_implicit_resolvers: dict[str, Any] = {}

    def construct_value(self, node: yaml.ScalarNode) -> bool | int | float | str | None:
        """Return the value of a scalar, None where there is none."""
        if node.style in ('"', "'"):
            return str(node.value)
        return _value(node.value) if node.value else None


_Loader.add_constructor('tag:yaml.org,2002:str', _Loader.construct_value)


def _value(text: str) -> bool | int | float | str:
    """Return what a text stands for without quotes. Source: rcl_yaml_param_parser, get_value."""
    if text in TRUE or text in FALSE:
        return text in TRUE
    data = text.replace('.', '', 1).encode() if text in WITH_POINT else text.encode()
    end = ctypes.c_char_p()
    for convert, base in ((C.strtol, (0,)), (C.strtod, ())):
        ctypes.set_errno(0)
        value: int | float = convert(data, ctypes.byref(end), *base)
        if not ctypes.get_errno() and not end.value:
            return value
    return text


def value_of(text: str, name: str = '') -> Any:
    """Return the value of a parameter given as text, as ROS does; raises ParameterError."""
    try:
        return _as_ros(parse(text, _Loader), name)
    except YamlError as error:
        raise ParameterError(f'{text[:SHOWN]!r} is not the value of a parameter {name}: {error}'
                             ) from None


def _as_ros(value: Any, name: str) -> Any:
    """Return the value of a parameter; raises ParameterError where ROS would refuse it."""
    elements = value if isinstance(value, list) else [value]
    kinds = {type(element) for element in elements}
    if kinds & {type(None), dict}:
        remedy = 'expected a value; an empty text is ""'
    elif len(kinds) > 1:
        remedy = 'ROS wants the values of a list alike' + (
            f': [{", ".join(map(repr, map(float, value)))}]' if kinds == {int, float} else '')
    else:
        return value
    raise ParameterError(f'parameter {name!r} is {repr(value)[:SHOWN]}; {remedy}')


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
    try:
        return [(pattern, dict(_flat(values))) for pattern, values in found]
    except ParameterError as error:
        raise ParameterError(f'the parameter file {path}: {error}') from None


def for_node(found: Iterable[tuple[str, dict[str, Any]]], node: str,
             known: Iterable[str]) -> dict[str, Any]:
    """Return what sections have for a node; of those for any (/**) what it knows is its own."""
    asked: dict[str, Any] = {}
    for pattern, values in found:
        levels = ({'**': '(/[^/]+)*', '*': '/[^/]+'}.get(level, f'/{re.escape(level)}')
                  for level in pattern.strip('/').split('/'))
        if re.fullmatch(''.join(levels), f'/{node.strip("/")}'):
            asked |= {name: values[name] for name in values
                      if name in known or not pattern.endswith(ANY_NODE)}
    return asked


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
            yield f'{prefix}{name}', _as_ros(value, f'{prefix}{name}')
