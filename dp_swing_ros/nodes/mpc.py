# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The controller: from every state a plan, and from the plan a force.

Where states stop coming in real time, the last plan is followed for a while; then the force is
zero.
"""

from collections.abc import Callable
from functools import partial
import gc
from itertools import chain, islice
import math
import time
from typing import Any, NamedTuple

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import JumpThreshold
from rclpy.duration import Duration
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String

from dp_swing_ros.control import controllers
from dp_swing_ros.control.receding_horizon import MpcParameters
from dp_swing_ros.messages.configuration import from_text, is_of_plant
from dp_swing_ros.messages.fields import BILLION, seconds, to_measured, to_state
from dp_swing_ros.messages.states import States
from dp_swing_ros.nodes.cdr import to_trajectory
from dp_swing_ros.nodes.connections import is_heard, owners, publish, sender_of, subscribe
from dp_swing_ros.nodes.diagnostics import Diagnostics
from dp_swing_ros.nodes.loading import Loader, SLOWEST
from dp_swing_ros.nodes.messages import to_point_cloud, to_stamped_force
from dp_swing_ros.nodes.process import failure, ProcessNode, run
from dp_swing_ros.nodes.ros_parameters import announce, declare, given, let_change
from dp_swing_ros.nodes.taking import take
from dp_swing_ros.nodes.tick_figures import of_estimate, of_plan, tip_paths
from dp_swing_ros.nodes.timing import (
    Clock, GoalWatch, Latency, Measured, Setbacks, Timing, Watchdog)
from dp_swing_ros.parameters import group
from dp_swing_ros.pendulum.sensors import HANGING, SensorParameters, Standstill
from dp_swing_ros.pendulum.state import errors, is_upright
from dp_swing_ros.problem.plan import FALLBACK, Plan, Status
from dp_swing_ros.topics import (
    CONFIGURATION, FORCE_COMMAND, FORCE_COMMAND_STAMPED, JOINT_STATES, PLAN, TRIES)

MEETING = 2.0        # [s] at most, to learn who sends the states, and for them to find the forces
MEETING_POLL = 0.02  # [s]
SMOOTHING = 0.1      # share of the newest tick in the mean pace
SLOW_START = 1.0     # [s] a warm-up longer than this was a compilation
QUEUE = 100          # messages of all robots, while a solve goes on
ENDING = 1.0         # [s] at most, beyond the time of a controlled stop
PACES = (0.01, 100.0)  # slowest and fastest of a simulated clock, in seconds a second


class Arrival(NamedTuple):
    """How a state came."""

    t: float        # [s] when it was measured, by the clock of the controller
    now: float      # [s] when it came, by the clock of this node
    steady: float   # [s] and by one that is never set
    number: int     # that its publisher gave it
    sent: int       # [ns] by the clock of its publisher


class Times(NamedTuple):
    """When a tick was, and how long what took [s]."""

    t: float            # when its state was measured, by the clock of the controller
    age: float = 0.0    # of the state when it came
    delay: float = 0.0  # from the measurement until the force was to act
    latency: float = 0.0   # and until it was sent


class MpcNode(ProcessNode):
    """
    The node. It listens only once everything is compiled, and sends one force a state.

    In lockstep there is no latency to make up for and no deadline, so that the result does not
    depend on the machine. What fails in a tick costs its force, which is zero then.
    """

    def __init__(self) -> None:
        """Read the parameters, and refuse what cannot work."""
        super().__init__('mpc')
        self.fields = controllers.MPC.fields_for(given(self))
        values = declare(self, self.fields, live=True)
        self.thread_priority = values['thread_priority']
        self.links, self.u_max = values['links'], values['force_limit']
        self.parameters = group(MpcParameters, values)
        self.solver = self.parameters.solver
        self.sensors = group(SensorParameters, values)
        self.standstill = Standstill() if self.sensors.zero == HANGING else None
        self.timing = Timing(self.parameters.clock)
        self.values = values     # that it runs with
        self.revision = 0        # how often the parameters have changed
        self.found: dict[str, Any] = {}   # instead of those that were given
        self.forces = publish(self, FORCE_COMMAND)
        self.stamped_forces = publish(self, FORCE_COMMAND_STAMPED)
        self.plans, self.tries = publish(self, PLAN), publish(self, TRIES)
        self.states = States(self.sensors.joint_names, self.get_logger().warning,
                             partial(sender_of, self, JOINT_STATES))
        self.diagnostics = Diagnostics(self, self.states)
        self.serve('mpc/reset', self.on_reset)
        self.serve_switch('mpc/enable', self.on_enable)
        subscribe(self, CONFIGURATION, self.on_configuration, sparing=True)
        self.watchdog = Watchdog(self, values['step'], self.on_silence)
        self.sent = 0    # forces
        self.answered = Time()   # the stamp of the last state
        self.resets = 0
        self.configured = dict[str, int]()   # resets of the nodes that have announced themselves
        self.plants = set[str]()      # the names of those that are plants of ours
        self.setbacks = Setbacks()    # of simulated time
        self.jumps = self.get_clock().create_jump_callback(
            JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1)),
            post_callback=lambda _: self.setbacks.times.append(time.perf_counter()))
        self.ends_by = math.inf   # [s] of time.monotonic(), from a signal on
        self.waiting: tuple[JointState, dict[str, int]] | None = None   # until they met
        self.met = False

    def forget(self) -> None:
        """Begin anew."""
        self.controller.reset()
        self.timing.reset()
        self.watchdog.forget()
        self.latency = Latency(self.tick_time)
        self.pace = 1.0         # seconds of this node's clock in a second
        self.time_noise = 0.0   # [s] by which the times of measurements may be off
        self.carried = 0        # periods since the last state
        self.late_total = self.missed_total = 0   # ticks, and states that others overtook
        self.fresh = True       # the next plan is a first one
        self.goal_watch = GoalWatch()
        self.last = Arrival(math.nan, math.nan, math.nan, 0, 0)

    def prepare(self) -> None:
        """Compile before the first state, then listen."""
        self.get_logger().info(f'preparing the solver {self.solver!r} (the first start on a '
                               'machine compiles for half a minute; later ones take a second)')
        began = time.perf_counter()
        self.controller = controllers.controller(self.values)   # compiles, at the first start
        self.tick_time = self.controller.warm_up()
        self.forget()
        self.loader = Loader(self.controller)
        self.warn_of_problem()
        if self.controller.nominal.learned is not None:
            self.note_learned()
            announce(self, self.found, self.revision)
        self.put_back = let_change(self, self.fields, self.values, self.on_change)
        taken = time.perf_counter() - began
        gc.collect()
        gc.freeze()   # else the collector looks through all modules in a first tick, for 25 ms
        done = 'compiled' if taken > SLOW_START else 'loaded'
        self.heard = subscribe(self, JOINT_STATES, self.on_message, depth=QUEUE, sensor=True)
        self.hurry(self.heard, self.watchdog.timer)
        self.get_logger().info(f'{done} in {taken:.1f} s; ready')

    def on_change(self, values: dict[str, Any]) -> None:
        """Check other parameters, which count from a next tick on; raises ParameterError."""
        waits = self.timing.clock is Clock.LOCKSTEP   # time
        self.loader.slowest = math.inf if waits else SLOWEST
        controller = self.made_aside(partial(controllers.controller, values), waits=waits)
        self.loader.load(controller, values)
        if waits:
            self.loader.wait()

    def reconfigure(self) -> None:
        """Go on with other parameters, if such are ready, or put the last ones back."""
        loaded = self.loader.take()
        if loaded is None:
            return
        if loaded.error:
            text = f'the new parameters cannot be used: {loaded.error}; going on with the last'
            self.get_logger().error(text)
            self.diagnostics.publish(self.answered, DiagnosticStatus.ERROR, text, {},
                                     part='parameters')
            self.put_back(self.values)
            return
        self.controller.reconfigure(loaded.controller)
        self.values = loaded.values
        self.parameters = self.controller.parameters
        self.solver, self.u_max = self.parameters.solver, loaded.values['force_limit']
        self.revision += 1
        self.warn_of_problem()
        self.note_learned()
        announce(self, {**loaded.values, **self.found}, self.revision)

    def warn_of_problem(self) -> None:
        """Tell of parameters that are possible, but hardly meant."""
        if warning := self.controller.nominal.warning:
            self.get_logger().warning(warning)

    def note_learned(self) -> None:
        """Announce what a learned model holds in place of its file, so that a bag has it."""
        learned = self.controller.nominal.learned
        self.found.pop('model', None)
        if learned is not None:
            self.found['model'] = learned.to_text()

    def on_configuration(self, message: String) -> None:
        """Learn from a plant, or from the recording of one, what its stamps are."""
        try:
            configured = from_text(message.data)
            self.timing.learn(configured)
        except (TypeError, ValueError) as error:
            self.get_logger().warning(f'{error}; going on without it', throttle_duration_sec=10.0)
            return
        if is_of_plant(configured):
            self.plants.add(configured.node)
        before = self.configured.get(configured.node)
        self.configured[configured.node] = configured.resets
        # a plan from before leads from where the pendulum is no more; a plant that begins again
        # is another one, of which nothing is known yet
        begins = is_of_plant(configured) and configured.revision == 0
        if before is not None and (begins or configured.resets != before):
            self.on_reset()

    def on_message(self, message: JointState, info: dict[str, Any]) -> None:
        """Take all that came on the topic of the states: of several, the newest is answered."""
        if self.lane is not None:
            self.lane.note()
        newest, others = None, iter(partial(take, self.heard), None)
        for message, info in chain([(message, info)], islice(others, QUEUE)):
            if self.states.picks(message, info['publisher_gid'],
                                 info['publication_sequence_number'], time.monotonic(),
                                 asked_again=self.timing.clock is Clock.LOCKSTEP):
                newest = message, {**info, 'publication_sequence_number': self.states.number}
        if newest is not None:
            self.on_state(*newest)
            self.states.rest(time.monotonic())

    def on_state(self, message: JointState, info: dict[str, int]) -> None:
        """Answer a state; the first as soon as its clock is known and the force will be heard."""
        if self.met:
            self.surely(partial(self.answer, message, info))
            return
        if self.waiting is None:
            self.met_by = time.monotonic() + MEETING
            self.meeting = self.every(MEETING_POLL, self.on_meeting)
        self.waiting = message, info
        self.on_meeting()

    def on_meeting(self) -> None:
        """Answer the newest state once it can be, or at the latest after a while."""
        if self.waiting is not None and (
                self.can_answer() or time.monotonic() > self.met_by):
            self.destroy_timer(self.meeting)
            self.met = True
            self.surely(partial(self.answer, *self.waiting))

    def can_answer(self) -> bool:
        """Return whether the clocks are known and a plant hears the forces."""
        if self.get_clock().now().nanoseconds == 0:   # a simulated one that was not heard yet
            return False
        announcers = owners(self, JOINT_STATES) & owners(self, CONFIGURATION)
        if self.timing.given is None and not announcers <= self.configured.keys():
            return False
        # a plant in lockstep would wait forever for a force that it did not hear
        lockstep = self.timing.clock is Clock.LOCKSTEP
        wanted = owners(self, JOINT_STATES) if lockstep else announcers & self.plants
        return not (lockstep or wanted) or is_heard(self, self.forces, wanted)

    def surely(self, tick: Callable[[], None]) -> None:
        """Do a tick; where it fails without a force, that is zero, and the next is a first one."""
        sent = self.sent
        try:
            tick()
        except Exception as error:  # noqa: B902
            self.on_failure(error)
            if self.sent == sent:
                self.command(0.0)
                self.sent += 1
                self.on_reset()
            self.diagnostics.publish(self.answered, DiagnosticStatus.ERROR, failure(error), {},
                                     part='failure')

    def answer(self, message: JointState, info: dict[str, int]) -> None:
        """Send a force for a state, and report how that came about."""
        self.reconfigure()
        now, began = self.get_clock().now().nanoseconds / BILLION, time.perf_counter()
        real_time = self.timing.clock is not Clock.LOCKSTEP
        sent = now - (time.time() - info['source_timestamp'] / BILLION) * self.pace
        measured = self.timing.measured(seconds(message.header.stamp), now, sent)
        if self.standstill and not self.found_zero(self.standstill, measured.t, message):
            return
        self.answered = message.header.stamp
        before, self.last = self.last, Arrival(measured.t, now, began,
                                               info['publication_sequence_number'],
                                               info['source_timestamp'])
        # what the publisher sent in between was overwritten while a solve went on
        steps = max(self.last.number - before.number, 1)
        self.missed_total += steps - 1 if before.number else 0
        period = (measured.t - before.t) / steps
        self.carried = 0
        delay, deadline = measured.age, math.inf
        if real_time:
            self.pace = self.pace_since(before)
            received = info['received_timestamp'] / BILLION
            self.latency.add_transport(received - info['source_timestamp'] / BILLION)
            # it may have waited for the tick before; this one catches up
            left = self.latency.left(self.watchdog.period / self.pace, time.time() - received)
            delay += self.latency.expected(left) * self.pace
            deadline = began + min(self.parameters.time_limit / self.pace, left)
            self.time_noise = self.parameters.time_noise * self.pace
        plan, complaint = self.solve(message, measured.t, delay, deadline)
        late = plan.stats.solve_time * self.pace > (period if period > 0 else plan.dt)
        if real_time and self.controller.enabled:
            self.latency.keep(began, self.fresh)
            self.fresh = False
        force = self.send(plan)
        sent_at = time.perf_counter()
        taken = (sent_at - began) * self.pace
        if real_time:
            self.watchdog.feed(period)
        self.report(message.header.stamp, plan, complaint, self.warning(measured), force, late,
                    real_time, Times(measured.t, measured.age, delay, measured.age + taken))
        self.latency.reports.append(time.perf_counter() - sent_at)

    def warning(self, measured: Measured) -> str:
        """Return what is wrong with the stamp of a state, or with the clock of this node."""
        setbacks = self.setbacks.complaint(time.perf_counter())
        if setbacks:
            self.get_logger().warning(setbacks, throttle_duration_sec=5.0)
        return '; '.join(filter(None, (measured.complaint, setbacks)))

    def found_zero(self, standstill: Standstill, t: float, message: JointState) -> bool:
        """Take a state measured at a time [s]; return whether it tells the sensors' zero."""
        words = 'waiting for the pendulum to hang still, which tells the zero of its sensors'
        place = None
        try:
            place = standstill.place(t, to_measured(message, self.sensors.joint_names))
        except ValueError as error:
            words = str(error)
        if self.timing.clock is Clock.LOCKSTEP:
            words = 'in lockstep nobody sees the pendulum hang still; set zero to given'
        if place is None:
            self.get_logger().warning(words, throttle_duration_sec=5.0)
            self.diagnostics.publish(
                message.header.stamp, DiagnosticStatus.WARN, words, {}, part='zero')
            return False
        self.sensors, self.standstill = self.sensors.hanging_at(place), None
        self.found = {'joint_offsets': self.sensors.joint_offsets}
        announce(self, self.found, self.revision)
        self.get_logger().info(f'the pendulum hangs still; joint_offsets: '
                               f'{list(self.sensors.joint_offsets)}')
        return True

    def pace_since(self, before: Arrival) -> float:
        """Return the pace of this node's clock, which may be a simulated one."""
        passed = self.last.steady - before.steady
        if not (self.get_parameter('use_sim_time').value and passed > 0):
            return self.pace
        pace = (self.last.now - before.now) / passed
        return self.pace + SMOOTHING * (min(max(pace, PACES[0]), PACES[1]) - self.pace)

    def on_silence(self) -> None:
        """Follow the last plan without a state that should have come, for a while."""
        self.surely(partial(self.go_on, f'no state came in {self.carried + 1} periods'))

    def go_on(self, complaint: str) -> None:
        """Send a force that answers no state."""
        self.carried += 1
        stamp = self.get_clock().now().to_msg()
        t, delay = seconds(stamp), self.latency.transport() * self.pace
        plan = self.controller.fallback(t + delay)
        if plan.stats.status in (Status.ZERO, Status.DISABLED):
            self.watchdog.stop()
        force = self.send(plan)
        self.report(stamp, plan, complaint, '', force, False, True, Times(t, delay=delay))

    def send(self, plan: Plan) -> float:
        """Send the first force [N] of a plan, and return it."""
        force = plan.first_force(self.u_max)
        if plan.stats.status is Status.STOP:
            self.get_logger().error(f'controlled stop: {self.controller.stopping}',
                                    throttle_duration_sec=10.0)
        self.command(force)
        self.sent += 1
        return force

    def command(self, force: float) -> None:
        """Publish a force [N], also with the stamp of the last state."""
        self.forces.publish(Float64(data=force))
        self.stamped_forces.publish(to_stamped_force(
            self.answered, self.sensors.joint_names[0], force))

    def solve(self, message: JointState, t: float, delay: float,
              deadline: float) -> tuple[Plan, str]:
        """Return the plan for a state measured at a time [s], and what is wrong with the state."""
        try:
            x = to_state(message, self.links, self.sensors)
            plan = self.controller.update(t, x, delay, deadline, self.time_noise)
            complaint = self.controller.belief.rejection
        except ValueError as error:
            plan, complaint = self.controller.fallback(t + delay), str(error)
        if complaint:
            # what fights over the pendulum is not the fault of its sensors
            complaint = '; '.join((*self.diagnostics.rivals, complaint))
            self.get_logger().error(f'{complaint}; going on without this state',
                                    throttle_duration_sec=1.0)
        return plan, complaint

    def report(self, stamp: Time, plan: Plan, complaint: str, warning: str, force: float,
               late: bool, real_time: bool, times: Times) -> None:
        """Publish the plan and the figures of the tick."""
        problem = self.controller.belief.problem
        self.plans.publish(to_trajectory(plan, stamp))
        if plan.tries is not None:
            self.tries.publish(to_point_cloud(
                stamp, tip_paths(plan.X[0], plan.tries, problem), plan.tries.weights))
        stats, estimate = plan.stats, self.controller.belief.estimate
        # what is disabled is not expected to arrive
        arrives = not self.controller.enabled or is_upright(errors(plan.X[-1], problem.x_r))
        astray = self.goal_watch.warning(times.t, bool(arrives), problem.horizon * problem.dt)
        if astray:
            self.get_logger().warning(astray, throttle_duration_sec=10.0)
        warning = '; '.join(filter(None, (
            warning, astray,
            'the solve failed' if stats.candidates and stats.status in FALLBACK else '')))
        self.late_total += late
        level = DiagnosticStatus.OK
        stopping = self.controller.stopping
        if complaint or stopping or stats.status is Status.ZERO:
            level = DiagnosticStatus.ERROR
        elif warning or late or stats.status in (*FALLBACK, Status.DISABLED):
            level = DiagnosticStatus.WARN
        self.diagnostics.publish(
            stamp, level, '; '.join(filter(None, (
                complaint, stopping, warning, stats.status.value))),
            {'solver': self.solver, **of_plan(plan, problem), 'age': times.age,
             'latency': times.latency, 'delay': times.delay, 'late': late,
             'late_total': self.late_total, 'missed_total': self.missed_total, 'force': force,
             # what it takes to repeat the tick
             'real_time': real_time, 'time': times.t,
             'time_noise': self.time_noise, 'carried': self.carried, 'resets': self.resets,
             'revision': self.revision, 'number': self.sent,
             'enabled': self.controller.enabled, 'stopping': bool(stopping),
             # by the clock of its sender [ns]; tells which state it was where stamps stand still
             'sent': 0 if self.carried else self.last.sent,
             'clock': self.timing.clock.name.lower(),
             **(of_estimate(estimate) if estimate is not None else {})})

    def on_reset(self) -> tuple[bool, str]:
        """Forget the last plan and restart the random numbers."""
        self.forget()
        self.resets += 1
        return True, 'the next tick is a first one'

    def on_enable(self, enabled: bool) -> tuple[bool, str]:
        """
        Act again, from a first plan, or let the force go at once.

        States are believed meanwhile, so that it knows the pendulum when it is enabled again.
        """
        changes = self.controller.enable(enabled)
        self.fresh = self.fresh or changes
        if changes:
            self.get_logger().warning('enabled' if enabled else 'disabled: the force is zero')
        # in lockstep it would answer the next state, and each answer from then on come too early
        if changes and not enabled and self.sent and self.timing.clock is not Clock.LOCKSTEP:
            self.go_on('')
        return True, 'enabled: a force for each state' if enabled else 'disabled: zero force'

    def may_end(self) -> bool:
        """Return whether the cart is braked, where it is to be before the end."""
        seconds = self.parameters.controlled_stop
        if not (seconds and self.sent and self.controller.enabled):
            return True
        if not math.isfinite(self.ends_by):
            self.ends_by = time.monotonic() + seconds + ENDING
            self.controller.stop('the process ends')
        return time.monotonic() > self.ends_by

    def close(self) -> None:
        """End the stream of commands with zero."""
        if self.sent:
            self.command(0.0)


main = partial(run, MpcNode)
