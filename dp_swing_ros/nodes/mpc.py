# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The controller as a node: hands on what comes to its core, and publishes what that sends."""

from collections.abc import Iterator
from dataclasses import Field
from functools import partial
import gc
from itertools import chain, islice
import sys
import time
from typing import Any

from rclpy.clock import JumpThreshold
from rclpy.duration import Duration
from rclpy.qos import ReliabilityPolicy
from rclpy.timer import Timer
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String

from dp_swing_ros.control import controllers
from dp_swing_ros.control.receding_horizon import DESCRIPTION
from dp_swing_ros.messages.cdr import to_trajectory
from dp_swing_ros.messages.fields import ERROR, OK, Report, WARN
from dp_swing_ros.nodes.connections import (
    hearers, owners, publish, request_for, sender_of, subscribe)
from dp_swing_ros.nodes.diagnostics import Diagnostics, LOOK_PERIOD
from dp_swing_ros.nodes.messages import to_point_cloud, to_stamp, to_stamped_command
from dp_swing_ros.nodes.process import AWAY, COMPILING, POLL, ProcessNode, run
from dp_swing_ros.nodes.ros_parameters import (
    allow_changes, announce, declare, files_in, overrides)
from dp_swing_ros.nodes.taking import Executor, take
from dp_swing_ros.parameters.files import sections
from dp_swing_ros.runtime.handshake import Peers
from dp_swing_ros.runtime.mpc import MpcCore
from dp_swing_ros.runtime.schedule import Arrived
from dp_swing_ros.runtime.sent import (
    Announcement, Force, Planned, PutBack, Said, Sent, Tried, Wake)
from dp_swing_ros.topics import (
    COMMANDS, CONFIGURATION, JOINT_STATES, PLAN, ROBOT_DESCRIPTION, STAMPED_COMMANDS, TRIES)

HANDSHAKE_POLL = 0.02  # [s]
SLOW_START = 1.0     # [s] a preparation longer than this was a compilation
QUEUE = 100          # messages of all robots, while a solve goes on


class NodeClocks:
    """The clocks of a node."""

    today = staticmethod(time.time)
    steady = staticmethod(time.perf_counter)
    sleep = staticmethod(time.sleep)

    def __init__(self, node: ProcessNode) -> None:
        """Take the node."""
        self.node = node

    @property
    def simulated(self) -> bool:
        """Return whether its own is a simulated one, which may go at any pace."""
        return bool(self.node.get_parameter('use_sim_time').value)

    def now(self) -> int:
        """Return the time of its own clock [ns]."""
        return int(self.node.get_clock().now().nanoseconds)


class MpcNode(ProcessNode):
    """The node. It listens only once everything is compiled."""

    configured: bool = False   # there is a core

    def __init__(self) -> None:
        """Read the parameters, and refuse what cannot work, where the bodies are known."""
        super().__init__('mpc')
        self.given = overrides(self)
        if self.given.get('bodies') != DESCRIPTION:
            self.configure(controllers.MPC.fields_for(self.given))

    def configure(self, fields: dict[str, Field]) -> None:
        """Take parameters by their full names, and offer topics and services."""
        self.fields, values = fields, declare(self, fields, live=True)
        self.thread_priority = values['thread_priority']
        self.core = MpcCore(values, NodeClocks(self), self.send,
                            partial(sender_of, self, JOINT_STATES),
                            partial(owners, self, JOINT_STATES))
        self.configured = True
        self.drive = values['drive']
        self.forces = publish(self, COMMANDS[self.drive])
        self.stamped_forces = publish(self, STAMPED_COMMANDS[self.drive]) \
            if self.drive in STAMPED_COMMANDS else None
        self.plans, self.tries = publish(self, PLAN), publish(self, TRIES)
        self.diagnostics = Diagnostics(self, self.core.states)
        self.serve('mpc/reset', self.core.reset)
        self.serve_switch('mpc/enable', self.core.enable)
        subscribe(self, CONFIGURATION, self.on_configuration, sparing=True)
        # a clock that is set must not look like silence, and simulated time may stand still
        self.silence = self.create_timer(1.0, self.core.on_silence, clock=self.pace_clock,
                                         autostart=False)
        self.handshake_timer: Timer | None = None
        self.following: Timer | None = None
        self.jumps = self.get_clock().create_jump_callback(
            JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1)),
            post_callback=lambda _: self.core.on_setback())

    def prepare(self) -> None:
        """Compile before the first state, then listen."""
        if not self.configured:
            self.configure(self.described())
        values = self.core.live.values
        self.get_logger().info(
            f"preparing the solver {values['solver']!r} (the first start on a machine "
            'compiles for half a minute; later ones take a second)')
        self.warn_of_misspelt()
        began = time.perf_counter()
        self.core.prepare()
        self.put_back = allow_changes(self, self.fields, values, self.on_change)
        taken = time.perf_counter() - began
        gc.collect()
        gc.freeze()   # else the collector looks through all modules in a first tick, for 25 ms
        done = 'compiled' if taken > SLOW_START else 'loaded'
        self.listen(lossless=False)
        self.get_logger().info(f'{done} in {taken:.1f} s; ready')

    def warn_of_misspelt(self) -> None:
        """Warn of what files give to any node (/**) and none of this package has."""
        if not (files := files_in(sys.argv)):
            return
        from dp_swing_ros.declarations import misspelt   # and the plant's, with the plant
        for path in files:
            for words in misspelt(sections(path)):
                self.get_logger().warning(f'{path}, {words}')

    def described(self) -> dict[str, Field]:
        """Return the parameters for the pendulum of a robot description, once there is one."""
        from dp_swing_ros.runtime.described import DescribedPendulum   # with a tenth of a second
        pendulum = DescribedPendulum(self.given)

        def on_description(message: String) -> None:
            if said := pendulum.hear(message.data):
                self.say(*said)
        heard = subscribe(self, ROBOT_DESCRIPTION, on_description, sparing=True)
        self.get_logger().info(f'waiting for a robot description on {heard.topic_name}, which '
                               'gives the bodies')
        with (executor := Executor(context=self.context)):
            executor.add_node(self)
            while not pendulum.fields:
                self.call_back(partial(executor.spin_once, POLL))
            executor.remove_node(self)
        return pendulum.fields

    def listen(self, lossless: bool) -> None:
        """Subscribe to the states: with best effort every driver is heard, but some are lost."""
        self.lossless = lossless
        self.states = subscribe(self, JOINT_STATES, self.on_message, depth=QUEUE,
                                sensor=not lossless, entity_id='lockstep' if lossless else None)
        self.use_fast_lane(self.states, self.silence)

    def on_message(self, message: JointState, info: dict[str, Any]) -> None:
        """Hand on all that came on the topic of the states."""
        if self.fast_lane is not None:
            self.fast_lane.note()
        self.core.rivals = self.diagnostics.rivals
        self.core.on_states(self.arrived(message, info))
        if not self.core.handshake.done and self.handshake_timer is None:
            self.handshake_timer = self.every(HANDSHAKE_POLL, self.on_handshake)
            self.on_handshake()

    def arrived(self, message: JointState, info: dict[str, Any]) -> Iterator[Arrived]:
        """Yield a message, and what came after it."""
        others = islice(iter(partial(take, self.states), None), QUEUE)
        for each, about in chain([(message, info)], others):
            yield Arrived(each, about['publisher_gid'], about['publication_sequence_number'],
                          about['source_timestamp'], about['received_timestamp'])

    def on_handshake(self) -> None:
        """Look who is there, until the first state is answered."""
        self.core.on_peers(Peers(owners(self, JOINT_STATES), owners(self, CONFIGURATION),
                                 hearers(self, self.forces)))
        if self.core.handshake.done and self.handshake_timer is not None:
            self.destroy_timer(self.handshake_timer)

    def on_configuration(self, message: String) -> None:
        """Hand on what another node runs with."""
        self.core.on_configuration(message.data)
        self.follow()
        if self.following is None:   # who announces it may be found before its states are
            self.following = self.every(LOOK_PERIOD, self.follow)

    def follow(self) -> None:
        """Listen without a loss to a plant in lockstep that offers it, else to everybody."""
        # in lockstep time would stand still for ever after a lost state
        offered = [each.qos_profile for each in self.get_publishers_info_by_topic(
            self.states.topic_name)]
        lossless = self.core.lockstep and (
            request_for(offered).reliability == ReliabilityPolicy.RELIABLE)
        if offered and lossless != self.lossless:
            self.destroy_subscription(self.states)
            self.core.handshake.waiting = None   # a plant in lockstep sends it again
            self.listen(lossless)

    def on_change(self, values: dict[str, Any]) -> None:
        """Go on with other parameters from a next tick on; raises ParameterError."""
        waits = self.core.lockstep   # time does
        self.core.on_change(values, partial(
            self.made_in_background, patience=COMPILING if waits else AWAY, waits=waits))

    def send(self, sent: Sent) -> None:
        """Publish, log, or wait."""
        match sent:
            case Force(stamp, force):
                self.forces.publish(Float64(data=force))
                if self.stamped_forces is not None:
                    self.stamped_forces.publish(to_stamped_command(
                        to_stamp(stamp), self.core.sensors.joint_names[0], force, self.drive))
            case Planned(stamp, plan):
                self.plans.publish(to_trajectory(plan, to_stamp(stamp)))
            case Tried(stamp, paths, weights):
                self.tries.publish(to_point_cloud(to_stamp(stamp), paths, weights))
            case Report():
                self.diagnostics.publish(sent)
            case Wake(after):
                if after is None:
                    self.silence.cancel()
                else:
                    self.silence.timer_period_ns = round(after * 1e9)
                    self.silence.reset()
            case Announcement(parameters, revision):
                announce(self, parameters, revision)
            case PutBack(parameters):
                self.put_back(parameters)
            case Said(level, text):
                self.say(level, text)

    def say(self, level: int, text: str) -> None:
        """Log a line; to ROS each place in the code is of one level."""
        if level == OK:
            self.get_logger().info(text)
        elif level == WARN:
            self.get_logger().warning(text)
        elif level == ERROR:
            self.get_logger().error(text)

    def may_end(self) -> bool:
        """Return whether the cart is braked, where it is to be before the end."""
        return not self.configured or self.core.may_end()

    def close(self) -> None:
        """End the stream of commands with zero, and keep what was learned."""
        if self.configured:
            self.core.close()
            if self.core.forces:   # else it may not even be prepared
                self.core.live.end()


main = partial(run, MpcNode)
