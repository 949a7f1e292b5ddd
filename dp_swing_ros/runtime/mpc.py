# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What the mpc does with what comes, and when: the node without ROS, by any clocks.

Where states stop coming in real time, the last plan is followed for a while; then the force is
zero.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import partial
import math
from typing import Any

from dp_swing_ros.control import controllers
from dp_swing_ros.control.receding_horizon import RecedingHorizon
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
from dp_swing_ros.problem.plan import IDLE, Plan, Status
from dp_swing_ros.runtime.handshake import Handshake, Peers
from dp_swing_ros.runtime.live_parameters import LiveParameters
from dp_swing_ros.runtime.report import Reporter, tip_paths
from dp_swing_ros.runtime.schedule import Arrived, Clocks, Schedule, Slot
from dp_swing_ros.runtime.sent import Force, Log, Planned, Sent, Tried, Wake
from dp_swing_ros.runtime.timing import Measured, Setbacks

ENDING = 1.0         # [s] at most, beyond the time of a controlled stop
UNHEARD = 'states come, and nobody publishes /clock, which use_sim_time asks for; no force before'


def place_of(standstill: Standstill, t: float, message: Any, sensors: SensorParameters,
             in_lockstep: bool) -> tuple[Array | None, str]:
    """Return where the pendulum hangs still at a time [s], or why it is not known yet."""
    words = 'waiting for the pendulum to hang still, which tells the zero of its sensors'
    place = None
    try:
        place = standstill.place(t, to_measured(message, sensors.joint_names))
    except ValueError as error:
        words = str(error)
    if in_lockstep:
        words = 'in lockstep nobody sees the pendulum hang still; set zero to given'
    return place, words


class MpcCore:
    """
    A controller in real time, or in lockstep with a plant: one force a state.

    What fails in a tick costs its force, which is zero then.
    """

    def __init__(self, values: Mapping[str, Any], clocks: Clocks, send: Callable[[Sent], None],
                 name: Callable[[bytes], str] = repr,
                 senders: Callable[[], Collection[str]] = tuple) -> None:
        """
        Take all parameters, the clocks, what sends what it is given, at once, and what names GIDs.

        senders: of states, by the names of their nodes. Raises ParameterError for what cannot be.
        """
        self.clocks, self.send, self.senders = clocks, send, senders
        self.log = Log(send, clocks.steady)
        self.live = LiveParameters(values, send, self.log)
        self.sensors = group(SensorParameters, values)
        physical = group(PendulumParameters, values)
        self.standstill = Standstill(physical.links, scale_of(physical)) \
            if self.sensors.zero == HANGING else None
        self.schedule = Schedule(clocks, values['clock'], values['step'])
        self.handshake = Handshake()
        self.states = States(self.sensors.joint_names, partial(self.log.say, WARN), name)
        self.setbacks = Setbacks()    # of simulated time
        self.rivals: Sequence[str] = ()   # in words, who else commands or sends states
        self.forces = 0     # that were sent
        self.answered = 0   # [ns] the stamp of the last state
        self.resets = 0
        self.ends_by = math.inf   # [s] from the request to end on

    def prepare(self) -> None:
        """Compile all that a tick needs; raises ParameterError for what cannot work."""
        self.controller = controllers.controller(self.live.values)
        self.schedule.tick_time = self.controller.warm_up()
        self.reporter = Reporter(self.controller, self.log)
        self.restart()
        self.live.begin(self.controller)

    def restart(self) -> None:
        """Begin anew; where no state comes, a last force is followed by zero all the same."""
        wakes = None if self.lockstep or not self.forces else self.schedule.watchdog.period
        self.reply: tuple[Any, int, float] | None = None   # state, revision and force of the last
        self.controller.reset()
        self.schedule.reset()
        self.reporter.reset()
        self.send(Wake(wakes))
        self.time_noise = 0.0   # [s] by which the times of measurements may be off
        self.carried = 0        # periods since the last state

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
        self.live.load(make(partial(controllers.controller, values)), values, self.lockstep)

    def on_configuration(self, text: str) -> None:
        """Learn from a plant, or from the recording of one, what its stamps are."""
        timing = self.schedule.timing
        try:
            configured = from_text(text)
            timing.learn(configured, self.senders())
        except (TypeError, ValueError) as error:
            self.log.say(WARN, f'{error}; going on without it', 'configuration', 10.0)
            return
        begins_again, counts = self.handshake.learn(configured), not timing.is_stranger(
            configured.node)   # else where its states are obeyed one day
        if counts and is_of_plant(configured):
            self.live.compare(configured.parameters)
        if counts and begins_again:
            self.reset()

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
        self.schedule.timing.obeyed = self.states.obeyed_name
        if self.handshake.done:
            self.attempt(partial(self.answer, newest))
        else:
            self.handshake.keep(newest, self.clocks.steady())
        self.states.caught_up(self.clocks.steady())

    def on_peers(self, peers: Peers) -> None:
        """Answer the first state once it can be, or at the latest after a while."""
        # else a simulated clock was not heard yet, which in lockstep nobody needs
        is_timed = self.lockstep or self.clocks.now() != 0
        if not is_timed and self.handshake.is_late(self.clocks.steady()):
            self.log.say(WARN, UNHEARD, 'clock', 10.0)
        first = self.handshake.complete(peers, self.schedule.timing, is_timed,
                                        self.clocks.steady())
        if first is not None:
            self.attempt(partial(self.answer, first))

    def attempt(self, tick: Callable[[], None]) -> None:
        """Do a tick; where it fails without a force, that is zero, and the next is a first one."""
        forces = self.forces
        try:
            tick()
        except Exception as error:
            text = failure(error)
            self.log.say(ERROR, f'{text}; going on', 'failure', 1.0)
            if self.forces == forces:
                self.command(0.0)
                self.restart()
                self.resets += 1
            self.send(Report(self.answered, ERROR, text, {}, 'failure'))

    def answer(self, arrived: Arrived) -> None:
        """Send a force for a state, and report how that came about."""
        self.live.take_over(self.answered)
        schedule, message = self.schedule, arrived.message
        if self.lockstep and self.reply and self.reply[:2] == (message, self.live.revision):
            schedule.ask_again(arrived)   # another solve would change the next
            return self.command(self.reply[2])
        stamp, arrival = nanoseconds(message.header.stamp), schedule.arrival(arrived)
        measured = arrival.measured
        if self.standstill and not self.found_zero(self.standstill, measured.t, message):
            return
        self.answered, self.carried = stamp, 0
        slot = schedule.slot(arrived, arrival, self.controller.parameters.time_limit)
        real_time = not schedule.lockstep
        if real_time:
            self.time_noise = self.controller.parameters.time_noise * schedule.pace
        plan, complaint = self.solve(message, slot)
        period = slot.period if slot.period > 0 else plan.dt
        late = plan.stats.solve_time * schedule.pace > period
        if real_time and self.controller.enabled:
            schedule.wait(slot)
        force = self.follow(plan)
        self.reply = message, self.live.revision, force
        sent_at, latency = self.clocks.steady(), slot.age + schedule.taken(slot)
        if real_time:
            self.send(Wake(schedule.watchdog.feed(slot.period)))
        self.report(stamp, plan, complaint, self.warning(measured), late=late, force=force,
                    age=slot.age, latency=latency, delay=slot.delay, real_time=real_time,
                    time=slot.t, again=slot.again)
        schedule.latency.reports.append(self.clocks.steady() - sent_at)

    def solve(self, message: Any, slot: Slot) -> tuple[Plan, str]:
        """Return the plan for a state, and what is wrong with that."""
        try:
            x = to_state(message, self.live.values['links'], self.sensors)
            plan = self.controller.update(slot.t, x, slot.delay, slot.deadline, self.time_noise)
            complaint = self.controller.belief.rejection
        except ValueError as error:
            plan, complaint = self.controller.fallback(slot.t + slot.delay), str(error)
        if complaint:
            # what fights over the pendulum is not the fault of its sensors
            complaint = '; '.join((*self.rivals, complaint))
            self.log.say(ERROR, f'{complaint}; going on without this state', 'state', 1.0)
        if seldom := self.controller.lookahead.warning:
            self.log.say(WARN, seldom, 'period', math.inf)
        return plan, complaint

    def warning(self, measured: Measured) -> str:
        """Return what is wrong with the stamp of a state, or with the clock."""
        setbacks = self.setbacks.complaint(self.clocks.steady())
        if setbacks:
            self.log.say(WARN, setbacks, 'setbacks', 5.0)
        return '; '.join(filter(None, (measured.complaint, setbacks)))

    def found_zero(self, standstill: Standstill, t: float, message: Any) -> bool:
        """Take a state measured at a time [s]; return whether it tells the sensors' zero."""
        place, words = place_of(standstill, t, message, self.sensors, self.lockstep)
        if place is None:
            self.log.say(WARN, words, 'zero', 5.0)
            self.send(Report(nanoseconds(message.header.stamp), WARN, words, {}, 'zero'))
            return False
        self.sensors, self.standstill = self.sensors.hanging_at(place), None
        self.live.find(joint_offsets=self.sensors.joint_offsets)
        self.log.say(OK, 'the pendulum hangs still; joint_offsets: '
                     f'{list(self.sensors.joint_offsets)}')
        return True

    def on_setback(self) -> None:
        """Take that the clock jumped back."""
        self.setbacks.times.append(self.clocks.steady())

    def on_silence(self) -> None:
        """Follow the last plan without a state that should have come, for a while."""
        self.send(Wake(self.schedule.watchdog.period))
        self.attempt(partial(self.answer_nothing, f'no state came in {self.carried + 1} periods'))

    def answer_nothing(self, complaint: str) -> None:
        """Send a force that answers no state."""
        self.carried += 1
        now, slot = self.clocks.now(), self.schedule.silent_slot()
        plan = self.controller.fallback(slot.t + slot.delay)
        if plan.stats.status in IDLE:
            self.send(Wake(None))
        force = self.follow(plan)
        self.report(now, plan, complaint, '', force=force, delay=slot.delay, latency=0.0,
                    real_time=True, time=slot.t)

    # what is sent

    def follow(self, plan: Plan) -> float:
        """Send the first force [N] of a plan, and return it."""
        if plan.stats.status is Status.STOP:
            self.log.say(ERROR, f'controlled stop: {self.controller.stopping}', 'stop', 10.0)
        force = plan.command(self.controller.nominal.u_max)
        self.command(force)
        return force

    def command(self, force: float) -> None:
        """Send a force [N]."""
        self.send(Force(self.answered, force))
        self.forces += 1

    def report(self, stamp: int, plan: Plan, complaint: str, warning: str, **figures: Any) -> None:
        """Send the plan and the figures of the tick, as TickReport names them."""
        schedule, belief = self.schedule, self.controller.belief
        self.send(Planned(stamp, belief.as_measured(plan)))
        if plan.tries is not None:
            self.send(Tried(stamp, tip_paths(plan.X[0], plan.tries, belief), plan.tries.weights))
        self.send(self.reporter.report(
            stamp, plan, complaint, warning, missed_total=schedule.missed_total,
            time_noise=self.time_noise, carried=self.carried, resets=self.resets,
            revision=self.live.revision, number=self.forces,
            sent=0 if self.carried else schedule.sent,
            clock=schedule.timing.clock.name.lower(), **figures))

    def reset(self) -> tuple[bool, str]:
        """Forget the last plan and restart the random numbers."""
        self.log.reset()   # who begins anew is told anew
        self.restart()
        self.resets += 1
        return True, 'the next tick is a first one'

    def enable(self, enabled: bool) -> tuple[bool, str]:
        """Act again, from a first plan, or let the force go; states are estimated meanwhile."""
        changes, self.reply = self.controller.enable(enabled), None
        self.schedule.is_first = self.schedule.is_first or changes
        if changes:
            self.log.say(WARN, 'enabled' if enabled else 'disabled: the force is zero')
        # in lockstep it would answer the next state, and each answer from then on come too early
        if changes and not enabled and self.forces and not self.lockstep:
            self.answer_nothing('')
        return True, 'enabled: a force for each state' if enabled else 'disabled: zero force'

    def may_end(self) -> bool:
        """Return whether the cart is braked, where it is to be before the end."""
        if not (self.forces and self.controller.enabled):
            return True
        seconds = self.controller.parameters.controlled_stop
        if not seconds:
            return True
        if not math.isfinite(self.ends_by):
            self.ends_by = self.clocks.steady() + seconds + ENDING
            self.controller.stop('the process ends')
        return self.clocks.steady() > self.ends_by

    def close(self) -> None:
        """End the stream of commands with zero."""
        if self.forces:
            self.command(0.0)
