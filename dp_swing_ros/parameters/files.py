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
VALUES = 'ros__parameters'        # the key below which they are
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
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        words = ' '.join(filter(None, (error.context, error.problem)))
        raise YamlError(f'line {mark.line + 1}: {words}' if mark else words) from None
    except Exception as error:
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


class Key(str):
    """A key of a mapping, which knows its line."""

    line = 0


class _Loader(PlainLoader):
    """YAML as rcl reads it, which looks at the text of a key or a value alone."""

    yaml_implicit_resolvers: dict[str, Any] = {}

    def construct_value(self, node: yaml.ScalarNode) -> bool | int | float | str | None:
        """Return the value of a scalar, None where there is none."""
        if node.style in ('"', "'"):
            return str(node.value)
        return _value(node.value) if node.value else None

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Key, Any]:
        """Return a mapping by texts that know their lines."""
        found = {}
        for each, value in node.value:
            key = Key(each.value)
            key.line = each.start_mark.line + 1
            found[key] = self.construct_object(value, deep)
        return found


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


def sections(path: Path) -> list[tuple[Key, dict[str, Any]]]:
    """Return the node patterns of a parameter file, each with its values; or ParameterError."""
    try:
        content = parse_file(path, _Loader)
    except OSError as error:
        raise ParameterError(f'cannot read the parameter file {path}: {error.strerror}') from None
    except YamlError as error:
        raise ParameterError(f'the parameter file {path} is not YAML: {error}') from None
    try:
        return [(pattern, dict(_flat(values))) for pattern, values in _sections(content)]
    except ParameterError as error:
        raise ParameterError(f'the parameter file {path}: {error}') from None


def is_for(pattern: str, node: str) -> bool:
    """Return whether a section of a parameter file is for a node of a full name."""
    levels = ({'**': '(/[^/]+)*', '*': '/[^/]+'}.get(level, f'/{re.escape(level)}')
              for level in pattern.strip('/').split('/'))
    return bool(re.fullmatch(''.join(levels), f'/{node.strip("/")}'))


def for_node(found: Iterable[tuple[str, Mapping[str, Any]]], node: str,
             known: Iterable[str]) -> dict[str, Any]:
    """Return what sections have for a node; of those for any (/**) what it knows is its own."""
    asked: dict[str, Any] = {}
    for pattern, values in found:
        if is_for(pattern, node):
            asked |= {name: values[name] for name in values
                      if name in known or not pattern.endswith(ANY_NODE)}
    return asked


def _sections(content: Any, pattern: str = '') -> Iterable[tuple[Key, dict[Key, Any]]]:
    """Yield the patterns and what is below ros__parameters; raises ParameterError."""
    if not isinstance(content, dict) or not content:
        raise ParameterError(_misplaced('' if content is None else repr(content)[:SHOWN]))
    for name, below in content.items():
        full = Key(f'{pattern}/{name}'.replace('//', '/') if pattern else name)
        full.line = name.line
        if name == VALUES or not isinstance(below, dict):
            raise ParameterError(f'line {name.line}: {_misplaced(repr(name))}')
        if VALUES not in below:   # a namespace may be a level of its own
            yield from _sections(below, full)
        elif beside := [each for each in below if each != VALUES]:
            raise ParameterError(f'line {beside[0].line}: {beside[0]!r} stands beside {VALUES}; '
                                 'expected below it, further to the right')
        elif isinstance(below[VALUES], dict):
            yield full, below[VALUES]
        else:
            raise ParameterError(f'line {name.line}: nothing is below {VALUES} of {name!r}; '
                                 'expected parameters, each with its value')


def _misplaced(what: str) -> str:
    return (f'{what or "nothing"} stands where a node is named: it is not a ROS parameter file, '
            f'which has `/**/mpc:` with `{VALUES}:` below, as in config/paper.yaml')


def _flat(values: Mapping[Key, Any], prefix: str = '') -> Iterable[tuple[str, Any]]:
    """Name what is nested as ROS does: mppi: {samples: 9} is mppi.samples."""
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _flat(value, f'{prefix}{name}.')
            continue
        try:
            yield f'{prefix}{name}', _as_ros(value, f'{prefix}{name}')
        except ParameterError as error:
            raise ParameterError(f'line {name.line}: {error}') from None
