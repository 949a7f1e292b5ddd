# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Delay compensation: the commands that were sent, and what they do to a state until later."""

import math
from typing import NamedTuple

import numpy as np

from dp_swing_ros.control.observer import Belief
from dp_swing_ros.pendulum.drive import follow_commands, HISTORY
from dp_swing_ros.pendulum.model import hold, Model
from dp_swing_ros.pendulum.parameters import Drive
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.pendulum.units import SAME, Units

REMEMBERED = 1.0   # [s] scaled, but no less: delays do not go with the pendulum
LONGEST = 10.0     # [s] of a prediction; more only passes where a clock is set
STEP = 0.01        # [s] scaled, longest of a prediction
RESOLUTION = 1e-6  # [s] of times since 1970, as they are held


class SentVelocity(NamedTuple):
    """
    A velocity that was sent to a drive, which then stays at it.

    It may jump; the drive comes to it no faster than at its largest acceleration.
    """

    t: float         # [s] from when on
    before: float    # [m/s] of the drive then
    velocity: float  # [m/s]
    lasts: float     # [s] in which the drive comes to it, if that is fast enough
    u_max: float     # [m/s²]

    @property
    def acceleration(self) -> float:
        """Return that of the drive while it lasts [m/s²]."""
        return (self._come_to(self.before, self.lasts) - self.before) / self.lasts \
            if self.lasts else 0.0

    @property
    def afterwards(self) -> list[tuple[float, float]]:
        """Return from when on [s] which accelerations [m/s²] follow: what is left, then none."""
        end, left = self.t + self.lasts, self.velocity - self._come_to(self.before, self.lasts)
        rest = [(end, math.copysign(self.u_max, left))] if left else []
        return [*rest, (end + (abs(left) / self.u_max if left else 0.0), 0.0)]

    def at(self, t: float) -> float:
        """Return the velocity of the drive at a time after what it lasts [s], or at its end."""
        return self._come_to(self._come_to(self.before, self.lasts), t - self.t - self.lasts)

    def _come_to(self, before: float, duration: float) -> float:
        change = self.u_max * duration if duration > 0 else 0.0
        return min(max(self.velocity, before - change), before + change)


class SentCommands:
    """
    Remembers from when on each command holds; what was sent later replaces it.

    To a drive of velocities the integral of the commands is sent, which are accelerations.
    """

    def __init__(self, scale: Units = SAME, sent: SentVelocity | None = None) -> None:
        """Begin with none, which is a force of zero, for a pendulum of a scale; or after one."""
        self.scale, self.sent = scale, sent   # the last velocity
        self.stops_at = math.inf   # [s] since when these are zero
        self.step = scale.sized(STEP, 's')
        self.remembered = max(REMEMBERED, scale.sized(REMEMBERED, 's'))   # [s]
        self.times, self.forces = np.empty(0), np.empty(0)   # since when [s], in order; which [N]
        self.before = 0.0   # [N] what came before these

    def add(self, t: float, command: float) -> None:
        """Remember a command [N] that holds from a time on [s]."""
        end = self.times.searchsorted(t)
        old = self.times[:end].searchsorted(t - self.remembered)
        if old > 0:
            self.before = float(self.forces[old - 1])
        self.times = np.concatenate((self.times[old:end], [t]))
        self.forces = np.concatenate((self.forces[old:end], [command]))

    def begin(self, t: float, speed: float) -> None:
        """
        Begin a run with a command that acts at a time [s], by a measured speed of the cart [m/s].

        Where that is not measured (NaN), a drive goes on from the velocity that was sent before.
        """
        if math.isfinite(speed) or self.sent is not None and t < self.sent.t:
            self.sent = None

    def add_velocity(self, sent: SentVelocity) -> None:
        """Remember a velocity that is sent."""
        for t, acceleration in self.afterwards:
            if t < sent.t - RESOLUTION:
                self.add(t, acceleration)
        self.note(sent)
        self.add(sent.t, sent.acceleration)

    def replace_last(self, command: float) -> None:
        """Remember that another command was sent than the last one added [N], or [m/s]."""
        if self.sent is not None:
            self.note(self.sent._replace(velocity=command))
            command = self.sent.acceleration
        self.forces[-1] = command

    def note(self, sent: SentVelocity) -> None:
        """Take the last velocity, and since when it is zero."""
        self.sent = sent
        self.stops_at = math.inf if sent.velocity else min(self.stops_at, sent.t)

    @property
    def afterwards(self) -> list[tuple[float, float]]:
        """Return from when on [s] a drive does what else [N] if nothing more is sent."""
        return [] if self.sent is None else self.sent.afterwards

    def last(self, t: float) -> tuple[float, float]:
        """Return the newest command [N] of those before a time [s], and since when it holds."""
        place = self.times.searchsorted(t) - 1
        return (self.before, t) if place < 0 else (
            float(self.forces[place]), float(self.times[place]))

    def since(self, t: float, history: float) -> tuple[Array, Array]:
        """Return when commands end, after a time [s], and which; see estimator.Commands."""
        times, forces = self.times, self.forces
        for begins, acceleration in self.afterwards:
            times, forces = np.append(times, begins), np.append(forces, acceleration)
        place = times.searchsorted(t - history, side='right')
        before = self.before if place == 0 else forces[place - 1]
        return (np.concatenate((times[place:] - t, [math.inf])),
                np.concatenate(([before], forces[place:])))

    def predict(self, model: Model, drive: Drive, x: Array, t: float,
                until: float) -> tuple[Array, float]:
        """
        Return state and force of the motor [N] at a later time [s]; shapes: x (2n + 2,).

        Where a drive was told to stop, the cart is taken to stand, for it may brake at once.
        """
        if t < self.stops_at:
            return self._follow(model, drive, x, t, until)
        standing = np.where(np.arange(len(x)) == len(x) // 2, 0.0, x)
        return SentCommands(self.scale)._follow(model, drive, standing, t, until)

    def _follow(self, model: Model, drive: Drive, x: Array, t: float,
                until: float) -> tuple[Array, float]:
        x, duration = x.copy(), min(until - t, LONGEST)
        f = follow_commands(model._replace(h=self.step), drive, *self.since(t, HISTORY), x,
                            duration)
        return x, f

    def compensate(self, belief: Belief, acts_at: float) -> Array:
        """
        Return the state from which a command of a time on [s] counts as the force on the cart.

        The drive's delay has passed then, and its lag is one more: a force that follows with a
        time constant has in the end the effect of one that stands still for so long, then jumps.
        Shapes: (2n + 2,), NaN before a first state.
        """
        if np.isnan(belief.x[0]):
            return belief.x
        model, drive = belief.problem.model, belief.drive
        x, f = self._follow(model, drive, belief.x, belief.t, acts_at + drive.delay)
        return hold(model._replace(h=self.step), x, drive.gain * f + drive.bias,
                    drive.time_constant)
