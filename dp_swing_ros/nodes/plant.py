# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The plant: integrates the pendulum, publishes its state at a fixed rate, obeys the force."""

import math
import time

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger

from dp_swing_ros.nodes.connections import is_heard, publish, subscribe
from dp_swing_ros.nodes.messages import to_diagnostics, to_joint_state, to_stamp
from dp_swing_ros.nodes.process import ProcessNode, run
from dp_swing_ros.nodes.ros_parameters import declare, settle
from dp_swing_ros.parameters import LimitParameters, PendulumParameters, PlantParameters
from dp_swing_ros.simulation import Plant
from dp_swing_ros.topics import (
    DIAGNOSTICS, DISTURBANCE, FORCE_COMMAND, JOINT_STATES, ROBOT_DESCRIPTION)
from dp_swing_ros.urdf import urdf

REPORT_PERIOD = 1.0  # [s] between two diagnostics
LOCKSTEP_POLL = 0.02  # [s] between two looks for a controller


class PlantNode(ProcessNode):
    """
    The node; in real time nobody waits for anybody, in lockstep it waits for one force a state.

    In lockstep the stamps are simulated time, from zero; where a state is lost, or the first has
    not arrived yet, nobody can answer, so the last command acts for another period.
    """

    def __init__(self) -> None:
        """Read the parameters and offer the topics."""
        super().__init__('plant')
        bodies = declare(self, PendulumParameters)
        limits = declare(self, LimitParameters)
        self.parameters = declare(self, PlantParameters)
        settle(self)
        self.plant = Plant(bodies, limits, self.parameters)
        self.period = 1 / self.parameters.rate
        self.push = 0.0          # [N] asked for the next period
        self.skipped = self.refused = self.commands = self.lost_commands = self.lost_states = 0
        self.states = publish(self, JOINT_STATES)
        self.diagnostics = publish(self, DIAGNOSTICS)
        self.description = publish(self, ROBOT_DESCRIPTION)
        self.description.publish(String(data=urdf(bodies, limits)))
        self.create_service(Trigger, 'plant/reset', self.on_reset)
        self.unanswerable = self.create_guard_condition(self.on_unanswerable)
        subscribe(self, DISTURBANCE, self.on_disturbance)

    def prepare(self) -> None:
        """Compile the integrator, then start the clock."""
        Plant(self.plant.bodies, self.plant.limits, self.parameters).advance(self.period)
        subscribe(self, FORCE_COMMAND, self.on_force)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.start()
        if self.parameters.lockstep:
            self.get_logger().info('lockstep: waiting for a controller')
            self.search = self.create_timer(LOCKSTEP_POLL, self.on_search, clock=steady)
        else:
            self.create_timer(self.period, self.on_tick, clock=steady)
            self.publish_state()

    def start(self) -> None:
        """Let the plant's time begin now."""
        self.began = time.monotonic()
        self.epoch = 0 if self.parameters.lockstep else self.get_clock().now().nanoseconds
        self.timed_out = False       # and said so
        self.reported = -math.inf
        self.waiting = False         # for the force that answers the last state

    def on_search(self) -> None:
        """Begin the lockstep as soon as a controller can hear the first state."""
        if is_heard(self, self.states, FORCE_COMMAND):
            self.destroy_timer(self.search)
            self.publish_state()

    def on_tick(self) -> None:
        """Publish the state of now; a tick that came late is not made up for."""
        now = time.monotonic() - self.began
        passed = now - self.plant.period_began
        self.skipped += max(round(passed / self.period) - 1, 0)
        self.advance_to(now)
        self.publish_state()

    def on_force(self, message: Float64) -> None:
        """Obey a force from now on; in lockstep, for one period."""
        force = message.data
        if not math.isfinite(force):
            self.refused += 1
            self.get_logger().error(f'refused a force of {force}; expected a finite number [N]',
                                    once=True)
            return
        self.commands += 1
        if not self.parameters.lockstep:
            now = time.monotonic() - self.began
            self.advance_to(now)
            self.obey(force, self.parameters.command_timeout)
        elif self.waiting:
            self.obey(force)
            self.plant.advance(self.period)
            self.publish_state()

    def on_unanswerable(self) -> None:
        """Go on for a period under the last command, unless a reset brought another state."""
        if not (self.waiting or self.done):
            self.plant.advance(self.period)
            self.publish_state()

    def on_disturbance(self, message: Float64) -> None:
        """Push the cart through the whole of the next period."""
        if math.isfinite(message.data):
            self.push += message.data

    def on_reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Go back to the initial state; in lockstep, to time zero too."""
        self.plant.reset()
        self.start()
        self.publish_state()
        response.success, response.message = True, 'the plant is back at its initial state'
        return response

    def obey(self, force: float, lasts: float = math.inf) -> None:
        """Let a force [N] act for a time [s] at most, if it is not lost."""
        self.lost_commands += not self.plant.obey(force, lasts)

    def advance_to(self, now: float) -> None:
        """Integrate up to a time [s], and say so when no command is left to obey."""
        self.plant.advance(now - self.plant.t)
        expired = self.plant.commands.expired
        if expired and not self.timed_out:
            self.get_logger().warning(
                f'no force for {self.parameters.command_timeout:g} s; '
                'the force is zero until the next')
        self.timed_out = expired

    def publish_state(self) -> None:
        """Publish the measured state and the mean force of the period that ends, and go on."""
        measured = self.plant.measure()
        if measured is None:
            self.lost_states += self.plant.is_seen()
        else:
            self.states.publish(to_joint_state(self.stamp(measured.t), measured.x,
                                               self.plant.mean_force))
        if self.plant.t - self.reported >= REPORT_PERIOD:
            self.report()
        if self.parameters.duration and self.plant.t >= self.parameters.duration - 1e-9:
            self.done = True
        self.waiting = measured is not None and not self.done
        if self.parameters.lockstep and measured is None:
            self.unanswerable.trigger()   # and not at once, so that a signal can end it
        self.plant.begin_period(self.push)
        self.push = 0.0

    def stamp(self, t: float) -> Time:
        """Return a time of the plant [s] as a stamp."""
        return to_stamp(self.epoch + round(t * 1e9))

    def report(self) -> None:
        """Publish what the plant counts."""
        self.reported = self.plant.t
        level = DiagnosticStatus.WARN if self.timed_out else DiagnosticStatus.OK
        message = 'no force arrives; it is zero' if self.timed_out else 'obeys the force'
        self.diagnostics.publish(to_diagnostics(
            self.stamp(self.plant.t), 'plant', level[0], message,
            {'time': self.plant.t, 'commands': self.commands, 'refused': self.refused,
             'skipped_ticks': self.skipped, 'lost_commands': self.lost_commands,
             'lost_states': self.lost_states}))


def main(args: list[str] | None = None) -> int:
    """Run the node; see `ros2 run dp_swing_ros plant --ros-args -p duration:=10.0`."""
    return run(PlantNode, args)
