# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the plant does with what comes, and when: the node without ROS, by any clock."""

from collections.abc import Set
from dataclasses import dataclass, replace
from enum import Enum
import math
from typing import NamedTuple

import numpy as np

from dp_swing_ros.messages.configuration import BEFORE
from dp_swing_ros.messages.fields import BILLION, diagnostic, ERROR, OK, Report, WARN
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.pendulum.urdf import urdf
from dp_swing_ros.runtime.pace import Answer, Pace
from dp_swing_ros.runtime.stopwatch import Stopwatch
from dp_swing_ros.simulation.plant import Plant, STOPPABLE
from dp_swing_ros.simulation.stepper import Stepper

REPORT_PERIOD = 1.0  # [s] between two diagnostics
DISCOVERY = 300_000_000   # [ns] until who sends forces hears states: one way comes first
ROUNDING = 1e-9      # [s]
REAL_TIME = Answer(False, f'real time cannot be stopped; {STOPPABLE}')


class State(NamedTuple):
    """A state as it was measured, and the mean force [N] of the period before it is sent."""

    stamp: int   # [ns]
    x: Array     # (2n + 2,)
    force: float


class Announcement(NamedTuple):
    """That its parameters are those of a revision."""

    revision: int = 0   # how often they have changed
    since: int = 0      # [ns] from when on these count
    resets: int = 0     # until then


class Description(NamedTuple):
    """The pendulum, as URDF."""

    text: str


class Trouble(Enum):
    """What is warned of."""

    JUMP = 'the clock was set'
    SILENCE = 'no command came for too long'
    FORCE = 'a force is none'
    PUSH = 'a push is too strong'


class Warned(NamedTuple):
    """A warning."""

    of: Trouble
    text: str


Sent = list[State | Report | Announcement | Description | Warned]


@dataclass
class PlantReport:
    """What a plant reports, by its keys in /diagnostics; it counts from its start on."""

    time: float = diagnostic('since the start, or the last reset', 's', default=0.0)
    push: float = diagnostic('through the period that begins', 'N', default=0.0)
    commands: int = diagnostic('forces that came', default=0)
    refused: int = diagnostic('that were no finite numbers', default=0)
    refused_disturbances: int = diagnostic('beyond `disturbance_limit`', default=0)
    skipped_ticks: int = diagnostic('periods without a state, for the tick before was late',
                                    default=0)
    lost_commands: int = diagnostic('as the parameters ask for', default=0)
    lost_states: int = diagnostic('as the parameters ask for', default=0)
    paused: bool = diagnostic('between two periods, in lockstep', default=False)


class PlantCore:
    """
    A plant in real time, where nobody waits for anybody, or in lockstep: one force a state.

    In lockstep the stamps are simulated time, from zero; where a state is lost, or the first has
    not arrived yet, nobody can answer, so the last command acts for another period. Now is always
    the time [ns] of the clock that real time goes by, and in lockstep of a steady one. All that
    happens returns what is to be sent for it.
    """

    def __init__(self, plant: Plant) -> None:
        """Take the plant, which stands still until `begin`."""
        self.stepper, self.pace = Stepper(plant), Pace()
        self.lockstep = plant.parameters.lockstep
        self.counts, self.refusals = PlantReport(), 0   # and those that were reported
        self.configured = Announcement()
        self.begun = self.done = False
        self.push = 0.0                     # [N] asked for the next period
        self.force: float | None = None     # [N] that answers the last state; None: nobody can
        self.waiting = False                # for it
        self.outdated = False               # the next force is: it answers a state from before
        self.sent_at = 0                    # [ns] the last state
        self.listeners = dict[bytes, int]()   # to it in lockstep, and since when [ns]

    @property
    def plant(self) -> Plant:
        """Return the plant."""
        return self.stepper.plant

    def description(self) -> Description:
        """Return what the plant looks like."""
        return Description(urdf(self.plant.physical, self.plant.limits))

    def begin(self, now: int, epoch: int) -> Sent:
        """Let time begin, in real time at a time of day [ns], and send the first state."""
        self.watch = Stopwatch(now)
        self.epoch = 0 if self.lockstep else epoch
        self.reported = -math.inf   # [s]
        self.begun = True
        return self.begin_period(now)

    def reset(self, now: int, epoch: int) -> Sent:
        """Go back to the initial state; in lockstep, to time zero too."""
        self.plant.reset()
        self.push = 0.0   # was asked for a period that does not come
        self.configured = self.configured._replace(resets=self.configured.resets + 1)
        # before the state, so that no plan from before is followed from there
        sent: Sent = [self.configured]
        if self.begun:
            self.outdated = self.lockstep and self.waiting and not self.pace.ready
            sent += self.begin(now, epoch)
        return sent

    def change(self, other: Plant, now: int) -> Sent:
        """Go on with the parameters of another plant from now on."""
        sent = self.advance(now) if self.begun and not self.lockstep else []
        before = self.plant.physical, self.plant.limits
        if self.begun:
            self.plant.reconfigure(other)
        else:
            self.stepper.plant = other
        if before != (self.plant.physical, self.plant.limits):
            sent.append(self.description())
        self.pace.change(now, self.lasts)
        since = round(self.plant.t * BILLION) if self.begun else BEFORE
        self.configured = self.configured._replace(
            revision=self.configured.revision + 1, since=since)
        return [*sent, self.configured]

    @property
    def lasts(self) -> int:
        """Return for how long at least [ns] a period lasts in lockstep."""
        pace = self.plant.parameters.pace
        return round(self.stepper.period / pace * BILLION) if pace else 0

    def wait(self, now: int) -> int | None:
        """
        Return in how long [ns] the next tick is due.

        None: not before something comes, or in real time once in a period.
        """
        return self.pace.wait(now) if self.lockstep and not self.done else None

    def tick(self, now: int) -> Sent:
        """Let a period end: in real time now, in lockstep if its force is there and it is due."""
        if self.lockstep:
            if self.wait(now) != 0:
                return []
            self.counts.lost_commands += not self.stepper.finish(self.force)
            return self.begin_period(now)
        sent = self.advance(now)
        passed = self.plant.t - self.plant.period_began
        # a tick that came late is not made up for
        self.counts.skipped_ticks += max(round(passed / self.stepper.period) - 1, 0)
        return [*sent, *self.begin_period(now)]

    def on_force(self, force: float, now: int) -> Sent:
        """Obey a force [N] from now on; in lockstep, for one period."""
        if not math.isfinite(force):
            self.counts.refused += 1
            return [Warned(Trouble.FORCE,
                           f'refused a force of {force}; expected a finite number [N]')]
        self.counts.commands += 1
        if not self.begun:
            return []
        if not self.lockstep:
            sent = self.advance(now)
            self.counts.lost_commands += not self.plant.obey(
                force, self.plant.parameters.command_timeout)
            return sent
        if self.outdated:   # who sent it has overlooked the state since, as if he had joined now
            self.outdated, self.listeners = False, dict.fromkeys(self.listeners, now)
        elif self.waiting:
            self.force, self.pace.ready = force, True
        return self.tick(now)

    def on_push(self, push: float) -> Sent:
        """Push the cart [N] through the whole of the next period, if not beyond all bounds."""
        whole, limit = self.push + push, self.plant.parameters.disturbance_limit
        if abs(whole) <= limit:   # which no NaN is
            self.push = whole
            return []
        self.counts.refused_disturbances += 1
        return [Warned(Trouble.PUSH, (
            f'refused a disturbance of {push:g} N: those of this period would be {whole:g} N; '
            f'expected {limit:g} N at most (disturbance_limit)'))]

    def on_listeners(self, listeners: Set[bytes], now: int) -> Sent:
        """Send a state again that a controller in lockstep joined after, or overlooked."""
        self.listeners = {each: self.listeners.get(each, now) for each in listeners}
        if self.waiting and any(self.sent_at < since < now - DISCOVERY
                                for since in self.listeners.values()):
            self.sent_at = now
            return [self.state]
        return []

    def pause(self, paused: bool, now: int) -> tuple[Answer, Sent]:
        """Stop between two periods, or go on."""
        if not self.lockstep:
            return REAL_TIME, []
        answer, sent = self.pace.pause(paused), self.tick(now)
        return answer, [*sent, self.report()] if self.begun else sent

    def step(self, now: int) -> tuple[Answer, Sent]:
        """Let one period pass."""
        return (self.pace.step(), self.tick(now)) if self.lockstep else (REAL_TIME, [])

    def advance(self, now: int) -> Sent:
        """Integrate up to now; warn where the clock was set, or no command is left to obey."""
        sent: Sent = []
        jumped, expired = self.watch.jumped, self.plant.commands.expired
        self.plant.advance(self.watch.elapsed(now) - self.plant.t)
        if self.watch.jumped != jumped:
            sent.append(Warned(Trouble.JUMP, (
                f'the clock jumped by {(self.watch.jumped - jumped) / BILLION:+.6g} s; the '
                'pendulum goes on from where it was')))
        if self.plant.commands.expired and not expired:
            sent.append(Warned(Trouble.SILENCE, (
                f'no force for {self.plant.parameters.command_timeout:g} s; '
                'the force is zero until the next')))
        return sent

    def begin_period(self, now: int) -> Sent:
        """Send the measured state and the mean force of the period that ends, and go on."""
        sent: Sent = []
        push, self.push = self.push, 0.0
        measured, duration = self.stepper.begin(push), self.plant.parameters.duration
        if measured is None:
            self.counts.lost_states += self.plant.is_seen()
        else:
            self.state = State(self.stamp(measured.t), measured.x, measured.force)
            self.sent_at = now
            sent.append(self.state)
        if push or self.plant.t - self.reported >= REPORT_PERIOD:
            sent.append(self.report(push))
        if duration and self.plant.t >= duration - ROUNDING:
            self.done = True
        self.waiting = measured is not None
        self.pace.begin(now, self.lasts)
        if measured is None:
            self.force, self.pace.ready = None, True
        return sent

    def stamp(self, t: float) -> int:
        """Return a time of the plant [s] as it is sent [ns]."""
        return self.epoch + self.watch.jumped + round(t * BILLION)

    def report(self, push: float = 0.0) -> Report:
        """Return what the plant counts, and the push through the period that begins [N]."""
        level, message = self.verdict()
        self.reported, self.refusals = self.plant.t, self.refused()
        return Report(self.stamp(self.plant.t), level, message, vars(replace(
            self.counts, time=self.plant.t, push=push, paused=self.pace.paused)))

    def refused(self) -> int:
        """Return how many forces and disturbances were refused."""
        return self.counts.refused + self.counts.refused_disturbances

    def verdict(self) -> tuple[int, str]:
        """Return the level of a report, and why."""
        if not np.all(np.isfinite(self.plant.x)):
            return ERROR, 'the state is not finite; call plant/reset'
        if self.plant.commands.expired:
            return WARN, 'no force arrives; it is zero'
        if self.refused() > self.refusals:
            return WARN, 'refused a force or a disturbance'
        return OK, 'paused' if self.pace.paused else 'obeys the force'
