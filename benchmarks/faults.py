# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The node `faults`: a bad network between a plant and an mpc.

    python benchmarks/faults.py --ros-args -p state_loss:=0.1 -p command_jitter:=0.02
    ros2 run dp_swing_ros mpc --ros-args -r joint_states:=faults/joint_states \
        -r force_command:=faults/force_command
    ros2 run dp_swing_ros plant

    plant --- joint_states ---> faults --- faults/joint_states ---> mpc
    plant <-- force_command --- faults <-- faults/force_command --- mpc

Messages of each direction are lost, late, doubled or reordered, and states are NaN, as the
parameters ask for; all but the seed are live. A message without a fault passes at once, a state
with the same bytes. Each direction has random numbers of its own, so its n-th message meets the
same faults in each run. After the last force comes a zero.

It works in real time: in lockstep a lost message would leave plant and mpc waiting for each other.
"""

from collections import deque
from collections.abc import Iterable, Iterator
import dataclasses
from functools import partial
import math
import sys
from typing import Any, NamedTuple

import numpy as np
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from dp_swing_ros.messages.fields import BILLION, OK, Report, WARN
from dp_swing_ros.nodes.connections import publish, QUEUE, subscribe
from dp_swing_ros.nodes.diagnostics import Diagnostics
from dp_swing_ros.nodes.process import ProcessNode, run
from dp_swing_ros.nodes.ros_parameters import allow_changes, announce, declare
from dp_swing_ros.parameters import group, named, parameter, Parameters
from dp_swing_ros.streams import stream
from dp_swing_ros.topics import FORCE_COMMAND, JOINT_STATES, Topic

FAULTS_JOINT_STATES = Topic('faults/joint_states', JOINT_STATES.type)
FAULTS_FORCE_COMMAND = Topic('faults/force_command', FORCE_COMMAND.type)
STATE_CHANNEL, COMMAND_CHANNEL, STATE_NAN = 7, 8, 9   # random numbers beside those of Stream
REPORT_PERIOD = 1.0  # [s] between two diagnostics


@dataclasses.dataclass(frozen=True)
class ChannelParameters(Parameters):
    """What becomes of the messages of one direction."""

    loss: float = parameter(0.0, 'probability that a message is lost', minimum=0.0, maximum=1.0)
    delay: float = parameter(0.0, 'a message comes late by this', unit='s', minimum=0.0,
                             maximum=1.0)
    jitter: float = parameter(
        0.0, 'and by a time drawn from 0 to this, but not before the one ahead of it', unit='s',
        minimum=0.0, maximum=1.0)
    duplication: float = parameter(
        0.0, 'probability that a message comes twice', minimum=0.0, maximum=1.0)
    reordering: float = parameter(
        0.0, 'probability that a message comes after the next one', minimum=0.0, maximum=1.0)


@dataclasses.dataclass(frozen=True)
class FaultsParameters(Parameters):
    """What is not the same for both directions."""

    state_nan: float = parameter(
        0.0, 'probability that a state comes with NaN for all positions and velocities',
        minimum=0.0, maximum=1.0)
    seed: int = parameter(0, 'seed of all faults', minimum=0, live=False)


STATE, COMMAND = 'state_', 'command_'
FAULTS = {**named(ChannelParameters, STATE), **named(ChannelParameters, COMMAND),
          **named(FaultsParameters)}


@dataclasses.dataclass
class Counts:
    """How many messages were heard, and how many of them met with a fault."""

    heard: int = 0
    lost: int = 0
    delayed: int = 0
    duplicated: int = 0
    reordered: int = 0


class Waiting(NamedTuple):
    """A message on its way."""

    due: int    # [ns]
    message: Any


class Channel:
    """
    A queue of messages, some of which are lost, come late, twice, or after the next one.

    What is in the queue keeps its order, however late each is; a message that is held back enters
    it after the next one.
    """

    def __init__(self, parameters: ChannelParameters, random: np.random.Generator) -> None:
        """Take the faults, and the random numbers that say whom they befall."""
        self.parameters, self.random = parameters, random
        self.counts = Counts()
        self.queue = deque[Waiting]()
        self.held: list[Waiting] = []   # a message, or the two that were made of it
        self.newest = 0                 # [ns] when the last message came

    def put(self, message: Any, now: int) -> None:
        """Let a message come at a time [ns]."""
        p, counts = self.parameters, self.counts
        # drawn whether needed or not, so that one fault does not change the numbers of another
        loss, jitter, duplication, reordering = self.random.random(4)
        if now < self.newest:   # a simulated clock begins anew, and so does the run
            self.queue, self.held = deque(), []
        self.newest = now
        counts.heard += 1
        if loss < p.loss:
            counts.lost += 1
            return
        copies = [Waiting(now + round((p.delay + p.jitter * jitter) * BILLION), message)]
        counts.delayed += copies[0].due > now
        if duplication < p.duplication:
            counts.duplicated += 1
            copies *= 2
        if reordering < p.reordering and not self.held:
            counts.reordered += 1
            self.held = copies
        else:
            self._enter(copies)
            self._enter(self.held)
            self.held = []

    def _enter(self, messages: Iterable[Waiting]) -> None:
        for each in messages:
            last = self.queue[-1].due if self.queue else each.due
            self.queue.append(each._replace(due=max(each.due, last)))

    @property
    def due(self) -> int | None:
        """Return when the next message is due [ns], or None if none is on its way."""
        return self.queue[0].due if self.queue else None

    def take(self, now: int) -> Iterator[Any]:
        """Yield the messages that are due at a time [ns]."""
        while self.queue and self.queue[0].due <= now:
            yield self.queue.popleft().message


class Passage:
    """The way of messages through a channel to a publisher; at once, if they are not delayed."""

    def __init__(self, node: ProcessNode, channel: Channel, publisher: Publisher) -> None:
        """Take the node whose timer it is, the channel, and where it ends."""
        self.channel, self.publisher, self.clock = channel, publisher, node.pace_clock
        self.timer = node.create_timer(1.0, self.pass_on, clock=self.clock, autostart=False)
        self.sent = 0

    def enter(self, message: Any) -> None:
        """Take a message."""
        self.channel.put(message, self.clock.now().nanoseconds)
        self.pass_on()

    def pass_on(self) -> None:
        """Publish what is due, and wait for the next."""
        now = self.clock.now().nanoseconds
        for message in self.channel.take(now):
            self.publisher.publish(message)
            self.sent += 1
        if self.channel.due is None:
            self.timer.cancel()
        else:
            self.timer.timer_period_ns = max(self.channel.due - now, 1)
            self.timer.reset()


class FaultsNode(ProcessNode):
    """
    Hands states on to the controller and forces on to the plant, but for the faults it is told.

    States pass as bytes, as they are. A force that is not finite does not pass.
    """

    def __init__(self) -> None:
        """Read the parameters and offer the topics."""
        super().__init__('faults')
        self.values = declare(self, FAULTS, live=True)
        self.revision = 0    # how often the parameters have changed
        self.nan_states = self.refused = self.reported_refusals = 0
        self.diagnostics = Diagnostics(self)
        seed = self.values['seed']
        self.nan = stream(seed, STATE_NAN)
        self.states, self.forces = (
            Passage(self, Channel(group(ChannelParameters, self.values, prefix),
                                  stream(seed, purpose)), publish(self, topic))
            for prefix, purpose, topic in (
                (STATE, STATE_CHANNEL, FAULTS_JOINT_STATES),
                (COMMAND, COMMAND_CHANNEL, FORCE_COMMAND)))
        allow_changes(self, FAULTS, self.values, self.on_change)
        subscribe(self, JOINT_STATES, self.on_state, QUEUE, sensor=True, raw=True)
        subscribe(self, FAULTS_FORCE_COMMAND, self.on_force, QUEUE)
        self.every(REPORT_PERIOD, self.report)
        self.get_logger().info(f'ready: {self.words()}')

    def on_change(self, values: dict[str, Any]) -> None:
        """Make other faults from the next message on."""
        self.values = values
        self.states.channel.parameters = group(ChannelParameters, values, STATE)
        self.forces.channel.parameters = group(ChannelParameters, values, COMMAND)
        self.revision += 1
        announce(self, values, self.revision)

    def on_state(self, data: bytes) -> None:
        """Hand a serialised state on."""
        if self.nan.random() < self.values['state_nan']:
            self.nan_states += 1
            data = without_numbers(data)
        self.states.enter(data)

    def on_force(self, message: Float64) -> None:
        """Hand a force on, if it is one."""
        if math.isfinite(message.data):
            self.forces.enter(message)
            return
        self.refused += 1
        self.get_logger().error(f'refused a force of {message.data}; expected a finite number '
                                '[N]', once=True)

    def words(self) -> str:
        """Return which faults it makes."""
        return ', '.join(f'{name} {value:g}' for name, value in self.values.items()
                         if name != 'seed' and value) or 'everything passes'

    def report(self) -> None:
        """Publish what it counts."""
        refused = self.refused > self.reported_refusals
        self.reported_refusals = self.refused
        self.diagnostics.publish(Report(
            self.get_clock().now().nanoseconds, WARN if refused else OK,
            'refused a force' if refused else self.words(),
            {**{f'{name}_{of}': count
                for of, passage in (('states', self.states), ('commands', self.forces))
                for name, count in dataclasses.asdict(passage.channel.counts).items()},
             'nan_states': self.nan_states, 'refused': self.refused}))

    def close(self) -> None:
        """End a stream of forces with zero."""
        if self.forces.sent:
            self.forces.publisher.publish(Float64(data=0.0))


def without_numbers(data: bytes) -> bytes:
    """Return a serialised JointState with NaN for all positions and velocities."""
    state = deserialize_message(data, JointState)
    state.position = [math.nan] * len(state.position)
    state.velocity = [math.nan] * len(state.velocity)
    return bytes(serialize_message(state))


main = partial(run, FaultsNode)

if __name__ == '__main__':
    sys.exit(main())
