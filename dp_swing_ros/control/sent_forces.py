# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Delay compensation: the commands that were sent, and what they do to a state until later."""

from collections import deque

import numpy as np

from dp_swing_ros.pendulum.drive import follow_commands, HISTORY
from dp_swing_ros.pendulum.model import Model
from dp_swing_ros.pendulum.parameters import Drive
from dp_swing_ros.pendulum.state import Array

REMEMBERED = 1.0   # [s]
STEP = 0.01        # [s] longest of a prediction


class SentForces:
    """Remembers from when on each command holds; what was sent later replaces it."""

    def __init__(self) -> None:
        """Begin with none, which is a force of zero."""
        self.sent: deque[tuple[float, float]] = deque()  # (from when, command)
        self.before = 0.0   # [N] what came before these

    def add(self, begins: float, command: float) -> None:
        """Remember a command [N] that holds from a time on [s]."""
        while self.sent and self.sent[-1][0] >= begins:
            self.sent.pop()
        self.sent.append((begins, command))
        while self.sent[0][0] < begins - REMEMBERED:
            self.before = self.sent.popleft()[1]

    def replace_last(self, command: float) -> None:
        """Remember that another command [N] was sent than the last one added."""
        self.sent[-1] = (self.sent[-1][0], command)

    def last(self, t: float) -> tuple[float, float]:
        """Return the newest command [N] of those before a time [s], and since when it holds."""
        for begins, command in reversed(self.sent):
            if begins < t:
                return command, begins
        return self.before, t

    def since(self, t: float, history: float) -> tuple[Array, Array]:
        """Return when commands end, after a time [s], and which; see estimator.Commands."""
        before, later = self.before, []
        for begins, command in self.sent:
            if begins <= t - history:
                before = command
            else:
                later.append((begins - t, command))
        return (np.array([*(begins for begins, _ in later), np.inf]),
                np.array([before, *(command for _, command in later)]))

    def predict(self, model: Model, drive: Drive, x: Array, t: float,
                until: float) -> tuple[Array, float]:
        """Return state and force of the motor [N] at a later time [s]; shapes: x (2n + 2,)."""
        x = x.copy()
        f = follow_commands(model._replace(h=STEP), drive, *self.since(t, HISTORY), x,
                            until - t)
        return x, f
