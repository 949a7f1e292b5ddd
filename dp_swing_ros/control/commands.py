# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Delay compensation: the commands that were sent, and what they do to a state until later."""

import math

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


class SentCommands:
    """
    Remembers from when on each command holds; what was sent later replaces it.

    To a drive of velocities the integral of the commands is sent, which are accelerations. What
    is sent may jump; the drive comes to it no faster than at its largest acceleration.
    """

    def __init__(self, scale: Units = SAME) -> None:
        """Begin with none, which is a force of zero, for a pendulum of a scale."""
        self.velocity = math.nan   # [m/s] to which the drive comes by the last one
        self.before_last = math.nan, 0.0, 0.0   # the same before; how long it lasts [s]; change
        self.step = scale.sized(STEP, 's')
        self.remembered = max(REMEMBERED, scale.sized(REMEMBERED, 's'))   # [s]
        self.times, self.forces = np.empty(0), np.empty(0)   # since when [s], in order; which [N]
        self.before = 0.0   # [N] what came before these

    def add(self, t: float, command: float) -> None:
        """Remember a command [N] that holds from a time on [s]."""
        end = np.searchsorted(self.times, t)
        old = np.searchsorted(self.times[:end], t - self.remembered)
        if old > 0:
            self.before = float(self.forces[old - 1])
        self.times = np.append(self.times[old:end], t)
        self.forces = np.append(self.forces[old:end], command)

    def add_velocity(self, t: float, velocity: float, lasts: float, change: float) -> None:
        """
        Remember a velocity [m/s] that is sent at a time [s].

        It lasts so long [s], in which the drive changes its own by so much at most [m/s].
        """
        self.before_last = self.velocity, lasts, change
        self.add(t, 0.0)
        self.replace_last(velocity)

    def replace_last(self, command: float) -> None:
        """Remember that another command was sent than the last one added [N], or [m/s]."""
        before, lasts, change = self.before_last
        if math.isnan(before):
            self.forces[-1] = command
            return
        self.velocity = min(max(command, before - change), before + change)
        self.forces[-1] = (self.velocity - before) / lasts if lasts else 0.0

    def last(self, t: float) -> tuple[float, float]:
        """Return the newest command [N] of those before a time [s], and since when it holds."""
        place = np.searchsorted(self.times, t) - 1
        return (self.before, t) if place < 0 else (
            float(self.forces[place]), float(self.times[place]))

    def since(self, t: float, history: float) -> tuple[Array, Array]:
        """Return when commands end, after a time [s], and which; see estimator.Commands."""
        place = np.searchsorted(self.times, t - history, side='right')
        before = self.before if place == 0 else self.forces[place - 1]
        return (np.append(self.times[place:] - t, np.inf),
                np.append(before, self.forces[place:]))

    def predict(self, model: Model, drive: Drive, x: Array, t: float,
                until: float) -> tuple[Array, float]:
        """Return state and force of the motor [N] at a later time [s]; shapes: x (2n + 2,)."""
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
        x, f = self.predict(model, drive, belief.x, belief.t, acts_at + drive.delay)
        return hold(model._replace(h=self.step), x, drive.gain * f + drive.bias,
                    drive.time_constant)
