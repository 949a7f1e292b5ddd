# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Publishers and subscriptions of the topics, with their quality of service."""

from importlib import import_module
from typing import Callable

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

from dp_swing_ros.topics import Topic


def publish(node: Node, topic: Topic) -> Publisher:
    """Make a reliable publisher that keeps its last messages for subscribers that join late."""
    profile = QoSProfile(depth=topic.depth, reliability=ReliabilityPolicy.RELIABLE,
                         durability=DurabilityPolicy.TRANSIENT_LOCAL)
    return node.create_publisher(message_class(topic.type), topic.name, profile)


def subscribe(node: Node, topic: Topic, callback: Callable[..., None],
              depth: int = 10, kept: bool = False) -> Subscription:
    """
    Make a reliable subscription; with kept, also for what was sent before it was made.

    The callback may take a second argument, the information that comes with a message.
    """
    profile = QoSProfile(depth=depth, reliability=ReliabilityPolicy.RELIABLE,
                         durability=DurabilityPolicy.TRANSIENT_LOCAL if kept
                         else DurabilityPolicy.VOLATILE)
    return node.create_subscription(message_class(topic.type), topic.name, callback, profile)


def is_heard(node: Node, publisher: Publisher, partners: Topic) -> bool:
    """
    Tell whether all nodes that publish another topic, of which there are some, hear a publisher.

    Until then a message may be lost to them: discovery goes one way at a time.
    """
    senders = node.get_publishers_info_by_topic(node.resolve_topic_name(partners.name))
    listeners = node.get_subscriptions_info_by_topic(publisher.topic_name)
    wanted, found = (set(map(_owner, infos)) for infos in (senders, listeners))
    return bool(wanted) and wanted <= found and (
        publisher.get_subscription_count() >= len(listeners))


def _owner(info: TopicEndpointInfo) -> tuple[str, str]:
    return info.node_namespace, info.node_name


def message_class(name: str) -> type:
    """
    Return the class of a type such as 'std_msgs/msg/Float64'.

    Raises ImportError or AttributeError if it is not installed.
    """
    package, kind, message = name.split('/')
    return getattr(import_module(f'{package}.{kind}'), message)
