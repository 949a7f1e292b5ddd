# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The parameters of a node by their full names, for any number of links.

A node takes them by name ({'horizon': 30, 'mppi.samples': 512}), from the command line or a YAML
file; the same names and files make the same objects without a node.
"""

from collections.abc import Callable, Iterable, Mapping
import copy
import dataclasses
from types import MappingProxyType
from typing import Any

from dp_swing_ros.parameters import complete, fields_of, group, ParameterError, Parameters, Values
from dp_swing_ros.parameters.scheduling import SchedulingParameters
from dp_swing_ros.pendulum.equations import scale_of
from dp_swing_ros.pendulum.parameters import (
    DriveParameters, LimitParameters, PendulumParameters)
from dp_swing_ros.pendulum.state import DEFAULT_LINKS, LINKS
from dp_swing_ros.pendulum.units import by_element, Units

SHARED = ('', PendulumParameters), ('', DriveParameters), ('', LimitParameters)
OF_BOTH: dict[int, dict[str, Any]] = {1: {}, 2: {}, 3: {
    'force_limit': 40.0, 'acceleration_limit': 40.0}}

Group = tuple[str, type[Parameters]]   # what names begin with, and the fields


class Declaration:
    """What parameters a node has; plant and controller share those of the pendulum."""

    def __init__(self, node: str, groups: Callable[[], Iterable[Group]],
                 defaults: Mapping[int, Mapping[str, Any]],
                 beside: Callable[[Values], Mapping[str, Any]] = lambda given: {}) -> None:
        """
        Take the node, its own groups, and what differs from declared defaults.

        That is by links, and what `beside` returns beside values that are given.
        """
        self.node, self.groups, self.beside = node, groups, beside
        self.defaults = {links: {**OF_BOTH[links], **defaults.get(links, {})} for links in LINKS}

    def fields(self, links: int) -> dict[str, dataclasses.Field]:
        """Return the parameters by full names, with defaults for so many links as they are."""
        found = {}
        for prefix, kind in (*SHARED, *self.groups(), ('', SchedulingParameters)):
            for field in map(copy.copy, fields_of(kind, links)):
                sizes = field.metadata['size']
                field.metadata = MappingProxyType(
                    {**field.metadata, 'size': sizes and {links: sizes[links]}})
                field.default = self.defaults[links].get(prefix + field.name, field.default)
                found[prefix + field.name] = field
        return found

    def fields_for(self, values: Values) -> dict[str, dataclasses.Field]:
        """
        Return the parameters by their full names, with defaults for the pendulum of these values.

        Raises ParameterError where there is no such pendulum, or one of the values is of one with
        more links.
        """
        links = links_in(values)
        fields = self.fields(links)
        for name in sorted(set(values) - set(fields)):
            there = [n for n in LINKS if name in self.fields(n)]
            if there:
                raise ParameterError(f'parameter {name!r} is one of a pendulum with {min(there)} '
                                     f'links; this one has {links} (parameter links)')
        scale = scale_of(group(PendulumParameters, values))
        beside = self.beside(values)
        for name, field in fields.items():
            if field.metadata['scaled']:
                field.default = _scaled(field, scale)
            field.default = beside.get(name, field.default)
        return fields

    def fields_of_run(self, ran: Values) -> dict[str, dataclasses.Field]:
        """
        Return the parameters with their defaults for the pendulum that a node ran with.

        Of what ran nobody knows which of it was given, and some of it may be of other versions.
        Raises ParameterError where there is no such pendulum.
        """
        bodies = {field.name for field in fields_of(PendulumParameters, links_in(ran))}
        return self.fields_for({name: value for name, value in ran.items() if name in bodies})

    def complete(self, values: Values) -> dict[str, Any]:
        """
        Return the value of every parameter, checked, where some are given.

        Raises ParameterError, also for names that the node lacks with so many links.
        """
        return complete(self.fields_for(values), values, self.node)


def _scaled(field: dataclasses.Field, scale: Units) -> Any:
    default: Any = field.default
    unit = field.metadata['unit']
    if not isinstance(default, tuple):
        return min(max(scale.sized(default, unit), field.metadata['minimum']),
                   field.metadata['maximum'])
    return tuple(map(scale.sized, default, by_element(unit, len(default))))


def links_in(values: Values) -> int:
    """Return the number of links that parameters are for; raises ParameterError."""
    return PendulumParameters(links=values.get('links', DEFAULT_LINKS)).links
