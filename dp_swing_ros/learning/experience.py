# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Experience: from each state, under a force, to the next."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dp_swing_ros.pendulum.state import angles, Array, to_turn_of
from dp_swing_ros.pendulum.units import STATES, Units


class Experience(NamedTuple):
    """
    Transitions, in the order in which they were made.

    Shapes: X and Y (K, 2n + 2) the states before and after, on one turn; U (K,) [N] the mean
    force meanwhile; h (K,) [s] how long it took.
    """

    X: Array
    Y: Array
    U: Array
    h: Array

    @classmethod
    def of_run(cls, t: Array, X: Array, U: Array) -> 'Experience':
        """Take a run; shapes: t (K + 1,) [s], X (K + 1, 2n + 2), U (K,) [N]."""
        Y = np.array([to_turn_of(after, before) for before, after in zip(X, X[1:])])
        return cls(X[:-1], Y.reshape(-1, X.shape[1]), U, np.diff(t))

    @classmethod
    def joined(cls, parts: 'Sequence[Experience]') -> 'Experience':
        """Return the transitions of several, one after the other."""
        return cls(*map(np.concatenate, zip(*parts)))

    def chosen(self, which: Array) -> 'Experience':
        """Return some of the transitions; shapes: which (K,)."""
        return Experience(*(each[which] for each in self))

    def sized(self, scale: Units) -> 'Experience':
        """Return the same of a pendulum so many times larger."""
        factors = scale.factors(STATES, self.X.shape[1])
        return Experience(self.X * factors, self.Y * factors, self.U * scale.factor('N'),
                          self.h * scale.time)

    @property
    def duration(self) -> float:
        """Return how long all took [s]."""
        return float(self.h.sum())

    @property
    def variables(self) -> Array:
        """Return what accelerations depend on: θ, θ̇, u and ẋ; (K, 2n + 2)."""
        n = self.X.shape[1] // 2 - 1
        return np.column_stack((self.X[:, angles(self.X[0])], self.X[:, n + 2:], self.U,
                                self.X[:, n + 1]))
