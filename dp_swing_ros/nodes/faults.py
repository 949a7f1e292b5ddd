# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Faults between a plant and its controller: states and forces come late, twice, or never."""

import dataclasses
from functools import partial
import math
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from dp_swing_ros.nodes.channel import Channel
from dp_swing_ros.nodes.connections import publish, QUEUE, subscribe
from dp_swing_ros.nodes.diagnostics import Diagnostics
from dp_swing_ros.nodes.parameters import ChannelParameters, COMMAND, FAULTS, STATE
from dp_swing_ros.nodes.process import ProcessNode, run
from dp_swing_ros.nodes.ros_parameters import announce, declare, let_change
from dp_swing_ros.parameters import group
from dp_swing_ros.streams import Stream, stream
from dp_swing_ros.topics import (
    FAULTS_FORCE_COMMAND, FAULTS_JOINT_STATES, FORCE_COMMAND, JOINT_STATES)

REPORT_PERIOD = 1.0  # [s] between two diagnostics


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
        self.nan = stream(seed, Stream.STATE_NAN)
        self.states, self.forces = (
            Passage(self, Channel(group(ChannelParameters, self.values, prefix),
                                  stream(seed, purpose)), publish(self, topic))
            for prefix, purpose, topic in (
                (STATE, Stream.STATE_CHANNEL, FAULTS_JOINT_STATES),
                (COMMAND, Stream.COMMAND_CHANNEL, FORCE_COMMAND)))
        let_change(self, FAULTS, self.values, self.on_change)
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
        self.diagnostics.publish(
            self.get_clock().now().to_msg(),
            DiagnosticStatus.WARN if refused else DiagnosticStatus.OK,
            'refused a force' if refused else self.words(),
            {**{f'{name}_{of}': count
                for of, passage in (('states', self.states), ('commands', self.forces))
                for name, count in dataclasses.asdict(passage.channel.counts).items()},
             'nan_states': self.nan_states, 'refused': self.refused})

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
