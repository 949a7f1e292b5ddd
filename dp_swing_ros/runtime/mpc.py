# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What the mpc does with what comes, and when: the node without ROS, by any clocks.

Where states stop coming in real time, the last plan is followed for a while; then the force is
zero.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
import math
from typing import Any, NamedTuple

from dp_swing_ros.control import controllers
from dp_swing_ros.control.receding_horizon import MpcParameters, RecedingHorizon
from dp_swing_ros.errors import failure
from dp_swing_ros.messages.configuration import from_text, is_of_plant
from dp_swing_ros.messages.fields import (
    ERROR, nanoseconds, OK, Report, to_measured, to_state, WARN)
from dp_swing_ros.messages.states import States
from dp_swing_ros.parameters import group
from dp_swing_ros.pendulum.equations import scale_of
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.sensors import HANGING, SensorParameters, Standstill
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.plan import FALLBACK, Plan, Status
from dp_swing_ros.runtime.handshake import Handshake, Peers
from dp_swing_ros.runtime.loading import Loader, SLOWEST
from dp_swing_ros.runtime.pace import Answer
from dp_swing_ros.runtime.report import tick_report, tip_paths
from dp_swing_ros.runtime.schedule import Arrived, Clocks, Schedule, Slot
from dp_swing_ros.runtime.timing import GoalWatch, Measured, Setbacks

ENDING = 1.0         # [s] at most, beyond the time of a controlled stop


class Force(NamedTuple):
    """A command, and the stamp of the state that it answers."""

    stamp: int     # [ns]
    force: float   # [N]


class Planned(NamedTuple):
    """A plan for the state of a stamp [ns]."""

    stamp: int
    plan: Plan


class Tried(NamedTuple):
    """Where the tip goes in some tries of a solver: paths (M, N + 1, 2) [m], weights (M,)."""

    stamp: int   # [ns]
    paths: Array
    weights: Array


class Announcement(NamedTuple):
    """What it runs with in place of what was given, or found; that of a revision."""

    parameters: Mapping[str, Any]
    revision: int


class PutBack(NamedTuple):
    """That it goes on with these parameters: others turned out not to work."""

    parameters: Mapping[str, Any]


class Wake(NamedTuple):
    """That `on_silence` is to be called after a time [s] of its own clock; None: not any more."""

    after: float | None


class Said(NamedTuple):
    """A line for the log: of level OK, WARN or ERROR."""

    level: int
    text: str


Sent = Force | Planned | Tried | Report | Announcement | PutBack | Wake | Said


class MpcCore:
    """
    A controller in real time, or in lockstep with a plant: one force a state.

    What fails in a tick costs its force, which is zero then.
    """

    def __init__(self, values: Mapping[str, Any], clocks: Clocks, send: Callable[[Sent], None],
                 name: Callable[[bytes], str] = repr) -> None:
        """
        Take all parameters, the clocks, what sends what it is given, at once, and what names GIDs.

        Raises ParameterError for what cannot work.
        """
        self.values = dict(values)
        self.clocks, self.send = clocks, send
        self.parameters = group(MpcParameters, values)
        self.sensors = group(SensorParameters, values)
        physical = group(PendulumParameters, values)
        self.standstill = Standstill(physical.links, scale_of(physical)) \
            if self.sensors.zero == HANGING else None
        self.schedule = Schedule(clocks, self.parameters.clock, values['step'])
        self.handshake = Handshake()
        self.states = States(self.sensors.joint_names, partial(self.say, WARN), name)
        self.setbacks = Setbacks()    # of simulated time
        self.revision = 0             # how often the parameters have changed
        self.found: dict[str, Any] = {}   # instead of those that were given
        self.rivals: Sequence[str] = ()   # in words, who else commands or sends states
        self.forces = 0     # that were sent
        self.answered = 0   # [ns] the stamp of the last state
        self.resets = 0
        self.ends_by = math.inf   # [s] from the request to end on
        self.said = dict[str, float]()   # [s] when

    def prepare(self) -> None:
        """Compile all that a tick needs; raises ParameterError for what cannot work."""
        self.controller = controllers.controller(self.values)
        self.schedule.tick_time = self.controller.warm_up()
        self.forget()
        self.loader = Loader(self.controller)
        self.warn_of_problem()
        self.record_learned_model()
        if self.found:
            self.send(Announcement(self.found, self.revision))

    def forget(self) -> None:
        """Begin anew."""
        self.controller.reset()
        self.schedule.reset()
        self.send(Wake(None))
        self.time_noise = 0.0   # [s] by which the times of measurements may be off
        self.carried = 0        # periods since the last state
        self.late_total = 0     # ticks
        self.goal_watch = GoalWatch()

    @property
    def lockstep(self) -> bool:
        """Return whether time waits for the forces."""
        return self.schedule.lockstep

    # parameters

    def on_change(self, values: dict[str, Any], make: Callable[
            [Callable[[], RecedingHorizon]], RecedingHorizon]) -> None:
        """
        Check other parameters, which count from a next tick on; raises ParameterError.

        `make` returns what a function does, however long that takes.
        """
        self.loader.slowest = math.inf if self.lockstep else SLOWEST
        self.loader.load(make(partial(controllers.controller, values)), values)
        if self.lockstep:   # time waits
            self.loader.wait()

    def reconfigure(self) -> None:
        """Go on with other parameters, if such are ready, or put the last ones back."""
        loaded = self.loader.take()
        if loaded is None:
            return
        if loaded.error:
            text = f'the new parameters cannot be used: {loaded.error}; going on with the last'
            self.say(ERROR, text)
            self.send(Report(self.answered, ERROR, text, {}, 'parameters'))
            self.send(PutBack(self.values))
            return
        self.controller.reconfigure(loaded.controller)
        self.values, self.parameters = loaded.values, self.controller.parameters
        self.revision += 1
        self.warn_of_problem()
        self.record_learned_model()
        self.send(Announcement({**self.values, **self.found}, self.revision))

    def warn_of_problem(self) -> None:
        """Tell of parameters that are possible, but hardly meant."""
        if warning := self.controller.nominal.warning:
            self.say(WARN, warning)

    def record_learned_model(self) -> None:
        """Announce what a learned model holds in place of its file, so that a bag has it."""
        learned = self.controller.nominal.learned
        self.found.pop('model', None)
        if learned is not None:
            self.found['model'] = learned.to_text()

    def on_configuration(self, text: str) -> None:
        """Learn from a plant, or from the recording of one, what its stamps are."""
        try:
            configured = from_text(text)
            self.schedule.timing.learn(configured)
        except (TypeError, ValueError) as error:
            self.say(WARN, f'{error}; going on without it', 'configuration', 10.0)
            return
        if is_of_plant(configured):
            self.compare(configured.parameters)
        if self.handshake.learn(configured):
            self.reset()

    def compare(self, of_plant: Mapping[str, Any]) -> None:
        """Warn of a plant that takes less force, or has less track, than plans count on."""
        for name in ('force_limit', 'track_limit'):
            theirs, own = of_plant.get(name, math.inf), self.values[name]
            if theirs < own:
                self.say(WARN, f'{name} is {own:g}, and that of the plant {theirs:g}; expected '
                         'the same for both: it goes with the bodies, unless it is given',
                         name, math.inf)

    # states

    def on_states(self, arrived: Iterable[Arrived]) -> None:
        """Take all that came on the topic of the states: of several, the newest is answered."""
        newest = None
        for each in arrived:
            if self.states.picks(each.message, each.publisher, each.number, self.clocks.steady(),
                                 asked_again=self.lockstep):
                newest = each._replace(number=self.states.number)
        if newest is None:
            return
        if self.handshake.done:
            self.surely(partial(self.answer, newest))
        else:
            self.handshake.keep(newest, self.clocks.steady())
        self.states.rest(self.clocks.steady())

    def meet(self, peers: Peers) -> None:
        """Answer the first state once it can be, or at the latest after a while."""
        is_timed = self.clocks.now() != 0   # else a simulated clock was not heard yet
        first = self.handshake.complete(peers, self.schedule.timing, is_timed,
                                        self.clocks.steady())
        if first is not None:
            self.surely(partial(self.answer, first))

    def surely(self, tick: Callable[[], None]) -> None:
        """Do a tick; where it fails without a force, that is zero, and the next is a first one."""
        forces = self.forces
        try:
            tick()
        except Exception as error:  # noqa: B902
            text = failure(error)
            self.say(ERROR, f'{text}; going on', 'failure', 1.0)
            if self.forces == forces:
                self.command(0.0)
                self.reset()
            self.send(Report(self.answered, ERROR, text, {}, 'failure'))

    def answer(self, arrived: Arrived) -> None:
        """Send a force for a state, and report how that came about."""
        self.reconfigure()
        schedule, message = self.schedule, arrived.message
        stamp, arrival = nanoseconds(message.header.stamp), schedule.arrival(arrived)
        measured = arrival.measured
        if self.standstill and not self.found_zero(self.standstill, measured.t, message):
            return
        self.answered, self.carried = stamp, 0
        slot = schedule.slot(arrived, arrival, self.parameters.time_limit)
        real_time = not schedule.lockstep
        if real_time:
            self.time_noise = self.parameters.time_noise * schedule.pace
        plan, complaint = self.solve(message, slot)
        period = slot.period if slot.period > 0 else plan.dt
        late = plan.stats.solve_time * schedule.pace > period
        if real_time and self.controller.enabled:
            schedule.wait(slot)
        force = self.follow(plan)
        sent_at, latency = self.clocks.steady(), slot.age + schedule.taken(slot)
        if real_time:
            self.send(Wake(schedule.watchdog.feed(slot.period)))
        self.report(stamp, plan, complaint, self.warning(measured), late=late, force=force,
                    age=slot.age, latency=latency, delay=slot.delay, real_time=real_time,
                    time=slot.t)
        schedule.latency.reports.append(self.clocks.steady() - sent_at)

    def solve(self, message: Any, slot: Slot) -> tuple[Plan, str]:
        """Return the plan for a state, and what is wrong with that."""
        try:
            x = to_state(message, self.values['links'], self.sensors)
            plan = self.controller.update(slot.t, x, slot.delay, slot.deadline, self.time_noise)
            complaint = self.controller.belief.rejection
        except ValueError as error:
            plan, complaint = self.controller.fallback(slot.t + slot.delay), str(error)
        if complaint:
            # what fights over the pendulum is not the fault of its sensors
            complaint = '; '.join((*self.rivals, complaint))
            self.say(ERROR, f'{complaint}; going on without this state', 'state', 1.0)
        if seldom := self.controller.lookahead.warning:
            self.say(WARN, seldom, 'period', math.inf)
        return plan, complaint

    def warning(self, measured: Measured) -> str:
        """Return what is wrong with the stamp of a state, or with the clock."""
        setbacks = self.setbacks.complaint(self.clocks.steady())
        if setbacks:
            self.say(WARN, setbacks, 'setbacks', 5.0)
        return '; '.join(filter(None, (measured.complaint, setbacks)))

    def found_zero(self, standstill: Standstill, t: float, message: Any) -> bool:
        """Take a state measured at a time [s]; return whether it tells the sensors' zero."""
        words = 'waiting for the pendulum to hang still, which tells the zero of its sensors'
        place = None
        try:
            place = standstill.place(t, to_measured(message, self.sensors.joint_names))
        except ValueError as error:
            words = str(error)
        if self.lockstep:
            words = 'in lockstep nobody sees the pendulum hang still; set zero to given'
        if place is None:
            self.say(WARN, words, 'zero', 5.0)
            self.send(Report(nanoseconds(message.header.stamp), WARN, words, {}, 'zero'))
            return False
        self.sensors, self.standstill = self.sensors.hanging_at(place), None
        self.found['joint_offsets'] = self.sensors.joint_offsets
        self.send(Announcement(self.found, self.revision))
        self.say(OK, 'the pendulum hangs still; joint_offsets: '
                 f'{list(self.sensors.joint_offsets)}')
        return True

    def on_setback(self) -> None:
        """Take that the clock jumped back."""
        self.setbacks.times.append(self.clocks.steady())

    # no states

    def on_silence(self) -> None:
        """Follow the last plan without a state that should have come, for a while."""
        self.send(Wake(self.schedule.watchdog.period))
        self.surely(partial(self.answer_nothing, f'no state came in {self.carried + 1} periods'))

    def answer_nothing(self, complaint: str) -> None:
        """Send a force that answers no state."""
        self.carried += 1
        now, slot = self.clocks.now(), self.schedule.silent_slot()
        plan = self.controller.fallback(slot.t + slot.delay)
        if plan.stats.status in (Status.ZERO, Status.DISABLED):
            self.send(Wake(None))
        force = self.follow(plan)
        self.report(now, plan, complaint, '', force=force, delay=slot.delay, latency=0.0,
                    real_time=True, time=slot.t)

    # what is sent

    def follow(self, plan: Plan) -> float:
        """Send the first force [N] of a plan, and return it."""
        if plan.stats.status is Status.STOP:
            self.say(ERROR, f'controlled stop: {self.controller.stopping}', 'stop', 10.0)
        force = plan.first_force(self.controller.nominal.u_max)
        self.command(force)
        return force

    def command(self, force: float) -> None:
        """Send a force [N]."""
        self.send(Force(self.answered, force))
        self.forces += 1

    def report(self, stamp: int, plan: Plan, complaint: str, warning: str, *, time: float,
               late: bool = False, **figures: Any) -> None:
        """Send the plan and the figures of the tick, as TickReport names them."""
        controller, stats = self.controller, plan.stats
        problem, stopping = controller.belief.problem, controller.stopping
        self.send(Planned(stamp, plan))
        if plan.tries is not None:
            self.send(Tried(stamp, tip_paths(plan.X[0], plan.tries, problem), plan.tries.weights))
        # what is disabled is not expected to arrive
        is_there, arrives = (not controller.enabled or problem.is_reached(x) for x in (
            controller.belief.x, plan.X[-1]))
        astray = self.goal_watch.warning(time, is_there, arrives, problem.horizon * problem.dt)
        if astray:
            self.say(WARN, astray, 'goal', 10.0)
        warning = '; '.join(filter(None, (
            warning, astray,
            'the solve failed' if stats.candidates and stats.status in FALLBACK else '')))
        self.late_total += late
        level = OK
        if complaint or stopping or stats.status is Status.ZERO:
            level = ERROR
        elif warning or late or stats.status in (*FALLBACK, Status.DISABLED):
            level = WARN
        tick = tick_report(
            plan, problem, controller.belief.estimate, solver=self.parameters.solver, time=time,
            late=late, late_total=self.late_total, missed_total=self.schedule.missed_total,
            time_noise=self.time_noise, carried=self.carried, resets=self.resets,
            revision=self.revision, number=self.forces, enabled=controller.enabled,
            stopping=bool(stopping), sent=0 if self.carried else self.schedule.sent,
            clock=self.schedule.timing.clock.name.lower(), **figures)
        words = filter(None, (complaint, stopping, warning, stats.status.value))
        self.send(Report(stamp, level, '; '.join(words), tick.values()))

    def say(self, level: int, text: str, about: str = '', every: float = 0.0) -> None:
        """Log a line, of those about one thing no more than one in a time [s]."""
        now = self.clocks.steady()
        if now - self.said.get(about, -math.inf) >= every:
            self.said[about] = now
            self.send(Said(level, text))

    # what it is asked for

    def reset(self) -> Answer:
        """Forget the last plan and restart the random numbers."""
        self.said.clear()   # who begins anew is told anew
        self.forget()
        self.resets += 1
        return Answer(True, 'the next tick is a first one')

    def enable(self, enabled: bool) -> Answer:
        """
        Act again, from a first plan, or let the force go at once.

        States are believed meanwhile, so that it knows the pendulum when it is enabled again.
        """
        changes = self.controller.enable(enabled)
        self.schedule.is_first = self.schedule.is_first or changes
        if changes:
            self.say(WARN, 'enabled' if enabled else 'disabled: the force is zero')
        # in lockstep it would answer the next state, and each answer from then on come too early
        if changes and not enabled and self.forces and not self.lockstep:
            self.answer_nothing('')
        return Answer(True, 'enabled: a force for each state' if enabled
                      else 'disabled: zero force')

    def may_end(self) -> bool:
        """Return whether the cart is braked, where it is to be before the end."""
        seconds = self.parameters.controlled_stop
        if not (seconds and self.forces and self.controller.enabled):
            return True
        if not math.isfinite(self.ends_by):
            self.ends_by = self.clocks.steady() + seconds + ENDING
            self.controller.stop('the process ends')
        return self.clocks.steady() > self.ends_by

    def close(self) -> None:
        """End the stream of commands with zero."""
        if self.forces:
            self.command(0.0)
