# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""QoS profiles: those of publishers, and what to ask for or to offer so that all are heard."""

from collections.abc import Sequence
from enum import IntEnum
from typing import Any, NamedTuple, TypeVar

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from dp_swing_ros.messages.fields import BILLION
from dp_swing_ros.parameters.plain_yaml import parse

Policy = TypeVar('Policy', bound=IntEnum)

QUEUE = 10_000  # messages of a topic that wait for us
LASTING = 1000  # messages that replay keeps for whoever asks for those before its time


class Request(NamedTuple):
    """The quality of service that a subscription asks for."""

    reliable: bool
    kept: bool  # the messages that a publisher kept for those who join late, too

    def to_profile(self) -> QoSProfile:
        """Convert to ROS."""
        return QoSProfile(
            depth=QUEUE,
            reliability=ReliabilityPolicy.RELIABLE if self.reliable
            else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if self.kept
            else DurabilityPolicy.VOLATILE)

    def within(self, other: 'Request') -> 'Request':
        """Return what both ask for."""
        return Request(self.reliable and other.reliable, self.kept and other.kept)


def request_for(publishers: Sequence[TopicEndpointInfo]) -> Request:
    """Return the most that all publishers offer: one that offers less is never heard."""
    profiles = [publisher.qos_profile for publisher in publishers]
    return Request(
        reliable=all(each.reliability == ReliabilityPolicy.RELIABLE for each in profiles),
        kept=all(each.durability == DurabilityPolicy.TRANSIENT_LOCAL for each in profiles))


def described(profile: QoSProfile) -> dict[str, Any]:
    """Return a profile in the words of rosbag2's metadata."""
    return {'history': profile.history.name.lower(), 'depth': profile.depth,
            'reliability': profile.reliability.name.lower(),
            'durability': profile.durability.name.lower(),
            'deadline': _parts(profile.deadline), 'lifespan': _parts(profile.lifespan),
            'liveliness': profile.liveliness.name.lower(),
            'liveliness_lease_duration': _parts(profile.liveliness_lease_duration),
            'avoid_ros_namespace_conventions': profile.avoid_ros_namespace_conventions}


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
        profile = QoSProfile(
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
                setattr(profile, name, min(Duration(
                    seconds=each['sec'], nanoseconds=each['nsec']) for each in times))
    except (ArithmeticError, AttributeError, KeyError, TypeError, ValueError) as error:
        raise ValueError(f'its quality of service is {text[:80]!r}: '
                         f'{" ".join(str(error).split())}') from None
    return profile


def _policy(kind: type[Policy], value: Any) -> Policy:
    # of ROS 2 before Jazzy they are numbers, those of rclpy
    return kind[value.upper()] if isinstance(value, str) else kind(value)
