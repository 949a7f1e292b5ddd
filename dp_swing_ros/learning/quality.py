# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How good dynamics are: what they predict of other experience."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from dp_swing_ros.learning.experience import Experience
from dp_swing_ros.learning.regression import followed, LONGEST_STEP, predicted
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


def errors(dynamics: Any, stretches: Sequence[Experience], step: float = LONGEST_STEP) -> Errors:
    """Return what dynamics, in steps [s], miss of some stretches of experience."""
    seen = Experience.joined(stretches)
    return Errors(np.sqrt(np.mean(misses(dynamics, seen, step) ** 2, axis=0)),
                  np.concatenate([ahead(dynamics, each, step) for each in stretches]))


def misses(dynamics: Any, seen: Experience, step: float = LONGEST_STEP) -> Array:
    """Return by how much the speeds after each transition are off (K, n + 1)."""
    return np.hsplit(seen.Y, 2)[1] - predicted(dynamics, seen, step)


def ahead(dynamics: Any, stretch: Experience, step: float) -> Array:
    """Return the errors AHEAD transitions after each state [rad]."""
    found = deviation(followed(dynamics, stretch, AHEAD, step), stretch.Y[AHEAD - 1:])
    return np.where(np.isfinite(found), found, np.pi)


def rms(dynamics: Any, seen: Experience, step: float = LONGEST_STEP) -> float:
    """Return the RMS of the errors of all speeds after one transition [m/s, rad/s]."""
    return float(np.sqrt(np.mean(misses(dynamics, seen, step) ** 2)))
