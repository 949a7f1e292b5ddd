# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Read messages by their fields; needs no ROS, so it reads those of a bag just as well."""

from typing import Any, NamedTuple

import numpy as np

from dp_swing_ros.pendulum.state import Array, joints, LINKS

BILLION = 1_000_000_000  # nanoseconds in a second


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


def seconds(stamp: Any) -> float:
    """Return a Time or Duration in seconds, the closest float there is."""
    return nanoseconds(stamp) / BILLION


def nanoseconds(stamp: Any) -> int:
    """Return a Time or Duration in nanoseconds, exactly."""
    return stamp.sec * BILLION + stamp.nanosec


def to_state(message: Any, links: int) -> Array:
    """
    Return the state of a JointState, whatever the order of its joints, and whatever others it has.

    Shapes: (2n + 2,) for n links. What is not finite is left so. Raises ValueError if a joint, a
    position or a velocity is missing, or if there are joints of more links.
    """
    names, wanted = list(message.name), joints(links)
    missing = [joint for joint in wanted if joint not in names]
    if missing:
        raise ValueError(f'JointState has no {", ".join(missing)}; it names {names}; expected '
                         f'[{", ".join(wanted)}]: rename them, or start plant and mpc with the '
                         'same links')
    if links_in(message) > links:
        found = joints(links_in(message))
        raise ValueError(f'JointState has {len(found)} joints [{", ".join(found)}]; expected '
                         f'{len(wanted)} [{", ".join(wanted)}]: start plant and mpc with the same '
                         'links')
    for field in ('position', 'velocity'):
        if len(getattr(message, field)) != len(names):
            raise ValueError(f'JointState names {len(names)} joints, '
                             f'but its {field} has {len(getattr(message, field))} numbers')
    order = [names.index(joint) for joint in wanted]
    return np.concatenate([np.asarray(message.position)[order],
                           np.asarray(message.velocity)[order]])


def links_in(message: Any) -> int:
    """Return for how many links, at least one, a JointState names the joints: joint1, joint2 …."""
    return max([links for links in LINKS if set(joints(links)) <= set(message.name)],
               default=min(LINKS))


def to_force(message: Any) -> float:
    """Return the force [N] over the period before a JointState; NaN if it gives none."""
    index = list(message.name).index('cart')
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
        if driven == hardware and name == status.name.rsplit('/', 1)[-1] \
                or not driven and name == status.name:
            level = status.level[0] if isinstance(status.level, bytes) else status.level
            return Report(nanoseconds(message.header.stamp), level, status.message,
                          {pair.key: _value(pair.value) for pair in status.values})
    return None


def _value(text: str) -> float | int | str:
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
