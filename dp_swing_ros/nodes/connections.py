# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Publishers and subscriptions, each with a quality of service by which all are heard."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
import math
import time
from typing import Any, NamedTuple

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.duration import Duration
from rclpy.exceptions import InvalidParameterException, InvalidParameterTypeException
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import (
    DurabilityPolicy, LivelinessPolicy, qos_check_compatible, QoSCompatibility, QoSPolicyKind,
    QoSProfile, ReliabilityPolicy)
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

from dp_swing_ros.messages.fields import BILLION
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.parameters.files import parse, QOS_OVERRIDES
from dp_swing_ros.topics import Topic

DEPTH = 10          # messages that wait for a subscription's callback
HISTORY = 1000      # messages that a publisher keeps for subscriptions that have stalled
QUEUE = 10_000      # messages of a topic that wait for the logger
LASTING = 1000      # messages that replay keeps for whoever asks for those before its time
QUIET = 40          # looks without another subscription: all have been found
ENDLESS = 9e9       # [s]; the middleware has no infinity
DEADLINE = 0.25     # [s] between two messages of a watched topic, while states come as often
NAMELESS = '_NODE_NAME_UNKNOWN_'   # as rmw calls a node whose name is not discovered yet
LOOK_PERIOD = 0.02  # [s] between two looks for subscriptions
SPARING, AT_ONCE = 0.1, 10   # [s] between messages that cannot be urgent, after so many at once
LEASE = 0.5         # [s] after which a publisher of a watched topic that is silent is dead
POLICIES = ('reliability', 'durability', 'deadline', 'liveliness', 'liveliness_lease_duration')
OVERRIDABLE = [QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, *(
    QoSPolicyKind[policy.upper()] for policy in POLICIES)]


def publish(node: Node, topic: Topic) -> Publisher:
    """
    Make a reliable publisher; of a latched topic its last message waits for who joins late.

    That of a watched topic is one whose silence and death a subscription may ask to hear of.
    Raises ParameterError where a parameter overrides this quality of service impossibly.
    """
    with _overrides_checked(node, topic):
        return node.create_publisher(
            message_class(topic.type), topic.name,
            profile(1 if topic.latched else HISTORY, kept=topic.latched, watched=topic.watched),
            qos_overriding_options=QoSOverridingOptions(OVERRIDABLE))


def subscribe(node: Node, topic: Topic, callback: Callable[..., None],
              depth: int = DEPTH, sensor: bool = False, raw: bool = False,
              sparing: bool = False, entity_id: str | None = None) -> Subscription:
    """
    Make a reliable subscription; a sensor's is best effort, so that every publisher is heard.

    A sparing one takes a message once in a while, however many come. A second one to a topic has
    an `entity_id`, which rclpy puts into the names of its overrides.

    That of a latched topic hears also what was sent before it was made. The callback may take a
    second argument, the information that comes with a message; if `raw`, the message is its bytes.
    Raises ParameterError as `publish`.
    """
    with _overrides_checked(node, topic):
        return node.create_subscription(
            message_class(topic.type), topic.name, callback,
            profile(depth, reliable=not sensor, kept=topic.latched),
            callback_group=Sparing() if sparing else None,
            qos_overriding_options=QoSOverridingOptions(OVERRIDABLE, entity_id=entity_id), raw=raw)


class Sparing(MutuallyExclusiveCallbackGroup):
    """Calls back so often at most; of what comes meanwhile the newest wait in the middleware."""

    def __init__(self) -> None:
        """Begin with all the calls that may come at once."""
        super().__init__()
        self.spent = -math.inf   # [s] of time.monotonic() until which the calls so far suffice

    def can_execute(self, entity: Any) -> bool:
        """Return whether it is time for another."""
        return time.monotonic() >= self.spent - SPARING * (AT_ONCE - 1) \
            and bool(super().can_execute(entity))

    def beginning_execution(self, entity: Any) -> bool:
        """Count a call."""
        self.spent = max(self.spent, time.monotonic()) + SPARING
        return bool(super().beginning_execution(entity))


@contextmanager
def _overrides_checked(node: Node, topic: Topic) -> Iterator[None]:
    # rclpy raises as many kinds of errors as there are mistakes to make in an override
    prefix = f'{QOS_OVERRIDES}{node.resolve_topic_name(topic.name)}.'
    try:
        yield
    except (AttributeError, InvalidParameterException, InvalidParameterTypeException,
            RuntimeError, TypeError, ValueError) as error:
        if not any(name.startswith(prefix) for name in node._parameter_overrides):
            raise
        raise ParameterError(f'a parameter {prefix}... is impossible: {error}; expected as in '
                             f'{prefix}publisher.durability:=transient_local') from None


class Audience:
    """The subscriptions of some publishers: complete when several looks find no more."""

    def __init__(self, publishers: Iterable[Publisher], patience: float) -> None:
        """Take the publishers, and how long to wait for the first subscription at most [s]."""
        self.publishers = list(publishers)
        self.found = self.looks = 0
        self.give_up = time.monotonic() + patience

    def complete(self) -> bool:
        """Return whether to wait no longer; to be asked every LOOK_PERIOD."""
        found = sum(publisher.get_subscription_count() for publisher in self.publishers)
        # looks, not seconds: on a busy machine they come as late as those who are looked for
        self.looks = self.looks + 1 if found == self.found else 0
        self.found = found
        return time.monotonic() > self.give_up or found > 0 and self.looks >= QUIET


def listeners(node: Node, publisher: Publisher, partners: Topic) -> set[bytes]:
    """Return the subscriptions of a publisher's topic by nodes that publish another topic."""
    wanted = owners(node, partners)
    return {bytes(each.endpoint_gid)
            for each in node.get_subscriptions_info_by_topic(publisher.topic_name)
            if owner(each) in wanted}


def is_heard(node: Node, publisher: Publisher, wanted: set[str]) -> bool:
    """
    Return whether all nodes of these names, of which there are some, hear a publisher.

    Until then a message may be lost to them: discovery goes one way at a time.
    """
    return bool(wanted) and wanted <= hearers(node, publisher)


def hearers(node: Node, publisher: Publisher) -> set[str]:
    """Return the nodes that hear a publisher; none before all that are there do."""
    own = node.get_fully_qualified_name()
    senders = [each for each in node.get_publishers_info_by_topic(publisher.topic_name)
               if owner(each) == own]
    listeners = [each for each in node.get_subscriptions_info_by_topic(publisher.topic_name)
                 if not any(mismatch(sender, each) for sender in senders)]
    complete = publisher.get_subscription_count() >= len(listeners)
    return set(map(owner, listeners)) if complete else set()


class Mismatch(NamedTuple):
    """Why a subscription does not hear a publisher."""

    of: str     # type, or one of POLICIES
    text: str


def mismatch(sender: TopicEndpointInfo, listener: TopicEndpointInfo) -> Mismatch | None:
    """Return what keeps a subscription from hearing a publisher, if anything does."""
    if sender.topic_type != listener.topic_type:
        return Mismatch('type', f'{sender.topic_type} is sent, {listener.topic_type} expected')
    for policy in POLICIES:
        offered, asked = (getattr(each.qos_profile, policy) for each in (sender, listener))
        if qos_check_compatible(*(QoSProfile(depth=1, **{policy: each}) for each in (
                offered, asked)))[0] == QoSCompatibility.ERROR:
            return Mismatch(
                policy, f'{policy} {_word(offered)} is offered, {_word(asked)} is asked for')
    return None


def _word(policy: Any) -> str:
    if isinstance(policy, Duration):
        seconds = policy.nanoseconds / BILLION
        return f'{seconds:g} s' if seconds < ENDLESS else 'without end'
    return str(policy.name.lower())


def owners(node: Node, topic: Topic) -> set[str]:
    """Return the full names of the nodes that publish a topic."""
    return set(map(owner, node.get_publishers_info_by_topic(node.resolve_topic_name(topic.name))))


def sender_of(node: Node, topic: Topic, gid: bytes) -> str:
    """Return the full name of the node whose publisher has a GID, once it is discovered."""
    return next((owner(each) for each in node.get_publishers_info_by_topic(
        node.resolve_topic_name(topic.name))
        if bytes(each.endpoint_gid) == gid and NAMELESS not in owner(each)), 'a publisher')


def owner(endpoint: TopicEndpointInfo) -> str:
    """Return the full name of the node that an endpoint is of."""
    return f'{endpoint.node_namespace.rstrip("/")}/{endpoint.node_name}'


def message_class(name: str) -> type:
    """Return the class of a type by its name; raises ImportError or AttributeError."""
    package, kind, message = name.split('/')
    return getattr(import_module(f'{package}.{kind}'), message)


def profile(depth: int, reliable: bool = True, kept: bool = False,
            watched: bool = False) -> QoSProfile:
    """
    Return a profile; with `kept`, messages wait for those who join late.

    With `watched`, it offers a deadline and a lease, which a subscription need not ask for.
    """
    promises = {'deadline': Duration(seconds=DEADLINE),
                'liveliness': LivelinessPolicy.AUTOMATIC,
                'liveliness_lease_duration': Duration(seconds=LEASE)}
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE,
        **(promises if watched else {}))


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


def _policy(kind: Any, value: str | int) -> Any:
    # of ROS 2 before Jazzy they are numbers, those of rclpy
    return kind[value.upper()] if isinstance(value, str) else kind(value)
