# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The parameters of other nodes, as their descriptors tell them, ours or anybody's."""

from collections.abc import Callable, Mapping
import math
import re
import time
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor, ParameterEvent, ParameterType
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.task import Future

from dp_swing_ros.console.requests import RequestError
from dp_swing_ros.console.scene import exact
from dp_swing_ros.parameters import LARGEST, shown
from dp_swing_ros.parameters.files import is_of_rclpy, value_of

TYPES = {
    ParameterType.PARAMETER_BOOL: 'bool', ParameterType.PARAMETER_INTEGER: 'integer',
    ParameterType.PARAMETER_DOUBLE: 'double', ParameterType.PARAMETER_STRING: 'string',
    ParameterType.PARAMETER_BOOL_ARRAY: 'bool[]',
    ParameterType.PARAMETER_INTEGER_ARRAY: 'integer[]',
    ParameterType.PARAMETER_DOUBLE_ARRAY: 'double[]',
    ParameterType.PARAMETER_STRING_ARRAY: 'string[]'}
PATIENCE = 2.0   # [s] for an answer
LONGEST = 2000   # [characters] of a description that is looked at
INFINITE = ('inf', '-inf')   # which JSON has no number for
NUMBERS = {kind: number for number, kind in TYPES.items()}
KINDS: dict[str, type | tuple[type, ...]] = {
    'bool': bool, 'integer': int, 'double': (int, float), 'string': str}
# how nodes/ros_parameters.py writes what a descriptor has no field for
ABOUT = re.compile(r'(?P<text>.*?)(?: \[(?P<unit>[^][]*)\])?(?: \(default: (?P<default>.*)\))?',
                   re.S)
LEAST, MOST = (re.compile(rf'{words} (-?[\d.]+(?:e[+-]?\d+)?)') for words in (
    'at least', 'at most'))
Then = Callable[[bool, str], None]
CHOICES = re.compile(r'(?:each )?one of (.*)')


class Partner:
    """Another node, whose parameters can be seen and changed."""

    def __init__(self, node: Node, name: str, changed: Callable[[], None]) -> None:
        """Take the full name of the other node; `changed` is called when the list is another."""
        self.name, self.changed = name, changed
        self._client = AsyncParameterClient(node, name)
        self.described: dict[str, dict[str, Any]] = {}   # for the page, by name
        self.boundless = set[str]()   # those whose default is infinite
        self.reset()

    def reset(self) -> None:
        """Know nothing of it, for it may have been started again."""
        self.described, self._known, self._asked_at = {}, False, -math.inf

    def look(self) -> None:
        """Ask for the list until it has come, as soon as the other node can answer."""
        now = time.monotonic()   # an answer may be lost while nodes find each other
        if not self._known and now - self._asked_at > PATIENCE \
                and self._client.services_are_ready():
            self._asked_at = now
            self._client.list_parameters([], 0, self._on_list)

    def on_event(self, event: ParameterEvent) -> None:
        """Take the news of a change."""
        if event.new_parameters:   # it was started again
            self.reset()
            self.look()
            return
        for each in event.changed_parameters:
            if each.name in self.described and each.value.type in TYPES:
                self.described[each.name]['value'] = exact(
                    parameter_value_to_python(each.value))
        self.changed()

    def prepared(self, values: Mapping[str, Any]) -> Callable[[Then], None]:
        """
        Return what changes parameters, all or none, and calls with whether it did, or why not.

        Raises RequestError for a name or a type that it lacks.
        """
        asked = [self._typed(name, value) for name, value in values.items()]
        if not self._client.services_are_ready():
            raise RequestError(f'{self.name} does not answer')

        def change(then: Then) -> None:
            def on_done(future: Future) -> None:
                result = future.result().result
                then(result.successful, result.reason)
            self._client.set_parameters_atomically(asked, on_done)

        return change

    def defaults(self) -> dict[str, Any]:
        """Return the defaults that are known; what is infinite is so here, and null in JSON."""
        return {**dict.fromkeys(self.boundless, math.inf), **{
            name: each['default'] for name, each in self.described.items()
            if each['default'] is not None}}

    def changes(self, values: Mapping[str, Any]) -> tuple[dict[str, Any], list[str]]:
        """Return which values are others than it has, and the names of such that cannot change."""
        others = {name: value for name, value in values.items()
                  if name in self.described and exact(value) != self.described[name]['value']}
        fixed = [name for name in others if self.described[name]['read_only']]
        return {name: value for name, value in others.items() if name not in fixed}, fixed

    def _on_list(self, future: Future) -> None:
        names = sorted(name for name in future.result().result.names if not is_of_rclpy(name))

        def on_descriptors(descriptors: Future) -> None:
            def on_values(values: Future) -> None:
                self.described = {
                    name: described(name, descriptor, parameter_value_to_python(value))
                    for name, descriptor, value in zip(
                        names, descriptors.result().descriptors, values.result().values)
                    if value.type in TYPES or not value.type}
                self.boundless = {name for name, descriptor in zip(
                    names, descriptors.result().descriptors)
                    if descriptor.description.endswith(f'(default: {shown(math.inf)})')}
                self._known = True
                self.changed()
            self._client.get_parameters(names, on_values)

        self._client.describe_parameters(names, on_descriptors)

    def _typed(self, name: str, value: Any) -> Parameter:
        """Return a parameter with a value of JSON in its own type; raises RequestError."""
        if name not in self.described:
            raise RequestError(f'{self.name} has no parameter {name[:80]!r}')
        kind, _, listed = self.described[name]['type'].partition('[')
        elements = value if listed else [value]
        if kind == 'double' and isinstance(elements, list):
            elements = [float(each) if each in INFINITE else each for each in elements]
        if not isinstance(elements, list) or not all(
                isinstance(each, KINDS[kind]) and isinstance(each, bool) == (kind == 'bool')
                for each in elements):
            raise RequestError(f'parameter {name!r} is {repr(value)[:80]}; expected '
                               f'{self.described[name]["type"]}')
        if kind == 'double':
            elements = list(map(float, elements))
        # an empty list would not show of what it is one
        return Parameter(name, Parameter.Type(NUMBERS[self.described[name]['type']]),
                         elements if listed else elements[0])


def described(name: str, descriptor: ParameterDescriptor, value: Any) -> dict[str, Any]:
    """Return all that is known of a parameter, for the page."""
    about = ABOUT.fullmatch(descriptor.description[:LONGEST])
    assert about is not None   # it matches any text
    kind = TYPES.get(descriptor.type, 'string')
    choices = CHOICES.fullmatch(descriptor.additional_constraints)
    low, high = bounds(descriptor)
    return {'name': name, 'type': kind, 'value': exact(value),
            'default': default(about['default'], kind),
            'unit': about['unit'] or '',
            'minimum': low, 'maximum': high,
            'choices': choices[1].split(', ') if choices else None,
            'description': about['text'], 'read_only': descriptor.read_only}


def bounds(descriptor: ParameterDescriptor) -> tuple[float | None, ...]:
    """Return the least and the largest value; None where there is no bound."""
    for each in (*descriptor.integer_range, *descriptor.floating_point_range):
        low, high = float(each.from_value), float(each.to_value)
        return (low if low > -LARGEST else None, high if high < LARGEST else None)
    found = [bound.search(descriptor.additional_constraints) for bound in (LEAST, MOST)]
    return tuple(default(each[1], 'double') if each else None for each in found)


def default(text: str | None, kind: str) -> Any:
    """Return a default that a description ends with, in the type of its parameter."""
    if text is None:
        return None
    if kind.endswith('[]'):
        inner = text.strip('[]')
        return [default(each, kind[:-2]) for each in inner.split(', ')] if inner else []
    try:
        value = value_of(text) if kind != 'string' else text
        return exact(float(value) if kind == 'double' else value)
    except (TypeError, ValueError):   # it is no default, whatever it looks like
        return None
