# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Read messages by their fields; needs no ROS, so it reads those of a bag just as well."""

from collections.abc import Mapping, Sequence
import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np

from dp_swing_ros.messages.states import Kind, kind_of, missing
from dp_swing_ros.parameters import LARGEST
from dp_swing_ros.pendulum.sensors import SensorParameters
from dp_swing_ros.pendulum.state import Array, joints, LINKS

BILLION = 1_000_000_000  # nanoseconds in a second
OK, WARN, ERROR = range(3)   # levels of a report

Figures = Mapping[str, float | int | str]


class Trajectory(NamedTuple):
    """
    A plan as it was published.

    Shapes: t (N + 1,) [s] from its start, X (N + 1, 2n + 2), U (N,) [N].
    """

    t: Array
    X: Array
    U: Array


class Report(NamedTuple):
    """The status of a node at one time."""

    stamp: int  # [ns]
    level: int
    message: str
    values: dict[str, float | int | str]
    part: str = ''   # of the node, whose status it is


def diagnostic(words: str, unit: str = '', key: str = '', **default: Any) -> Any:
    """
    Declare a value of a report as a dataclass field: what it says, its unit, its default.

    `key` is that of each item of a mapping, around the item's own.
    """
    return dataclasses.field(metadata={'words': words, 'unit': unit, 'key': key}, **default)


def seconds(stamp: Any) -> float:
    """Return a Time or Duration in seconds, the closest float there is."""
    return nanoseconds(stamp) / BILLION


def nanoseconds(stamp: Any) -> int:
    """Return a Time or Duration in nanoseconds, exactly."""
    return stamp.sec * BILLION + stamp.nanosec


def to_state(message: Any, links: int, sensors: SensorParameters | None = None) -> Array:
    """
    Return the state of a JointState, as sensors measure it; without them, as a plant sends it.

    Shapes: (2n + 2,) for n links. Raises ValueError as `to_measured`, and if there are joints of
    more links by the names that ours have.
    """
    names = joints(links) if sensors is None else sensors.joint_names
    measured = to_measured(message, names)
    if names == joints(links) and links_in(message) > links:
        found = joints(links_in(message))
        raise ValueError(f'JointState has {len(found)} joints [{", ".join(found)}]; expected '
                         f'{len(names)} [{", ".join(names)}]: start plant and mpc with the same '
                         'links')
    return measured if sensors is None else sensors.state_of(measured)


def to_measured(message: Any, wanted: Sequence[str]) -> Array:
    """
    Return positions, then velocities, of joints of a JointState by their names in any order.

    Shapes: (2m,) for m joints. What is not finite is left so, and velocities are NaN where it has
    none. Raises ValueError if a joint or a position is missing, or some of the velocities.
    """
    names = list(message.name)
    if kind_of(names, wanted) is not Kind.STATE:
        raise ValueError(missing(names, wanted))
    velocity = message.velocity if len(message.velocity) else [math.nan] * len(names)
    for field, numbers in (('position', message.position), ('velocity', velocity)):
        if len(numbers) != len(names):
            raise ValueError(f'JointState names {len(names)} joints, '
                             f'but its {field} has {len(numbers)} numbers')
    order = [names.index(joint) for joint in wanted]
    return np.concatenate([np.asarray(message.position)[order], np.asarray(velocity)[order]])


def links_in(message: Any) -> int:
    """Return for how many links, at least one, a JointState names the joints: joint1, joint2 …."""
    return max([links for links in LINKS if set(joints(links)) <= set(message.name)],
               default=min(LINKS))


def to_force(message: Any, cart: str = 'cart') -> float:
    """Return the force [N] over the period before a JointState; NaN if it gives none."""
    index = list(message.name).index(cart)
    return float(message.effort[index]) if index < len(message.effort) else float('nan')


def from_trajectory(message: Any) -> Trajectory:
    """Return the plan of a JointTrajectory, whose joints are in the order of the state."""
    points = message.points
    return Trajectory(
        t=np.array([seconds(point.time_from_start) for point in points]),
        X=np.array([[*point.positions, *point.velocities] for point in points]),
        U=np.array([point.effort[0] for point in points[:-1]]))


def from_diagnostics(message: Any, name: str, hardware: str = '') -> Report | None:
    """
    Return the status of this name in a DiagnosticArray; None if there is none.

    With hardware, the topic of the joint states, it is that of the node of this name in any
    namespace that drives it. Bags from before names had namespaces do not say what is driven.
    """
    for status in message.status:
        driven = hardware and status.hardware_id
        last = status.name.rsplit('/', 1)[-1]
        if driven == hardware and name in (status.name, last) \
                or not driven and status.name in (name, name.rsplit('/', 1)[-1]):
            level = status.level[0] if isinstance(status.level, bytes) else status.level
            return Report(nanoseconds(message.header.stamp), level, status.message,
                          {pair.key: _value(pair.value) for pair in status.values})
    return None


def _value(text: str) -> float | int | str:
    for kind in (int, float):
        try:
            value = kind(text)
        except ValueError:
            continue
        if kind is float or abs(value) <= LARGEST:   # longer ones are numbers, not counts
            return value
    return text
