# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The plant as a node: hands on what comes to its core, and publishes what that returns."""

from functools import partial
import math
import time
from typing import Any

from rclpy.timer import Timer
from std_msgs.msg import Float64, String

from dp_swing_ros.messages.fields import Report
from dp_swing_ros.nodes.connections import (
    Audience, is_heard, listeners, LOOK_PERIOD, owners, publish, subscribe)
from dp_swing_ros.nodes.diagnostics import Diagnostics
from dp_swing_ros.nodes.messages import to_joint_state, to_stamp
from dp_swing_ros.nodes.process import COMPILING, ProcessNode, run, STEADY
from dp_swing_ros.nodes.ros_parameters import allow_changes, announce, declare, overrides
from dp_swing_ros.runtime.plant import (
    Announcement, Description, PlantCore, Sent, State, Trouble, Warned)
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.plant import Plant
from dp_swing_ros.topics import COMMANDS, DISTURBANCE, JOINT_STATES, ROBOT_DESCRIPTION

PATIENCE = 2.0       # [s] at most for subscriptions to be found before the first state
LONGER = 2.0         # [s] more for a controller that is there, but does not listen yet
NEWCOMER_PERIOD = 0.1  # [s] between two looks for a controller that joins a lockstep
CATCHING_UP = 3.0  # [s] at most for the others to hear all, at the end of a lockstep


class PlantNode(ProcessNode):
    """The node; with use_sim_time real time is that of /clock."""

    def __init__(self) -> None:
        """Read the parameters and offer the topics."""
        super().__init__('plant')
        self.fields = plants.PLANT.fields_for(overrides(self))
        self.values = declare(self, self.fields, live=True)
        self.thread_priority = self.values['thread_priority']
        self.get_logger().info('preparing the integrator')   # compiled at the first start
        self.core = PlantCore(plants.plant(self.values))
        self.command = COMMANDS[self.values['drive']]
        self.clock = STEADY if self.core.lockstep else self.pace_clock
        if self.core.lockstep:   # which may be far ahead of who only listens
            self.delivery = CATCHING_UP
        self.timer: Timer | None = None   # of the next tick, from the first state on
        self.states = publish(self, JOINT_STATES)
        self.diagnostics = Diagnostics(self)
        self.description = publish(self, ROBOT_DESCRIPTION)
        self.send([self.core.description()])
        self.serve('plant/reset', self.on_reset)
        self.serve_switch('plant/pause', self.on_pause)
        self.serve('plant/step', self.on_step)
        subscribe(self, DISTURBANCE, self.on_disturbance)

    def prepare(self) -> None:
        """Compile the integrator, then look for those who are to hear the first state."""
        ready(self.values)
        allow_changes(self, self.fields, self.values, self.on_change)
        self.forces = subscribe(self, self.command, self.on_force)
        lockstep = self.core.lockstep
        self.audience = Audience([self.states, self.diagnostics.publisher, self.description],
                                 math.inf if lockstep else PATIENCE)
        self.search = self.every(LOOK_PERIOD, self.on_search)
        if lockstep:
            self.get_logger().info('lockstep: waiting for a controller')
        else:
            self.get_logger().info(f"{self.values['rate']:g} states a second" + (
                ', as /clock goes' if self.clock is self.get_clock() else ''))

    def now(self) -> int:
        """Return the time [ns] that the core goes by."""
        return int(self.clock.now().nanoseconds)

    def today(self) -> int:
        """Return the time of day [ns], or that of /clock."""
        return int(self.get_clock().now().nanoseconds)

    def on_search(self) -> None:
        """Begin as soon as the first state will be heard, in lockstep by a controller too."""
        if not self.audience.complete() or self.pace_clock.now().nanoseconds == 0:
            return   # a simulated clock is zero until its first message
        if not self.is_connected():
            return
        self.destroy_timer(self.search)
        self.timer = self.create_timer(self.core.stepper.period, self.on_tick, clock=self.clock,
                                       autostart=not self.core.lockstep)
        self.use_fast_lane(self.forces, self.timer)
        if self.core.lockstep:
            self.on_look()
            self.every(NEWCOMER_PERIOD, self.on_look)
        self.send(self.core.begin(self.now(), self.today()))

    def is_connected(self) -> bool:
        """Return whether every controller that is there hears the states, and is heard."""
        controllers = owners(self, self.command)
        if self.core.lockstep:   # where there must be one
            return is_heard(self, self.states, controllers)
        return not controllers or time.monotonic() >= self.audience.give_up + LONGER or (
            is_heard(self, self.states, controllers)
            and self.forces.get_publisher_count() >= len(controllers))

    def on_look(self) -> None:
        """Look who hears the states in lockstep."""
        self.send(self.core.on_listeners(
            listeners(self, self.states, self.command), self.now()))

    def on_tick(self) -> None:
        """Let a period end."""
        if self.core.lockstep and self.timer is not None:
            self.timer.cancel()
        self.send(self.core.tick(self.now()))

    def on_force(self, message: Float64) -> None:
        """Obey a force."""
        if self.fast_lane is not None:
            self.fast_lane.note()
        self.send(self.core.on_force(message.data, self.now()))

    def on_disturbance(self, message: Float64) -> None:
        """Push the cart."""
        self.send(self.core.on_push(message.data))

    def on_change(self, values: dict[str, Any]) -> None:
        """Go on with other parameters from now on; raises ParameterError."""
        changed = self.made_in_background(partial(ready, values), COMPILING,
                                          waits=self.core.lockstep)
        before, self.values = self.core.stepper.period, values
        self.send(self.core.change(changed, self.now()))
        if self.timer is not None and before != self.core.stepper.period \
                and not self.core.lockstep:
            self.timer.timer_period_ns = round(self.core.stepper.period * 1e9)

    def on_reset(self) -> tuple[bool, str]:
        """Go back to the initial state."""
        self.send(self.core.reset(self.now(), self.today()))
        return True, 'the plant is back at its initial state'

    def on_pause(self, paused: bool) -> tuple[bool, str]:
        """Stop, or go on."""
        answer, sent = self.core.pause(paused, self.now())
        self.send(sent)
        return answer

    def on_step(self) -> tuple[bool, str]:
        """Let one period pass."""
        answer, sent = self.core.step(self.now())
        self.send(sent)
        return answer

    def send(self, sent: Sent) -> None:
        """Publish and log, and go on when the core wants to."""
        for each in sent:
            match each:
                case State(stamp, x, force):
                    self.states.publish(to_joint_state(to_stamp(stamp), x, force))
                case Report():
                    self.diagnostics.publish(each)
                case Announcement(revision, since, resets):
                    announce(self, self.values, revision, since, resets)
                case Description(text):
                    self.description.publish(String(data=text))
                case Warned(trouble, text):
                    self.warn(trouble, text)
        self.done = self.core.done
        wait = self.core.wait(self.now())
        if wait is not None and self.timer is not None:
            self.timer.timer_period_ns = max(wait, 1)
            self.timer.reset()

    def warn(self, trouble: Trouble, text: str) -> None:
        """Log a warning, which may be one of many."""
        logger = self.get_logger()
        match trouble:
            case Trouble.JUMP:
                logger.warning(text, throttle_duration_sec=5.0)
            case Trouble.SILENCE:
                logger.warning(text)
            case Trouble.FORCE:
                logger.error(text, once=True)
            case Trouble.PUSH:
                logger.error(text, throttle_duration_sec=1.0)


def ready(values: dict[str, Any]) -> Plant:
    """Return a plant whose integrator is compiled; raises ParameterError."""
    plants.plant(values).advance(1 / values['rate'])
    return plants.plant(values)


main = partial(run, PlantNode)
