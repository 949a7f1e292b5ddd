# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A node that hears every state and every answer, and remembers when they were published."""

from array import array
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import ExitStack
import math
import time
from typing import Any, NamedTuple

from echo import ECHO

from dp_swing_ros.messages.fields import BILLION, nanoseconds, to_state
from dp_swing_ros.nodes.connections import QUEUE, subscribe
from dp_swing_ros.pendulum.state import Array, deviation, links_of
from dp_swing_ros.tools.tool_node import listeners, tool_node
from dp_swing_ros.topics import (
    DIAGNOSTICS, FORCE_COMMAND, FORCE_COMMAND_STAMPED, JOINT_STATES, Topic)

ROUNDING = 1e-9   # [N]


class Forces(NamedTuple):
    """How many there were, and how many of them must not have been."""

    total: int
    not_finite: int
    beyond_limit: int
    largest: float   # [N]


class Numbers(NamedTuple):
    """The first and the last number of the messages of a publisher, and how many came."""

    first: int
    last: int
    heard: int


class Watcher:
    """
    The node; used as a context manager.

    Messages wait for it in queues, and it takes them when it is told to: to be woken for each
    would cost the processes beside it more than they take themselves. Some 70 bytes remain of a
    tick.
    """

    def __init__(self, x_r: Array, force_limit: float) -> None:
        """Take the state that is to be held (2n + 2,), and the limit of the force [N]."""
        self.x_r, self.force_limit = x_r, force_limit
        # stamps and times of sending [ns]
        self.stamps, self.sent = array('q'), array('q')
        self.commands = array('q')
        self.answered, self.answers = array('q'), array('q')
        self.echoed, self.echoes = array('d'), array('q')
        self.deviation = array('f')     # [rad]
        self.solve_time = array('f')    # [s]
        self.statuses = Counter[str]()
        self.silent = Counter[str]()    # those since the last state, which count if another comes
        self.forces = Forces(0, 0, 0, 0.0)
        self.late_total = self.skipped_ticks = 0
        self.heard = -math.inf          # [s] when the last state was taken, by the monotonic clock
        self.numbers: dict[Topic, Numbers] = {}

    def __enter__(self) -> 'Watcher':
        self._exit = ExitStack()
        self._node = self._exit.enter_context(tool_node('soak'))
        receivers: dict[Topic, Callable[..., None]] = {
            JOINT_STATES: self._state, FORCE_COMMAND: self._force,
            FORCE_COMMAND_STAMPED: self._stamped_force, ECHO: self._echo,
            DIAGNOSTICS: self._diagnostics}
        self._subscriptions = [subscribe(self._node, topic, receive, depth=QUEUE)
                               for topic, receive in receivers.items()]
        return self

    def __exit__(self, *error: object) -> None:
        self._exit.close()

    def listeners(self) -> set[str]:
        """Return the names of the nodes that subscribe to the states."""
        return listeners(self._node)

    @property
    def elapsed(self) -> float:
        """Return the time from the first state to the last [s]."""
        return (self.sent[-1] - self.sent[0]) / BILLION if self.sent else 0.0

    @property
    def missed(self) -> int:
        """Return how many messages did not come."""
        return sum(each.last - each.first + 1 - each.heard for each in self.numbers.values())

    def take(self) -> bool:
        """Take all messages that have come; return whether there has been a state."""
        for subscription in self._subscriptions:
            with subscription.handle:
                while taken := subscription.handle.take_message(subscription.msg_type, False):
                    subscription.callback(*taken)
        return len(self.sent) > 0

    def _count(self, topic: Topic, info: Mapping[str, int]) -> int:
        """Count a message of a topic with one publisher; return when it was sent [ns]."""
        number = info['publication_sequence_number']
        first, _, heard = self.numbers.get(topic, (number, number, 0))
        self.numbers[topic] = Numbers(first, number, heard + 1)
        return info['source_timestamp']

    def _state(self, message: Any, info: dict[str, int]) -> None:
        try:
            x = to_state(message, links_of(self.x_r))
        except ValueError:
            return  # of another robot
        self.heard = time.monotonic()
        self.statuses += self.silent
        self.silent.clear()
        self.stamps.append(nanoseconds(message.header.stamp))
        self.sent.append(self._count(JOINT_STATES, info))
        self.deviation.append(float(deviation(x, self.x_r)))

    def _force(self, message: Any, info: dict[str, int]) -> None:
        self.commands.append(self._count(FORCE_COMMAND, info))
        force, (total, not_finite, beyond_limit, largest) = message.data, self.forces
        finite = math.isfinite(force)
        self.forces = Forces(
            total + 1, not_finite + (not finite),
            beyond_limit + (finite and abs(force) > self.force_limit + ROUNDING),
            max(largest, abs(force)) if finite else largest)

    def _stamped_force(self, message: Any, info: dict[str, int]) -> None:
        self.answered.append(nanoseconds(message.header.stamp))
        self.answers.append(self._count(FORCE_COMMAND_STAMPED, info))

    def _echo(self, message: Any, info: dict[str, int]) -> None:
        self.echoed.append(message.data)
        self.echoes.append(self._count(ECHO, info))

    def _diagnostics(self, message: Any, _: dict[str, int]) -> None:
        for status in message.status:
            # not from_diagnostics: at 500 Hz reading all sixty values would take too long
            values = {pair.key: pair.value for pair in status.values}
            if status.name == 'plant':
                self.skipped_ticks = int(values['skipped_ticks'])
            elif status.name == 'mpc':
                counted = self.silent if int(values['carried']) else self.statuses
                counted[values['status']] += 1
                self.late_total = int(values['late_total'])
                if float(values['solve_time']) > 0:
                    self.solve_time.append(float(values['solve_time']))
