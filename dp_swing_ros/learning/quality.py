# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How good dynamics are: what they predict of other experience, and how sure their slopes are."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from dp_swing_ros.dynamics.files import LearnedModel
from dp_swing_ros.learning.experience import Experience
from dp_swing_ros.learning.regression import followed, LONGEST_STEP, predicted
from dp_swing_ros.pendulum.derivatives import linearisation
from dp_swing_ros.pendulum.integrators import INTEGRATORS
from dp_swing_ros.pendulum.model import Model
from dp_swing_ros.pendulum.state import Array, deviation

AHEAD = 30   # transitions: about the horizon of a plan


class Errors(NamedTuple):
    """
    What is off in predictions, each from a measured state.

    Shapes: speeds (n + 1,) [m/s, rad/s] RMS after one transition; ahead (M,) [rad] the largest
    error of an angle AHEAD transitions later, half a turn where nothing finite is predicted.
    """

    speeds: Array
    ahead: Array

    @property
    def as_figures(self) -> dict[str, Any]:
        """Return them for a file; what is ahead by median and 95th percentile, if there is any."""
        found: dict[str, Any] = {'speeds': self.speeds.tolist()}
        if len(self.ahead):
            found |= {name: float(value) for name, value in zip(
                ('ahead_median', 'ahead_p95'), np.quantile(self.ahead, (0.5, 0.95)))}
        return found


def errors(dynamics: Any, stretches: Sequence[Experience]) -> Errors:
    """Return what dynamics miss of some stretches of experience."""
    seen = Experience.joined(stretches)
    return Errors(np.sqrt(np.mean(misses(dynamics, seen) ** 2, axis=0)),
                  np.concatenate([ahead(dynamics, each) for each in stretches]))


def misses(dynamics: Any, seen: Experience) -> Array:
    """Return by how much the speeds after each transition are off (K, n + 1)."""
    return np.hsplit(seen.Y, 2)[1] - predicted(dynamics, seen)


def ahead(dynamics: Any, stretch: Experience) -> Array:
    """Return the errors AHEAD transitions after each state [rad]."""
    found = deviation(followed(dynamics, stretch, AHEAD), stretch.Y[AHEAD - 1:])
    return np.where(np.isfinite(found), found, np.pi)


def rms(dynamics: Any, seen: Experience) -> float:
    """Return the RMS of the errors of all speeds after one transition [m/s, rad/s]."""
    return float(np.sqrt(np.mean(misses(dynamics, seen) ** 2)))


def disagreement(model: LearnedModel, X: Array, U: Array) -> Array:
    """
    Return how far the members of a model disagree on the slopes of a step, as a share of them.

    Zero is full agreement; at one, slopes may have any sign. Shapes: X (K, 2n + 2), U (K,) [N]
    -> (K,).
    """
    def slopes(dynamics: Any, x: Array, u: float) -> Array:
        A, B = linearisation(Model(dynamics, INTEGRATORS['rk4'], LONGEST_STEP), x, u)
        half = len(x) // 2   # the rest is the same for all
        return np.column_stack((A - np.eye(len(x)), B))[half:]
    found = []
    for x, u in zip(X, U):
        own = slopes(model.dynamics, x, u)
        others = np.array([slopes(member, x, u) for member in model.members])
        found.append(np.sqrt(np.mean(np.sum((others - own) ** 2, axis=(1, 2)))
                             / np.sum(own ** 2)))
    return np.array(found)
