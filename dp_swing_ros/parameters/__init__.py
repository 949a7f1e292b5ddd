# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Parameters: each declared once, with default, unit, range and description; registries.

The ROS parameters, their descriptors and the table in docs/parameters.md come from these classes.
"""

from collections import UserDict
import dataclasses
import difflib
from functools import cached_property
from importlib.metadata import entry_points
import math
import numbers
from typing import Any, Callable, Iterable, Mapping, TypeVar
import warnings

from dp_swing_ros.errors import SHOWN

LARGEST = 2 ** 63 - 1  # whole number that a ROS parameter holds
WORDS = {bool: 'true or false', int: 'a whole number', float: 'a number', str: 'a text'}


Values = Mapping[str, Any]   # by the full name of the parameter

Group = TypeVar('Group', bound='Parameters')
Offered = TypeVar('Offered')


def parameter(default: Any, description: str, *, unit: str = '', minimum: float | None = None,
              maximum: float | None = None, choices: Callable[[], list[str]] | None = None,
              size: Mapping[int, int] | None = None, finite: bool = True, links: int = 1,
              live: bool = True, secret: bool = False, scaled: bool = False) -> Any:
    """
    Declare one parameter as a dataclass field.

    minimum and maximum are inclusive and hold for every element of a list; `choices` is called
    when needed, so that a registry may be filled after the class is made; `size` is the length
    of a list by the number of links; `finite=False` allows infinity (NaN never passes); the
    parameter is one of pendulums with so many `links` or more; one that is not `live` stays as it
    is while a node runs, also where others may change; a `secret` is never shown to others; the
    default of one that is `scaled` is that of the default bodies, and for others the same number
    of the pendulum's own units. A list then has a unit for cart and joints, or one each for these
    and for their speeds.
    """
    return dataclasses.field(default=default, metadata={
        'description': description, 'unit': unit,
        'minimum': -math.inf if minimum is None else minimum,
        'maximum': math.inf if maximum is None else maximum,
        'choices': choices, 'size': size, 'finite': finite, 'links': links,
        'live': live and not secret, 'secret': secret, 'scaled': scaled})


class ParameterError(ValueError):
    """A parameter has an impossible value; the message says which, and what is expected."""


@dataclasses.dataclass(frozen=True)
class Parameters:
    """A group of parameters, checked when it is made."""

    def __post_init__(self) -> None:
        """Check every value against its declaration; raises ParameterError."""
        for field in dataclasses.fields(self):
            object.__setattr__(self, field.name, checked(field, getattr(self, field.name)))


def group(kind: type[Group], values: Mapping[str, Any], prefix: str = '') -> Group:
    """Make a group of parameters from the values of a node, where these have them."""
    return kind(**{field.name: values[prefix + field.name] for field in dataclasses.fields(kind)
                   if prefix + field.name in values})


def fields_of(group: type[Parameters], links: int) -> list[dataclasses.Field]:
    """Return the parameters of a group that a pendulum with so many links has."""
    return [field for field in dataclasses.fields(group) if field.metadata['links'] <= links]


def named(group: type[Parameters], prefix: str = '') -> dict[str, dataclasses.Field]:
    """Return the parameters of a group by their full names."""
    return {prefix + field.name: field for field in dataclasses.fields(group)}


def checked(field: dataclasses.Field, value: Any, name: str = '') -> Any:
    """
    Return the value in its declared type; `name` is its full name, if not the field's.

    Raises ParameterError, naming the value, what is expected and the choices.
    """
    default: Any = field.default
    about, listed = field.metadata, isinstance(default, tuple)

    def refuse(expected: str) -> ParameterError:
        found = '(a secret)' if about['secret'] else repr(value)[:SHOWN]
        return ParameterError(f'parameter {name or field.name!r} is {found}; '
                              f'expected {expected} ({about["description"]})')

    if listed:
        value = _sequence(value, type(default[0]), list((about['size'] or {}).values()), refuse)
    else:
        value = _converted(value, type(default), refuse)
    elements = value if listed else (value,)
    for element in elements:
        if isinstance(element, float) and (
                math.isnan(element) or about['finite'] and math.isinf(element)):
            raise refuse('a finite number')
        if isinstance(element, (float, int)) and not (
                about['minimum'] <= element <= about['maximum']):
            raise refuse(expected(field, f' {about["unit"]}'.rstrip()))
    if about['choices'] is not None and not set(elements) <= {*about['choices']()}:
        raise refuse(expected(field))
    return value


def expected(field: dataclasses.Field, unit: str = '') -> str:
    """Return in words what a parameter may be; empty where anything of its type is."""
    about = field.metadata
    if about['choices'] is not None:
        each = 'each ' if isinstance(field.default, tuple) else ''
        return f'{each}one of {", ".join(about["choices"]())}'
    text = ', '.join(f'{words} {about[bound]:g}{unit}'
                     for words, bound in (('at least', 'minimum'), ('at most', 'maximum'))
                     if math.isfinite(about[bound]))
    if about['size'] is not None:
        links, count = next(iter(about['size'].items()))
        each = count // (links + 1)   # a joint; the cart is one
        default: Any = field.default
        kind = ('text' if isinstance(default[0], str) else 'number') + 's' * (each > 1)
        return f'{each} {kind} and {each} a link' + (f', each {text}' if text else '')
    return text


def _converted(value: Any, kind: type, refuse: Callable[[str], ParameterError]) -> Any:
    if isinstance(value, int) and abs(value) > LARGEST:
        raise refuse('a whole number of 63 bits at most')
    # A whole number will do for a number; true and false are neither.
    if kind is float and isinstance(value, numbers.Real) and not isinstance(value, bool):
        return float(value)
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise refuse(WORDS[kind])
    return value


def _sequence(value: Any, kind: type, sizes: list[int],
              refuse: Callable[[str], ParameterError]) -> tuple[Any, ...]:
    kinds = 'texts' if kind is str else 'numbers'
    expected = (f'a list of {" or ".join(map(str, sizes))} {kinds}' if sizes
                else f'a list, each {WORDS[kind]}')
    if isinstance(value, str) or not isinstance(value, Iterable):
        raise refuse(expected)
    elements = tuple(_converted(element, kind, lambda _: refuse(expected)) for element in value)
    if sizes and len(elements) not in sizes:
        raise refuse(expected)
    return elements


def shown(value: Any) -> str:
    """Return the value of a parameter as it is given on the command line."""
    if isinstance(value, tuple):
        # ROS wants a point in each number of a list, if it is in one
        texts = (str(each) if isinstance(each, float) and math.isfinite(each) else shown(each)
                 for each in value)
        return f'[{", ".join(texts)}]'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and math.isinf(value):
        return '.inf'
    return f'{value:g}' if isinstance(value, float) else str(value)


def unknown(name: str, node: str, known: Iterable[str]) -> ParameterError:
    """Return the error for a parameter that a node does not have, with the closest it has."""
    return ParameterError(f'unknown parameter {name!r} of the node {node!r}; {near(name, known)}')


def near(name: str, known: Iterable[str]) -> str:
    """Return the question whether the closest of some names was meant; where none is, all."""
    close = difflib.get_close_matches(name, names := sorted(known), n=1)
    return f'did you mean {close[0]!r}?' if close else f'available: {", ".join(names)}'


def complete(fields: Mapping[str, dataclasses.Field], values: Mapping[str, Any],
             node: str) -> dict[str, Any]:
    """Return the value of each parameter of a node, checked, where some are given, or raise."""
    for name in sorted(set(values) - set(fields)):
        raise unknown(name, node, fields)
    return {name: checked(field, values.get(name, field.default), name)
            for name, field in fields.items()}


class Registry(UserDict[str, Offered]):
    """
    What this package has by name, and what others offer as entry points of a group.

    Another package cannot replace what this one has; one that cannot be imported is left out, with
    a warning that says why. Others are imported when it is first looked at: they import this
    package themselves, and may be first.
    """

    def __init__(self, group: str, **own: Offered) -> None:
        """Take the group, and what this package has."""
        self.group, self.own = group, own

    @cached_property
    def data(self) -> dict[str, Offered]:   # type: ignore[override]
        """Return all by name."""
        found = dict(self.own)
        for entry in entry_points(group=self.group):
            name, value = entry.name, entry.value
            if name in found:
                warnings.warn(f'{value} is left out: {self.group} has {name!r} already')
                continue
            try:
                found[name] = entry.load()
            except Exception as error:
                warnings.warn(f'{value}, {name!r} of {self.group}, cannot be imported: '
                              f'{type(error).__name__}: {error}')
        return found
