# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The parameters of a node, made from the dataclasses that declare them.

Whatever is wrong with what the user gave ends in a ParameterError.
"""

from array import array
from collections.abc import Callable, Mapping
import dataclasses
from functools import partial
from itertools import pairwise
import math
from pathlib import Path
import sys
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult)
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import String

from dp_swing_ros.errors import one_line, SHOWN
from dp_swing_ros.messages.configuration import Configuration
from dp_swing_ros.nodes.connections import publish
from dp_swing_ros.parameters import (
    checked, expected, LARGEST, ParameterError, shown, unknown)
from dp_swing_ros.parameters.files import ANY_NODE, for_node, QOS_OVERRIDES, sections, value_of
from dp_swing_ros.provenance import commit, machine, package_version, packages, sources
from dp_swing_ros.topics import CONFIGURATION

RULE, FILE = ('-p', '--param'), '--params-file'   # options of ROS
TYPES = {bool: 'BOOL', int: 'INTEGER', float: 'DOUBLE', str: 'STRING'}


def overrides(node: Node) -> dict[str, Any]:
    """Return what was given on the command line and in parameter files, by name."""
    # rclpy has no public way to ask; an empty list reaches a node without a type or a value
    return {name: () if override.type_ is Parameter.Type.NOT_SET else override.value
            for name, override in node._parameter_overrides.items()}


def declare(node: Node, fields: Mapping[str, dataclasses.Field],
            live: bool = False) -> dict[str, Any]:
    """
    Declare ROS parameters, refuse what nobody declared, and publish what the node runs with.

    fields are by the full names; unless `live`, a parameter is read-only once the node runs; see
    allow_changes. Returns their values. Raises ParameterError, naming the closest match and all
    the choices.
    """
    asked, values = overrides(node), {}
    for name, field in fields.items():
        values[name] = checked(field, asked.get(name, field.default), name)
        # The override is left aside: it is in the value already, there in its declared type.
        node.declare_parameter(name, _listed(_public(field, values[name])),
                               _descriptor(field, live), ignore_override=True)
    refuse_unknown(node, of_topics=False)
    _warn_of_files(node)
    # rclpy's own words do not name what is unknown
    node.add_pre_set_parameters_callback(partial(_known, node))
    announce(node, {})
    return values


def allow_changes(node: Node, fields: Mapping[str, dataclasses.Field], values: Mapping[str, Any],
                  change: Callable[[dict[str, Any]], None]) -> Callable[[Mapping[str, Any]], None]:
    """
    Let parameters of a node change while it runs, all of one request or none.

    `change` is given the values of all parameters as they are to be; where it raises anything,
    nothing changes, and whoever asked is told why. Returns what puts back the values of before,
    where a change turns out later not to work.
    """
    current = {name: _public(fields[name], value) for name, value in values.items()}
    stays = {name for name, field in fields.items() if not field.metadata['live']}

    def as_declared(parameters: list[Parameter]) -> list[Parameter]:
        _known(node, parameters)
        try:
            found = [_as_declared(fields[each.name], each) if each.name in fields else each
                     for each in parameters]
            kept = [each for each in found if each.name not in stays
                    or checked(fields[each.name], each.value, each.name) != current[each.name]]
            if fixed := [each.name for each in kept if each.name in stays]:
                raise ParameterError(f'read-only while the node runs: {", ".join(fixed)}; nothing '
                                     'is changed. Leave them out, or start the node anew')
        except ParameterError as error:
            raise _Refused(str(error)) from None
        except Exception as error:
            raise _Refused(f'refused: {type(error).__name__}: {one_line(error)}') from None
        return kept or found

    def put_back(before: Mapping[str, Any]) -> None:
        undone = {name: value for name, value in before.items() if value != current[name]}
        current.update(undone)   # so that nothing is asked to change
        node.set_parameters([Parameter(name, value=_listed(value))
                             for name, value in undone.items()])

    def on_set(parameters: list[Parameter]) -> SetParametersResult:
        asked = {each.name: checked(fields[each.name], each.value, each.name)
                 for each in parameters if each.name in fields}
        try:
            if {**current, **asked} != current:
                change({**current, **asked})
        except ParameterError as error:
            return SetParametersResult(successful=False, reason=str(error))
        except BaseException as error:
            return SetParametersResult(successful=False, reason=(
                f'refused: {type(error).__name__}: {one_line(error)}'))
        for name, value in asked.items():
            if value != current[name]:
                node.get_logger().info(f'{name} is {short(value)} now; it was '
                                       f'{short(current[name])}')
        current.update(asked)
        return SetParametersResult(successful=True)

    node._pre_set_parameters_callbacks.clear()   # rclpy sets what each of them returns
    node.add_pre_set_parameters_callback(as_declared)
    node.add_on_set_parameters_callback(on_set)
    return put_back


def _public(field: dataclasses.Field, value: Any) -> Any:
    """Return what others are told that a parameter is."""
    return field.default if field.metadata['secret'] else value


def short(value: Any) -> str:
    """Return a value as text for a log; that of a learned model may be long."""
    text = str(value)
    return text if len(text) <= SHOWN else f'{text[:SHOWN]}...'


class _Refused(ParameterNotDeclaredException):
    """What rclpy answers a request with before it looks at the types, which it would not name."""

    def __init__(self, reason: str) -> None:
        super().__init__([])
        self.reason = reason

    def __str__(self) -> str:
        return self.reason


def _known(node: Node, parameters: list[Parameter]) -> list[Parameter]:
    """Return parameters that are to be set; refuse such that a node has not."""
    for each in parameters:
        if not node.has_parameter(each.name):
            raise _Refused(str(unknown(each.name, node.get_name(),
                                       node.list_parameters([], 0).names)))
    return parameters


def _as_declared(field: dataclasses.Field, asked: Parameter) -> Parameter:
    """
    Let do for numbers what people write for them, which the types of ROS keep apart.

    They are whole numbers, and texts: YAML 1.1 takes 1e4 for one, and so does `ros2 param set`.
    Raises ParameterError.
    """
    value = _listed(asked.value)
    default: Any = field.default
    listed = isinstance(default, tuple)
    kind = type(default[0] if listed else default)
    if isinstance(value, str) and (listed or kind is not str):
        value = value_of(value, asked.name)
    elif isinstance(value, list) and listed and kind is not str:
        value = [value_of(each, asked.name) if isinstance(each, str) else each for each in value]
    value = _listed(checked(field, value, asked.name))
    # an empty list would not show of what it is one
    return Parameter(asked.name, getattr(Parameter.Type, TYPES[kind] + '_ARRAY' * listed), value)


def announce(node: Node, found: Mapping[str, Any], revision: int = 0, since: int = 0,
             resets: int = 0) -> None:
    """
    Publish what a node runs with: its parameters, or what it found instead of some.

    They are those of a revision, which counts since a time [ns], after so many resets.
    """
    declared = {each.name: each.value for each in node.get_parameters(
        sorted(node.list_parameters([], 0).names)) if not each.name.startswith(QOS_OVERRIDES)}
    configured = Configuration(
        node.get_fully_qualified_name(),
        {name: _listed(value) for name, value in {**declared, **found}.items()},
        package_version(), commit(), sources(), machine(), packages(), revision,
        since, resets)
    name = node.resolve_topic_name(CONFIGURATION.name)
    own = [each for each in node.publishers if each.topic_name == name]   # of an earlier call
    publisher = own[0] if own else publish(node, CONFIGURATION)
    publisher.publish(String(data=configured.to_text()))


def refuse_unknown(node: Node, of_topics: bool) -> None:
    """Refuse, by ParameterError, what was given for no parameter: of its topics' QoS, or else."""
    known = node.list_parameters([], 0).names
    for name in sorted(set(overrides(node)) - set(known)):
        if name.startswith(QOS_OVERRIDES) == of_topics and (
                name not in _for_any_node(sys.argv, node.get_name())):
            raise unknown(name, node.get_name(), (
                each for each in known if each.startswith(QOS_OVERRIDES) == of_topics))


def _warn_of_files(node: Node) -> None:
    """Warn of parameter files that hold nothing for a node, which may be called otherwise."""
    known = node.list_parameters([], 0).names
    for path in files_in(sys.argv):
        found = sections(path)
        if not for_node(found, node.get_fully_qualified_name(), known):
            node.get_logger().warning(f'{path} holds nothing for {node.get_fully_qualified_name()}'
                                      f', but for {", ".join(dict(found))}')


def check_given(arguments: list[str]) -> None:
    """Raise ParameterError for what ROS cannot take of a command line, which it names itself."""
    for option, value in pairwise(arguments):
        if option in RULE and ':=' in value:
            value_of(value.split(':=', 1)[1], _named(value))
    for path in files_in(arguments):
        sections(path)


def files_in(arguments: list[str]) -> list[Path]:
    """Return the parameter files that a command line names."""
    return [Path(value) for option, value in pairwise(arguments) if option == FILE]


def _for_any_node(arguments: list[str], node: str) -> set[str]:
    """Return the names that parameter files give to any node (/**), and nothing to this one."""
    shared, own = set[str](), {
        _named(value) for option, value in pairwise(arguments) if option in RULE}
    for path in files_in(arguments):
        for pattern, values in sections(path):
            name = pattern.rsplit('/', 1)[-1]
            if name in ANY_NODE:
                shared |= set(values)
            elif name == node:
                own |= set(values)
    return shared - own


def _named(rule: str) -> str:
    """Return the name of a parameter in [NODE:]NAME:=VALUE."""
    return rule.split(':=')[0].rsplit(':', 1)[-1]


def _listed(value: Any) -> Any:
    # we hold lists in tuples, rclpy those of numbers in arrays
    return list(value) if isinstance(value, (array, tuple)) else value


def _descriptor(field: dataclasses.Field, live: bool) -> ParameterDescriptor:
    # unit and default have no field of their own; who wants them apart finds them at the end
    about = field.metadata
    unit = f' [{about["unit"]}]' if about['unit'] else ''
    descriptor = ParameterDescriptor(
        description=f'{about["description"]}{unit} (default: {shown(field.default)})',
        read_only=not (live and about['live']))
    low, high = about['minimum'], about['maximum']
    if isinstance(field.default, tuple) or math.isinf(low) and math.isinf(high):
        # ROS knows no range of the elements of a list.
        descriptor.additional_constraints = expected(field)
    elif isinstance(field.default, int):
        descriptor.integer_range = [IntegerRange(
            from_value=int(max(low, -LARGEST)), to_value=int(min(high, LARGEST)))]
    else:
        descriptor.floating_point_range = [FloatingPointRange(
            from_value=float(low), to_value=float(high))]
    return descriptor
