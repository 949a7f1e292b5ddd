# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Publishers and subscriptions of the topics, with their quality of service."""

from importlib import import_module
from typing import Any, Callable

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from dp_swing_ros.nodes.topics import Topic


def publish(node: Node, topic: Topic) -> Publisher:
    """Make a reliable publisher that keeps its last messages for subscribers that join late."""
    profile = QoSProfile(depth=topic.depth, reliability=ReliabilityPolicy.RELIABLE,
                         durability=DurabilityPolicy.TRANSIENT_LOCAL)
    return node.create_publisher(message_class(topic.type), topic.name, profile)


def subscribe(node: Node, topic: Topic, callback: Callable[[Any], None],
              depth: int = 10) -> Subscription:
    """Make a reliable subscription that never sees what was sent before it was made."""
    profile = QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE,
                         durability=DurabilityPolicy.VOLATILE)
    return node.create_subscription(message_class(topic.type), topic.name, callback, profile)


def message_class(name: str) -> type:
    """
    Return the class of a type such as 'std_msgs/msg/Float64'.

    Raises ImportError or AttributeError if it is not installed.
    """
    package, kind, message = name.split('/')
    return getattr(import_module(f'{package}.{kind}'), message)
