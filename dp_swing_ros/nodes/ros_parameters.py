# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The parameters of a node, made from the dataclasses that declare them.

Whatever is wrong with what the user gave ends in a ParameterError.
"""

from array import array
from collections.abc import Callable, Mapping
import dataclasses
from itertools import pairwise
import math
from pathlib import Path
import sys
from typing import Any

from rcl_interfaces.msg import (
    FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult)
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import String

from dp_swing_ros.messages.configuration import Configuration
from dp_swing_ros.nodes.connections import publish
from dp_swing_ros.nodes.parameters import shown
from dp_swing_ros.parameters import checked, expected, LARGEST, ParameterError, SHOWN, unknown
from dp_swing_ros.parameters.files import ANY_NODE, QOS_OVERRIDES, sections
from dp_swing_ros.provenance import commit, machine, package_version, packages, sources
from dp_swing_ros.topics import CONFIGURATION


def given(node: Node) -> dict[str, Any]:
    """Return what was given on the command line and in parameter files, by name."""
    # rclpy has no public way to ask; an empty list reaches a node without a type or a value
    return {name: () if override.type_ is Parameter.Type.NOT_SET else override.value
            for name, override in node._parameter_overrides.items()}


def declare(node: Node, fields: Mapping[str, dataclasses.Field],
            live: bool = False) -> dict[str, Any]:
    """
    Declare ROS parameters, refuse what nobody declared, and publish what the node runs with.

    fields are by the full names; unless `live`, a parameter is read-only once the node runs; see
    let_change. Returns their values. Raises ParameterError, naming the closest match and all the
    choices.
    """
    asked, values = given(node), {}
    for name, field in fields.items():
        values[name] = checked(field, asked.get(name, field.default), name)
        # The override is left aside: it is in the value already, there in its declared type.
        # Whoever asks is not told a secret.
        told = field.default if field.metadata['secret'] else values[name]
        node.declare_parameter(name, _listed(told), _descriptor(field, live),
                               ignore_override=True)
    refuse_unknown(node, of_topics=False)
    announce(node, {})
    return values


def let_change(node: Node, fields: Mapping[str, dataclasses.Field], values: Mapping[str, Any],
               change: Callable[[dict[str, Any]], None]) -> None:
    """
    Let parameters of a node change while it runs, all of one request or none.

    `change` is given the values of all parameters as they are to be; where it raises
    ParameterError, nothing changes, and whoever asked is told why.
    """
    current = dict(values)

    def with_numbers(parameters: list[Parameter]) -> list[Parameter]:
        """Let whole numbers do for numbers, which the types of ROS keep apart."""
        # an empty list would not show of what it is one
        return [Parameter(each.name, value=_numbers(fields[each.name], each.value))
                if each.name in fields and _listed(each.value) != [] else each
                for each in parameters]

    def on_set(parameters: list[Parameter]) -> SetParametersResult:
        try:
            asked = {each.name: checked(fields[each.name], each.value, each.name)
                     for each in parameters if each.name in fields}
            if {**current, **asked} != current:
                change({**current, **asked})
        except ParameterError as error:
            return SetParametersResult(successful=False, reason=str(error))
        for name, value in asked.items():
            if value != current[name]:
                node.get_logger().info(f'{name} is {short(value)} now; it was '
                                       f'{short(current[name])}')
        current.update(asked)
        return SetParametersResult(successful=True)

    node.add_pre_set_parameters_callback(with_numbers)
    node.add_on_set_parameters_callback(on_set)


def short(value: Any) -> str:
    """Return a value as text for a log; that of a learned model may be long."""
    text = str(value)
    return text if len(text) <= SHOWN else f'{text[:SHOWN]}...'


def _numbers(field: dataclasses.Field, value: Any) -> Any:
    default: Any = field.default
    if isinstance(default, tuple):
        return value if not isinstance(default[0], float) or isinstance(value, str) \
            else [_whole_as_number(each) for each in value or ()]
    return _whole_as_number(value) if isinstance(default, float) else value


def _whole_as_number(value: Any) -> Any:
    return float(value) if type(value) is int else value


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
    for name in sorted(set(given(node)) - set(known)):
        if name.startswith(QOS_OVERRIDES) == of_topics and (
                name not in _for_any_node(sys.argv, node.get_name())):
            raise unknown(name, node.get_name(), (
                each for each in known if each.startswith(QOS_OVERRIDES) == of_topics))


def _for_any_node(arguments: list[str], node: str) -> set[str]:
    """Return the names that parameter files give to any node (/**), and nothing to this one."""
    options = list(pairwise(arguments))
    shared, own = set[str](), {value.split(':=')[0].rsplit(':', 1)[-1]
                               for option, value in options if option in ('-p', '--param')}
    for path in (value for option, value in options if option == '--params-file'):
        for pattern, values in sections(Path(path)):
            name = pattern.rsplit('/', 1)[-1]
            if name in ANY_NODE:
                shared |= set(values)
            elif name == node:
                own |= set(values)
    return shared - own


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
