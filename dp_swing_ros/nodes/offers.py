# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The quality of service that publishers offer, and what to ask for so that all are heard."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from dp_swing_ros.bags.fields import BILLION

QUEUE = 10_000  # messages of a topic that wait for us


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
