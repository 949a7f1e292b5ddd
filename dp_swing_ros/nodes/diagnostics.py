# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What a node publishes on /diagnostics: its status, and what is wrong with its topics.

A status carries the node's full name, so that of several pendulums each has its own, and as
hardware the topic of the joint states that it drives.
"""

from collections.abc import Iterator

from rclpy.node import Node

from dp_swing_ros.messages.cdr import to_diagnostics
from dp_swing_ros.messages.fields import ERROR, OK, Report, WARN
from dp_swing_ros.messages.states import States
from dp_swing_ros.nodes.connections import mismatch, NAMELESS, owner, POLICIES, publish
from dp_swing_ros.nodes.messages import to_stamp
from dp_swing_ros.nodes.process import ProcessNode
from dp_swing_ros.topics import COMMAND_TOPICS, DIAGNOSTICS, JOINT_STATES

LOOK_PERIOD = 1.0  # [s] between looks at the topics
SINGLE = (JOINT_STATES, *COMMAND_TOPICS)  # one publisher each, or nobody knows whom to obey


class Diagnostics:
    """Publishes the status of a node, and once a second that of its topics while it is not OK."""

    def __init__(self, node: ProcessNode, states: States | None = None) -> None:
        """Take the node whose status it is, and which states it hears, if it does."""
        self.node, self.states = node, states
        self.name = node.get_fully_qualified_name().lstrip('/')
        self.hardware = node.resolve_topic_name(JOINT_STATES.name)
        self.publisher = publish(node, DIAGNOSTICS)
        self.faulty = False   # the topics were, at the last look
        self.rivals = list[str]()   # topics that have more publishers than one, in words
        self.logged = set[str]()
        node.every(LOOK_PERIOD, self.on_look)

    def publish(self, report: Report) -> None:
        """Publish the node's status, or that of a part of it."""
        stamp, level, message, values, part = report
        name = f'{self.name}: {part}' if part else self.name
        self.publisher.publish(to_diagnostics(to_stamp(stamp), name, level, message, values,
                                              self.hardware))

    def on_look(self) -> None:
        """Publish what is wrong with the topics, and once that nothing is any more."""
        errors, warnings = list(incompatible(self.node)), list(rivals(self.node, self.states))
        logger, before, self.rivals = self.node.get_logger(), self.logged, warnings
        new = [text for text in errors + warnings
               if _fact(text) not in before and NAMELESS not in text]
        for text in new:
            if text in errors:   # to rclpy each line of code is of one severity
                logger.error(text)
            else:
                logger.warning(text)
        self.logged = set(map(_fact, errors + warnings))
        if self.states is not None and self.states.refusal:
            errors.append(self.states.refusal)
        if not (errors or warnings or self.faulty):
            return
        self.faulty = bool(errors or warnings)
        self.publish(Report(
            self.node.get_clock().now().nanoseconds,
            ERROR if errors else WARN if warnings else OK,
            '; '.join(errors + warnings) or 'one publisher each, heard by all',
            {'incompatible': len(errors), 'rivals': len(warnings)}, 'topics'))


def _fact(text: str) -> str:
    """Return the part of a text that is not said again, whoever is obeyed meanwhile."""
    return text.partition('; expected')[0]


def rivals(node: Node, states: States | None = None) -> Iterator[str]:
    """
    Yield each topic that has more publishers than the one it is for, and who they are.

    Robots share the topic of the states: whoever hears it knows who sends those of others. To a
    plant, its rivals are those that hear the force, too.
    """
    for topic in SINGLE:
        name = node.resolve_topic_name(topic.name)
        if node.count_publishers(name) < 2:
            continue
        others, obeyed = (states.others, states.obeyed) if states is not None \
            and topic is JOINT_STATES else (set[bytes](), b'')
        found = {gid: owner(each) for each in node.get_publishers_info_by_topic(name)
                 if (gid := bytes(each.endpoint_gid)) not in others}
        if topic is JOINT_STATES and states is None:
            obeying = {owner(each) for command in COMMAND_TOPICS
                       for each in node.get_subscriptions_info_by_topic(
                           node.resolve_topic_name(command.name))}
            found = {gid: each for gid, each in found.items() if each in obeying}
            if node.get_fully_qualified_name() not in found.values():
                continue
        if len(found) > 1:
            words = f'; {found[obeyed]}, heard first, is obeyed' if obeyed in found else ''
            yield (f'{name} has {len(found)} publishers, {", ".join(sorted(found.values()))}; '
                   f'expected one{words}')


def incompatible(node: Node) -> Iterator[str]:
    """Yield who is on a topic of a node and neither hears it nor is heard, why, and a remedy."""
    own = node.get_fully_qualified_name()
    topics = {each.topic_name for each in node.publishers}
    topics |= {each.topic_name for each in node.subscriptions}
    for name in sorted(topics):
        for sender in node.get_publishers_info_by_topic(name):
            for listener in node.get_subscriptions_info_by_topic(name):
                if own not in (owner(sender), owner(listener)):
                    continue
                found = mismatch(sender, listener)
                if found:
                    other, end = (listener, 'publisher') if own == owner(sender) else (
                        sender, 'subscription')
                    override = f', or set qos_overrides.{name}.{end}.{found.of} of {own}' \
                        if found.of in POLICIES else ''
                    yield (f'{name} from {owner(sender)} to {owner(listener)}: {found.text}; '
                           f'change that of {owner(other)}{override}')
