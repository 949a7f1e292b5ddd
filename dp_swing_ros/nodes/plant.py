# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The plant: integrates the pendulum, publishes its state at a fixed rate, obeys the force."""

from functools import partial
import math
import time
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
from rclpy.timer import Timer
from std_msgs.msg import Float64, String

from dp_swing_ros import configuration
from dp_swing_ros.messages.configuration import BEFORE
from dp_swing_ros.nodes.connections import (
    Audience, is_heard, listeners, LOOK_PERIOD, owners, publish, subscribe)
from dp_swing_ros.nodes.diagnostics import Diagnostics
from dp_swing_ros.nodes.messages import to_joint_state, to_stamp
from dp_swing_ros.nodes.pace import Pace
from dp_swing_ros.nodes.process import ProcessNode, run
from dp_swing_ros.nodes.ros_parameters import announce, declare, given, let_change
from dp_swing_ros.nodes.timing import Stopwatch
from dp_swing_ros.pendulum.urdf import urdf
from dp_swing_ros.simulation.plant import Plant, STOPPABLE
from dp_swing_ros.simulation.stepper import Stepper
from dp_swing_ros.topics import DISTURBANCE, FORCE_COMMAND, JOINT_STATES, ROBOT_DESCRIPTION

REPORT_PERIOD = 1.0  # [s] between two diagnostics
PATIENCE = 2.0       # [s] at most for subscriptions to be found before the first state
LONGER = 2.0         # [s] more for a controller that is there, but does not listen yet
NEWCOMER_PERIOD = 0.1  # [s] between two looks for a controller that joins a lockstep
MEETING = 0.3        # [s] until it hears what is sent to it: discovery goes one way at a time
COMPILING = 60.0     # [s] at most for another integrator, while the present one goes on
CATCHING_UP = 3.0  # [s] at most for the others to hear all, at the end of a lockstep
REAL_TIME = f'real time cannot be stopped; {STOPPABLE}'


class PlantNode(ProcessNode):
    """
    The node; in real time nobody waits for anybody, in lockstep it waits for one force a state.

    With use_sim_time real time is that of /clock. In lockstep the stamps are simulated time, from
    zero; where a state is lost, or the first has not arrived yet, nobody can answer, so the last
    command acts for another period.
    """

    def __init__(self) -> None:
        """Read the parameters and offer the topics."""
        super().__init__('plant')
        self.fields = configuration.declared_for('plant', given(self))
        self.values = declare(self, self.fields, live=True)
        self.thread_priority = self.values['thread_priority']
        self.get_logger().info('preparing the integrator')   # compiled at the first start
        self.plant = configuration.plant(self.values)
        self.stepper = Stepper(self.plant)
        self.parameters = self.plant.parameters
        self.period = 1 / self.parameters.rate
        if self.parameters.lockstep:   # which may be far ahead of who only listens
            self.delivery = CATCHING_UP
        self.revision, self.since = 0, 0   # how often the parameters have changed, and when [ns]
        self.resets = 0
        self.ticks: Timer | None = None
        self.push = 0.0          # [N] asked for the next period
        self.skipped = self.refused = self.commands = self.lost_commands = self.lost_states = 0
        self.refused_pushes = self.reported_refusals = 0
        self.clock = self.pace_clock
        self.begun = False       # with the first state
        self.outdated = False    # the next force is, in lockstep
        self.sent_at = self.overlooked = -math.inf
        self.states = publish(self, JOINT_STATES)
        self.diagnostics = Diagnostics(self)
        self.description = publish(self, ROBOT_DESCRIPTION)
        self.describe()
        self.pace = Pace(self, self.go_on)
        self.answer: float | None = None   # [N] to the last state; None: nobody can give one
        self.serve('plant/reset', self.on_reset)
        self.serve_switch('plant/pause', self.on_pause)
        self.serve('plant/step', self.on_step)
        self.unanswerable = self.create_guard_condition(self.on_unanswerable)
        subscribe(self, DISTURBANCE, self.on_disturbance)

    def prepare(self) -> None:
        """Compile the integrator, then look for those who are to hear the first state."""
        ready(self.values)
        let_change(self, self.fields, self.values, self.on_change)
        self.forces = subscribe(self, FORCE_COMMAND, self.on_force)
        lockstep = self.parameters.lockstep
        self.audience = Audience([self.states, self.diagnostics.publisher, self.description],
                                 math.inf if lockstep else PATIENCE)
        self.search = self.every(LOOK_PERIOD, self.on_search)
        if lockstep:
            self.get_logger().info('lockstep: waiting for a controller')
        else:
            self.get_logger().info(f'{self.parameters.rate:g} states a second' + (
                ', as /clock goes' if self.clock is self.get_clock() else ''))

    def describe(self) -> None:
        """Publish the robot description."""
        self.description.publish(String(data=urdf(self.plant.physical, self.plant.limits)))

    def on_change(self, values: dict[str, Any]) -> None:
        """Go on with other parameters from now on; raises ParameterError."""
        changed = self.made_aside(
            partial(ready, values), COMPILING, waits=self.parameters.lockstep)
        if not self.parameters.lockstep and self.begun:
            self.advance_to(self.elapsed())
        before = self.plant.physical, self.plant.limits
        if self.begun:
            self.plant.reconfigure(changed)
        else:
            self.plant = self.stepper.plant = changed
        self.values, self.parameters = values, self.plant.parameters
        if self.period != 1 / self.parameters.rate:
            self.period = 1 / self.parameters.rate
            if self.ticks is not None:
                self.ticks.timer_period_ns = round(self.period * 1e9)
        if before != (self.plant.physical, self.plant.limits):
            self.describe()
        self.pace.change(self.lasts)
        self.revision += 1
        self.since = round(self.plant.t * 1e9) if self.begun else BEFORE
        self.announce()

    def announce(self) -> None:
        """Publish what it runs with."""
        announce(self, self.values, self.revision, self.since, self.resets)

    def start(self) -> None:
        """Let the plant's time begin now."""
        self.watch = Stopwatch(self.clock.now().nanoseconds)
        self.epoch = 0 if self.parameters.lockstep else self.get_clock().now().nanoseconds
        self.timed_out = False       # and warned
        self.reported = -math.inf
        self.waiting = False         # for the force that answers the last state
        self.begun = True

    def on_search(self) -> None:
        """Begin as soon as the first state will be heard, in lockstep by a controller too."""
        if not self.audience.complete() or self.clock.now().nanoseconds == 0:
            return   # a simulated clock is zero until its first message
        if not self.parameters.lockstep:
            if not self.is_met() and time.monotonic() < self.audience.give_up + LONGER:
                return
            self.start()
            self.ticks = self.create_timer(self.period, self.on_tick, clock=self.clock)
            self.hurry(self.forces, self.ticks)
        elif is_heard(self, self.states, owners(self, FORCE_COMMAND)):
            self.start()
            self.hurry(self.forces, self.unanswerable, self.pace.timer)
            self.joined = dict.fromkeys(listeners(self, self.states, FORCE_COMMAND), -math.inf)
            self.every(NEWCOMER_PERIOD, self.on_newcomers)
        else:
            return
        self.destroy_timer(self.search)
        self.publish_state()

    def is_met(self) -> bool:
        """Return whether every controller that is there hears the states, and is heard."""
        controllers = owners(self, FORCE_COMMAND)
        return not controllers or is_heard(self, self.states, controllers) and (
            self.forces.get_publisher_count() >= len(controllers))

    def on_newcomers(self) -> None:
        """Send a state again that a controller joined after, or whose answer was overlooked."""
        now = time.monotonic()
        self.joined = {each: self.joined.get(each, now)
                       for each in listeners(self, self.states, FORCE_COMMAND)}
        if self.waiting and any(self.sent_at < since < now - MEETING
                                for since in (*self.joined.values(), self.overlooked)):
            self.states.publish(self.sent)
            self.sent_at = now

    @property
    def lasts(self) -> float:
        """Return for how long at least [s] a period lasts in lockstep."""
        return self.period / self.parameters.pace if self.parameters.pace else 0.0

    def elapsed(self) -> float:
        """Return the time since the start [s], which goes on where it was if the clock jumps."""
        before = self.watch.jumped
        elapsed = self.watch.elapsed(self.clock.now().nanoseconds)
        if self.watch.jumped != before:
            self.get_logger().warning(
                f'the clock jumped by {(self.watch.jumped - before) / 1e9:+.6g} s; the pendulum '
                'goes on from where it was', throttle_duration_sec=5.0)
        return elapsed

    def on_tick(self) -> None:
        """Publish the state of now; a tick that came late is not made up for."""
        now = self.elapsed()
        passed = now - self.plant.period_began
        self.skipped += max(round(passed / self.period) - 1, 0)
        self.advance_to(now)
        self.publish_state()

    def on_force(self, message: Float64) -> None:
        """Obey a force from now on; in lockstep, for one period."""
        if self.lane is not None:
            self.lane.note()
        force = message.data
        if not math.isfinite(force):
            self.refused += 1
            self.get_logger().error(f'refused a force of {force}; expected a finite number [N]',
                                    once=True)
            return
        self.commands += 1
        if not self.begun:
            return
        if not self.parameters.lockstep:
            self.advance_to(self.elapsed())
            self.lost_commands += not self.plant.obey(force, self.parameters.command_timeout)
        elif self.outdated:   # it answers a state from before the reset
            self.outdated, self.overlooked = False, time.monotonic()
        elif self.waiting:
            self.answer = force
            self.pace.let_pass()

    def on_unanswerable(self) -> None:
        """Go on for a period under the last command, unless a reset brought another state."""
        if not (self.waiting or self.done):
            self.answer = None
            self.pace.let_pass()

    def go_on(self) -> None:
        """Integrate, in lockstep, one period under the answer to the last state."""
        self.lost_commands += not self.stepper.finish(self.answer)
        self.publish_state()

    def on_disturbance(self, message: Float64) -> None:
        """Push the cart through the whole of the next period, if not beyond all bounds."""
        push, limit = self.push + message.data, self.parameters.disturbance_limit
        if abs(push) <= limit:   # which no NaN is
            self.push = push
            return
        self.refused_pushes += 1
        self.get_logger().error(
            f'refused a disturbance of {message.data:g} N: those of this period would be {push:g} '
            f'N; expected {limit:g} N at most (disturbance_limit)', throttle_duration_sec=1.0)

    def on_reset(self) -> tuple[bool, str]:
        """Go back to the initial state; in lockstep, to time zero too."""
        self.plant.reset()
        self.resets += 1
        self.announce()   # before the state, so that no plan from before is followed from there
        if self.begun:
            self.outdated = self.parameters.lockstep and self.waiting and not self.pace.ready
            self.start()
            self.publish_state()
        return True, 'the plant is back at its initial state'

    def on_pause(self, paused: bool) -> tuple[bool, str]:
        """Stop between two periods, or go on."""
        if not self.parameters.lockstep:
            return False, REAL_TIME
        answer = self.pace.pause(paused)
        if self.begun:
            self.report()
        return answer

    def on_step(self) -> tuple[bool, str]:
        """Let one period pass."""
        return self.pace.step() if self.parameters.lockstep else (False, REAL_TIME)

    def advance_to(self, now: float) -> None:
        """Integrate up to a time [s], and warn when no command is left to obey."""
        self.plant.advance(now - self.plant.t)
        expired = self.plant.commands.expired
        if expired and not self.timed_out:
            self.get_logger().warning(
                f'no force for {self.parameters.command_timeout:g} s; '
                'the force is zero until the next')
        self.timed_out = expired

    def publish_state(self) -> None:
        """Publish the measured state and the mean force of the period that ends, and go on."""
        push, self.push = self.push, 0.0
        measured = self.stepper.begin(push)
        if measured is None:
            self.lost_states += self.plant.is_seen()
        else:
            self.sent = to_joint_state(self.stamp(measured.t), measured.x, measured.force)
            self.sent_at = time.monotonic()
            self.states.publish(self.sent)
        if push or self.plant.t - self.reported >= REPORT_PERIOD:
            self.report(push)
        if self.parameters.duration and self.plant.t >= self.parameters.duration - 1e-9:
            self.done = True
        self.waiting = measured is not None and not self.done
        self.pace.begin(self.lasts)
        if self.parameters.lockstep and measured is None:
            self.unanswerable.trigger()   # and not at once, so that a signal can end it

    def stamp(self, t: float) -> Time:
        """Return a time of the plant [s] as a stamp."""
        return to_stamp(self.epoch + self.watch.jumped + round(t * 1e9))

    def report(self, push: float = 0.0) -> None:
        """Publish what the plant counts, and the push through the period that begins [N]."""
        self.reported = self.plant.t
        self.diagnostics.publish(
            self.stamp(self.plant.t), *self.verdict(),
            {'time': self.plant.t, 'push': push, 'commands': self.commands,
             'refused': self.refused, 'refused_disturbances': self.refused_pushes,
             'skipped_ticks': self.skipped, 'lost_commands': self.lost_commands,
             'lost_states': self.lost_states, 'paused': self.pace.paused})
        self.reported_refusals = self.refused + self.refused_pushes

    def verdict(self) -> tuple[bytes, str]:
        """Return the level of the status, and why."""
        if not np.all(np.isfinite(self.plant.x)):
            return DiagnosticStatus.ERROR, 'the state is not finite; call plant/reset'
        if self.timed_out:
            return DiagnosticStatus.WARN, 'no force arrives; it is zero'
        if self.refused + self.refused_pushes > self.reported_refusals:
            return DiagnosticStatus.WARN, 'refused a force or a disturbance'
        return DiagnosticStatus.OK, 'paused' if self.pace.paused else 'obeys the force'


def ready(values: dict[str, Any]) -> Plant:
    """Return a plant whose integrator is compiled; raises ParameterError."""
    configuration.plant(values).advance(1 / values['rate'])
    return configuration.plant(values)


main = partial(run, PlantNode)
