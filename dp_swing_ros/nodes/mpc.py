# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The controller: from every state a plan, and from the plan a force.

Where states stop coming in real time, the last plan goes on for a while; then the force is zero.
"""

import gc
import math
import time

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from std_srvs.srv import Trigger

from dp_swing_ros.estimator import EstimatorParameters
from dp_swing_ros.mpc import MpcParameters, RecedingHorizon
from dp_swing_ros.nodes.connections import is_heard, publish, subscribe
from dp_swing_ros.nodes.messages import (
    of_estimate, seconds, to_diagnostics, to_state, to_trajectory)
from dp_swing_ros.nodes.process import ProcessNode, run
from dp_swing_ros.nodes.ros_parameters import declare, settle
from dp_swing_ros.nodes.watch import Watch
from dp_swing_ros.parameters import (
    CostParameters, LimitParameters, PendulumParameters, PredictionParameters)
from dp_swing_ros.plan import Plan, Status
from dp_swing_ros.problem import Problem
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.topics import DIAGNOSTICS, FORCE_COMMAND, JOINT_STATES, PLAN

OTHER_CLOCK = 10.0   # [s] a stamp further from now than this is simulated or recorded time
MEETING = 2.0        # [s] at most, for whoever sends the states to find the forces
MEETING_POLL = 0.02  # [s] and for older states to be followed by the newest
SMOOTHING = 0.1      # share of the newest tick in the mean processing time
SLOW_START = 1.0     # [s] a warm-up longer than this was a compilation


class MpcNode(ProcessNode):
    """
    The node. It listens only once everything is compiled, and sends one force a state.

    Where the stamps are simulated time (the plant in lockstep, a bag) there is no latency to make
    up for and no deadline, so that the result does not depend on the machine.
    """

    def __init__(self) -> None:
        """Read the parameters, and refuse what cannot work."""
        super().__init__('mpc')
        bodies = declare(self, PendulumParameters)
        limits = declare(self, LimitParameters)
        cost = declare(self, CostParameters)
        prediction = declare(self, PredictionParameters)
        self.parameters = declare(self, MpcParameters)
        of_solvers = {name: declare(self, solver.Parameters, name)
                      for name, solver in sorted(SOLVERS.items())}
        of_estimator = declare(self, EstimatorParameters, 'ekf')
        settle(self)
        self.solver = self.parameters.solver
        self.horizon = RecedingHorizon(Problem.of(bodies, limits, cost, prediction),
                                       self.parameters, of_solvers[self.solver], of_estimator)
        self.u_max = limits.force_limit
        self.forces = publish(self, FORCE_COMMAND)
        self.plans = publish(self, PLAN)
        self.diagnostics = publish(self, DIAGNOSTICS)
        self.create_service(Trigger, 'mpc/reset', self.on_reset)
        self.watch = Watch(self, self.on_silence)
        self.sent = 0    # forces
        self.resets = 0
        self.waiting: JointState | None = None   # the first state in lockstep
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self.horizon.reset()
        self.watch.forget()
        self.processing = 0.0   # [s] mean time from a state's arrival to its force
        self.transport = 0.0    # [s] of the last state, from the plant
        self.carried = 0        # periods since the last state
        self.late_total = 0
        self.last_stamp = math.nan

    def prepare(self) -> None:
        """Compile before the first state, then listen."""
        self.get_logger().info(f'preparing the solver {self.solver!r} (the first start on a '
                               'machine compiles for half a minute; later ones take a second)')
        taken = self.horizon.warm_up()
        gc.collect()
        gc.freeze()   # else the collector looks through all modules in a first tick, for 25 ms
        done = 'compiled' if taken > SLOW_START else 'loaded'
        self.began = self.get_clock().now().nanoseconds
        # Of several states, the newest. A plant in lockstep may have sent its first one already.
        subscribe(self, JOINT_STATES, self.on_state, depth=1, kept=True)
        self.get_logger().info(f'{done} in {taken:.1f} s; ready')

    def on_state(self, message: JointState, info: dict[str, int]) -> None:
        """Answer a state; in real time at once, in lockstep the first when it will be heard."""
        age = self.get_clock().now().nanoseconds / 1e9 - seconds(message.header.stamp)
        real_time = abs(age) < OTHER_CLOCK
        if real_time and info['source_timestamp'] < self.began:
            return   # in real time what is over is over
        if real_time or self.sent:
            # the force takes as long to the plant as the state took from there
            self.answer(message, real_time,
                        (info['received_timestamp'] - info['source_timestamp']) / 1e9)
        elif self.waiting is None:
            self.met_by = time.monotonic() + MEETING
            self.meeting = self.create_timer(
                MEETING_POLL, self.on_meeting, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.waiting = message

    def on_meeting(self) -> None:
        """Answer the first state as soon as its sender hears, for it would wait forever."""
        heard = is_heard(self, self.forces, JOINT_STATES)
        if self.waiting is not None and (heard or time.monotonic() > self.met_by):
            self.destroy_timer(self.meeting)
            self.answer(self.waiting, False)

    def answer(self, message: JointState, real_time: bool, transport: float = 0.0) -> None:
        """Send a force, which takes some time [s] to arrive, for a state; tell how it came."""
        arrival = time.perf_counter()
        stamp = seconds(message.header.stamp)
        age = self.get_clock().now().nanoseconds / 1e9 - stamp
        self.transport, self.carried = max(transport, 0.0), 0
        delay = max(age, 0.0) + self.processing + self.transport if real_time else 0.0
        deadline = arrival + self.parameters.time_limit if real_time else math.inf
        plan, complaint = self.solve(message, stamp, delay, deadline)
        period, self.last_stamp = stamp - self.last_stamp, stamp
        late = plan.stats.solve_time > (period if period > 0 else plan.dt)
        force = self.send(plan)
        taken = time.perf_counter() - arrival
        if real_time:
            self.processing += SMOOTHING * (taken - self.processing)
            self.watch.heard(period)
        self.report(message.header.stamp, plan, complaint, force, late, real_time, delay,
                    age + taken if real_time else taken)

    def on_silence(self) -> None:
        """Go on without a state that should have come; after some, let go."""
        self.carried += 1
        stamp, delay = self.get_clock().now().to_msg(), self.processing + self.transport
        begins = seconds(stamp) + delay   # as the record tells it
        if self.carried > self.parameters.carry_over:
            self.watch.stop()
            plan = self.horizon.let_go(begins)
        else:
            plan = self.horizon.stand_in(begins)
        force = self.send(plan)
        self.report(stamp, plan, f'no state in {self.carried} periods', force, False, True,
                    delay, 0.0)

    def send(self, plan: Plan) -> float:
        """Send the first force [N] of a plan, and return it."""
        force = plan.first_force(self.u_max)
        self.forces.publish(Float64(data=force))
        self.sent += 1
        return force

    def solve(self, message: JointState, stamp: float, delay: float,
              deadline: float) -> tuple[Plan, str]:
        """Return the plan, and what was wrong with the state."""
        try:
            return self.horizon.update(stamp, to_state(message), delay, deadline), ''
        except ValueError as error:
            self.get_logger().error(f'{error}; going on without this state',
                                    throttle_duration_sec=1.0)
            return self.horizon.stand_in(stamp + delay), str(error)

    def report(self, stamp: Time, plan: Plan, complaint: str, force: float, late: bool,
               real_time: bool, delay: float, latency: float) -> None:
        """Publish the plan and the figures of the tick."""
        self.plans.publish(to_trajectory(plan, stamp))
        stats, estimate = plan.stats, self.horizon.estimate
        self.late_total += late
        level, text = DiagnosticStatus.OK, stats.status.value
        if complaint or stats.status is Status.ZERO:
            level, text = DiagnosticStatus.ERROR, f'{complaint}; {text}'.lstrip('; ')
        elif late or stats.status in (Status.LAST_POLICY, Status.REGULATOR):
            level = DiagnosticStatus.WARN
        self.diagnostics.publish(to_diagnostics(
            stamp, 'mpc', level[0], text,
            {'solver': self.solver, 'status': stats.status.name, 'cost': stats.cost,
             'iterations': stats.iterations, 'solve_time': stats.solve_time, 'latency': latency,
             'delay': delay, 'late': late, 'late_total': self.late_total, 'force': force,
             # what it takes to repeat the tick
             'real_time': real_time, 'solves': ' '.join(map(str, stats.solves)),
             'carried': self.carried, 'resets': self.resets, 'number': self.sent,
             **(of_estimate(estimate) if estimate is not None else {})}))

    def on_reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Forget the last plan and restart the random numbers."""
        self.forget()
        self.resets += 1
        response.success, response.message = True, 'the next tick is a first one'
        return response

    def close(self) -> None:
        """End the stream of commands with zero."""
        if self.sent:
            self.forces.publish(Float64(data=0.0))


def main(args: list[str] | None = None) -> int:
    """Run the node; see `ros2 run dp_swing_ros mpc --ros-args -p solver:=mppi`."""
    return run(MpcNode, args)
