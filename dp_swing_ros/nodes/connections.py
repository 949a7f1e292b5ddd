# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Publishers and subscriptions of the topics, with their quality of service."""

from enum import IntEnum
from importlib import import_module
from typing import Any, Callable, TypeVar

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo
import yaml

from dp_swing_ros.bags.reader import Offer
from dp_swing_ros.errors import BagError
from dp_swing_ros.topics import KEPT, Topic

Policy = TypeVar('Policy', bound=IntEnum)


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


def owners(node: Node, topic: Topic) -> set[str]:
    """Return the full names of the nodes that publish a topic."""
    return {'/'.join((info.node_namespace.rstrip('/'), info.node_name))
            for info in node.get_publishers_info_by_topic(node.resolve_topic_name(topic.name))}


def _owner(info: TopicEndpointInfo) -> tuple[str, str]:
    return info.node_namespace, info.node_name


def publish_again(node: Node, name: str, offer: Offer) -> Publisher:
    """
    Make a publisher of what a bag holds, for whoever heard those that were recorded.

    Raises BagError where it cannot be.
    """
    try:
        if offer.encoding != 'cdr':
            raise ValueError(f'it is encoded as {offer.encoding!r}')
        return node.create_publisher(message_class(offer.type), name, _strongest(offer.qos))
    except (AttributeError, ImportError, RuntimeError, ValueError) as error:
        # rclpy's RCLError is a RuntimeError: here the topic may have another type
        raise BagError(f'{name} of type {offer.type!r} cannot be published here: {error}; '
                       'name the topics to play, without it') from None


def _strongest(text: str) -> QoSProfile:
    # What is offered satisfies each subscription that one of the profiles in the bag did.
    try:
        profiles = yaml.safe_load(text) or [{}]
        strongest = QoSProfile(
            depth=max([KEPT, *(each.get('depth', 0) for each in profiles)]),
            reliability=min(_policy(ReliabilityPolicy, each.get('reliability', 'reliable'))
                            for each in profiles),
            durability=min(_policy(DurabilityPolicy, each.get('durability', 'volatile'))
                           for each in profiles),
            liveliness=max(_policy(LivelinessPolicy, each.get('liveliness', 'automatic'))
                           for each in profiles))
        for name in ('deadline', 'liveliness_lease_duration'):
            times = [each[name] for each in profiles if name in each]
            if times:
                setattr(strongest, name, min(Duration(
                    seconds=each['sec'], nanoseconds=each['nsec']) for each in times))
    except (AttributeError, KeyError, TypeError, yaml.YAMLError) as error:
        raise ValueError(f'its quality of service is {text[:80]!r}: '
                         f'{" ".join(str(error).split())}') from None
    return strongest


def _policy(kind: type[Policy], value: Any) -> Policy:
    # of ROS 2 before Jazzy they are numbers, those of rclpy
    return kind[value.upper()] if isinstance(value, str) else kind(value)


def message_class(name: str) -> type:
    """
    Return the class of a type such as 'std_msgs/msg/Float64'.

    Raises ImportError or AttributeError if it is not installed.
    """
    package, kind, message = name.split('/')
    return getattr(import_module(f'{package}.{kind}'), message)
