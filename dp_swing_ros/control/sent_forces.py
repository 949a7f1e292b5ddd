# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Delay compensation: the commands that were sent, and what they do to a state until later."""

import numpy as np

from dp_swing_ros.pendulum.drive import follow_commands, HISTORY
from dp_swing_ros.pendulum.model import Model
from dp_swing_ros.pendulum.parameters import Drive
from dp_swing_ros.pendulum.state import Array

REMEMBERED = 1.0   # [s]
LONGEST = 10.0     # [s] of a prediction; more only passes where a clock is set
STEP = 0.01        # [s] longest of a prediction


class SentForces:
    """Remembers from when on each command holds; what was sent later replaces it."""

    def __init__(self) -> None:
        """Begin with none, which is a force of zero."""
        self.begins, self.commands = np.empty(0), np.empty(0)   # in the order of time
        self.before = 0.0   # [N] what came before these

    def add(self, begins: float, command: float) -> None:
        """Remember a command [N] that holds from a time on [s]."""
        end = np.searchsorted(self.begins, begins)
        old = np.searchsorted(self.begins[:end], begins - REMEMBERED)
        if old > 0:
            self.before = float(self.commands[old - 1])
        self.begins = np.append(self.begins[old:end], begins)
        self.commands = np.append(self.commands[old:end], command)

    def replace_last(self, command: float) -> None:
        """Remember that another command [N] was sent than the last one added."""
        self.commands[-1] = command

    def last(self, t: float) -> tuple[float, float]:
        """Return the newest command [N] of those before a time [s], and since when it holds."""
        place = np.searchsorted(self.begins, t) - 1
        return (self.before, t) if place < 0 else (
            float(self.commands[place]), float(self.begins[place]))

    def since(self, t: float, history: float) -> tuple[Array, Array]:
        """Return when commands end, after a time [s], and which; see estimator.Commands."""
        place = np.searchsorted(self.begins, t - history, side='right')
        before = self.before if place == 0 else self.commands[place - 1]
        return (np.append(self.begins[place:] - t, np.inf),
                np.append(before, self.commands[place:]))

    def predict(self, model: Model, drive: Drive, x: Array, t: float,
                until: float) -> tuple[Array, float]:
        """Return state and force of the motor [N] at a later time [s]; shapes: x (2n + 2,)."""
        x, duration = x.copy(), min(until - t, LONGEST)
        f = follow_commands(model._replace(h=STEP), drive, *self.since(t, HISTORY), x,
                            duration)
        return x, f
