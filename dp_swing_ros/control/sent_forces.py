# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Delay compensation: the forces that were sent, and what they do to a state until later."""

from collections import deque
from itertools import chain

from dp_swing_ros.estimators.estimator import Force
from dp_swing_ros.pendulum.model import hold, Model
from dp_swing_ros.pendulum.state import Array

REMEMBERED = 64    # forces
RESOLUTION = 1e-6  # [s] of times since 1970, as they are held


class SentForces:
    """Remembers from when on each force acts; what was sent later replaces it."""

    def __init__(self) -> None:
        """Begin with none, which is a force of zero."""
        self.sent: deque[tuple[float, float]] = deque(maxlen=REMEMBERED)  # (from when, force)

    def add(self, begins: float, force: float) -> None:
        """Remember a force [N] that acts from a time on [s]."""
        self.sent.append((begins, force))

    def replace_last(self, force: float) -> None:
        """Remember that another force [N] was sent than the last one added."""
        self.sent[-1] = (self.sent[-1][0], force)

    def between(self, t: float, until: float) -> list[Force]:
        """Return the forces that act between two times [s]; before the first sent it is zero."""
        forces: list[Force] = []
        for begins, u in chain(reversed(self.sent), [(t, 0.0)]):
            if until - t <= RESOLUTION:
                break
            begins = max(begins, t)
            if until - begins > RESOLUTION:
                forces.insert(0, Force(u, until - begins))
                until = begins
        return forces

    def predict(self, model: Model, x: Array, t: float, until: float) -> Array:
        """Return the state at a later time [s] from the one at t; shapes: x (2n + 2,)."""
        for force in self.between(t, until):
            x = hold(model, x, force.u, force.duration)
        return x
