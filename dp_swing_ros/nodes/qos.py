# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""QoS profiles: those of publishers, and what to ask for or to offer so that all are heard."""

from collections.abc import Sequence
from enum import IntEnum
from typing import Any, TypeVar

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy

from dp_swing_ros.messages.fields import BILLION
from dp_swing_ros.parameters.plain_yaml import parse

Policy = TypeVar('Policy', bound=IntEnum)

QUEUE = 10_000  # messages of a topic that wait for us
LASTING = 1000  # messages that replay keeps for whoever asks for those before its time


def profile(depth: int, reliable: bool = True, kept: bool = False) -> QoSProfile:
    """Return a profile; with `kept`, messages wait for those who join late."""
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE)


def request_for(offered: Sequence[QoSProfile]) -> QoSProfile:
    """Return the most that all publishers offer: one that offers less is never heard."""
    return profile(
        QUEUE,
        reliable=all(each.reliability == ReliabilityPolicy.RELIABLE for each in offered),
        kept=all(each.durability == DurabilityPolicy.TRANSIENT_LOCAL for each in offered))


def described(offered: QoSProfile) -> dict[str, Any]:
    """Return a profile in the words of rosbag2's metadata."""
    return {'history': offered.history.name.lower(), 'depth': offered.depth,
            'reliability': offered.reliability.name.lower(),
            'durability': offered.durability.name.lower(),
            'deadline': _parts(offered.deadline), 'lifespan': _parts(offered.lifespan),
            'liveliness': offered.liveliness.name.lower(),
            'liveliness_lease_duration': _parts(offered.liveliness_lease_duration),
            'avoid_ros_namespace_conventions': offered.avoid_ros_namespace_conventions}


def _parts(duration: Duration) -> dict[str, int]:
    second, nanosecond = divmod(duration.nanoseconds, BILLION)
    return {'sec': second, 'nsec': nanosecond}


def strongest(text: str) -> QoSProfile:
    """
    Return a profile for the subscriptions of all publishers, whose profiles a bag has as YAML.

    Raises ValueError where they are none.
    """
    try:
        profiles = parse(text) or [{}]
        found = QoSProfile(
            depth=max([LASTING, *(each.get('depth', 0) for each in profiles)]),
            reliability=min(_policy(ReliabilityPolicy, each.get('reliability', 'reliable'))
                            for each in profiles),
            durability=min(_policy(DurabilityPolicy, each.get('durability', 'volatile'))
                           for each in profiles),
            liveliness=max(_policy(LivelinessPolicy, each.get('liveliness', 'automatic'))
                           for each in profiles))
        for name in ('deadline', 'liveliness_lease_duration'):
            times = [each[name] for each in profiles if name in each]
            if times:
                setattr(found, name, min(Duration(
                    seconds=each['sec'], nanoseconds=each['nsec']) for each in times))
    except (ArithmeticError, AttributeError, KeyError, TypeError, ValueError) as error:
        raise ValueError(f'its quality of service is {text[:80]!r}: '
                         f'{" ".join(str(error).split())}') from None
    return found


def _policy(kind: type[Policy], value: Any) -> Policy:
    # of ROS 2 before Jazzy they are numbers, those of rclpy
    return kind[value.upper()] if isinstance(value, str) else kind(value)
