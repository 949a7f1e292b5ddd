# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Delay compensation: the commands that were sent, and what they do to a state until later."""

from typing import Literal

import numpy as np

from dp_swing_ros.pendulum.drive import follow_commands, HISTORY
from dp_swing_ros.pendulum.model import Model
from dp_swing_ros.pendulum.parameters import Drive
from dp_swing_ros.pendulum.state import Array

REMEMBERED = 1.0   # [s]
STEP = 0.01        # [s] longest of a prediction
ROOM = 1024        # commands


class SentForces:
    """Remembers from when on each command holds; what was sent later replaces it."""

    def __init__(self) -> None:
        """Begin with none, which is a force of zero."""
        # those remembered are between the two places; the rest is room
        self.begins, self.commands = np.empty(ROOM), np.empty(ROOM)
        self.first = self.end = 0
        self.before = 0.0   # [N] what came before these

    def add(self, begins: float, command: float) -> None:
        """Remember a command [N] that holds from a time on [s]."""
        while self.end > self.first and self.begins[self.end - 1] >= begins:
            self.end -= 1
        if self.end == len(self.begins):
            self._make_room()
        self.begins[self.end], self.commands[self.end] = begins, command
        self.end += 1
        while self.begins[self.first] < begins - REMEMBERED:
            self.before = float(self.commands[self.first])
            self.first += 1

    def _make_room(self) -> None:
        kept = slice(self.first, self.end)
        for name in ('begins', 'commands'):
            values = getattr(self, name)[kept]
            setattr(self, name, np.append(values, np.empty(max(ROOM, len(values)))))
        self.first, self.end = 0, self.end - self.first

    def replace_last(self, command: float) -> None:
        """Remember that another command [N] was sent than the last one added."""
        self.commands[self.end - 1] = command

    def last(self, t: float) -> tuple[float, float]:
        """Return the newest command [N] of those before a time [s], and since when it holds."""
        place = self._place(t, 'left') - 1
        return (self.before, t) if place < self.first else (
            float(self.commands[place]), float(self.begins[place]))

    def since(self, t: float, history: float) -> tuple[Array, Array]:
        """Return when commands end, after a time [s], and which; see estimator.Commands."""
        place = self._place(t - history, 'right')
        later = slice(place, self.end)
        before = self.before if place == self.first else self.commands[place - 1]
        return (np.append(self.begins[later] - t, np.inf),
                np.append(before, self.commands[later]))

    def _place(self, t: float, side: Literal['left', 'right']) -> int:
        """Return where a time [s] belongs."""
        return self.first + int(np.searchsorted(self.begins[self.first:self.end], t, side))

    def predict(self, model: Model, drive: Drive, x: Array, t: float,
                until: float) -> tuple[Array, float]:
        """Return state and force of the motor [N] at a later time [s]; shapes: x (2n + 2,)."""
        x = x.copy()
        f = follow_commands(model._replace(h=STEP), drive, *self.since(t, HISTORY), x,
                            until - t)
        return x, f
