# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Many runs of one experiment: what lies between them, state by state and figure by figure."""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import NamedTuple

import numpy as np

from dp_swing_ros.evaluation.comparison import Rate, rate
from dp_swing_ros.evaluation.metrics import last_stay, measure, Metrics
from dp_swing_ros.pendulum.state import angles, Array, is_upright, links_of, to_turn_of, upright
from dp_swing_ros.simulation.episode import Episode

SHARES = (0.1, 0.5, 0.9)
NEAR = 0.5      # [rad] of all angles: up, though not held still
FIRST = 5.0     # [s] that runs of any length have, to compare their forces


class Band(NamedTuple):
    """The 10 %, the 50 % and the 90 % quantile over runs, each a run's own value."""

    low: Array
    median: Array
    high: Array


class Trial(NamedTuple):
    """
    One of the runs.

    Shapes: error (N, 2n + 2), the squared distance of the states from upright.
    """

    error: Array
    metrics: Metrics
    reached: float    # [s] when it was upright first, NaN if never
    neared: float     # [s] when all angles came within NEAR to stay, as last_stay has it
    roughness: float  # [N] standard deviation of the force steps until FIRST
    end: float        # [m] distance of the cart from the centre at the end


@dataclass(frozen=True)
class Ensemble:
    """
    Runs of one experiment over several seeds, and one of them whole.

    Shapes: t (N,) [s]; error of (N, 2n + 2), angle of (N,), the largest [rad].
    """

    shown: Episode
    trials: Sequence[Trial]
    error: Band
    angle: Band

    @property
    def held(self) -> Rate:
        """Count the runs that were upright to the end."""
        return rate([trial.metrics.success for trial in self.trials])


def trial(episode: Episode) -> Trial:
    """Return of a run what its ensemble needs."""
    X, t = to_turn_of(episode.X, upright(links_of(episode.X))), episode.t
    up = np.flatnonzero(is_upright(X))
    near = np.all(np.abs(X[:, angles(X)]) <= NEAR, axis=1)
    return Trial(X ** 2, measure(episode), float(t[up[0]]) if up.size else math.nan,
                 last_stay(t, near), float(np.std(np.diff(episode.U[t[:-1] < FIRST - 1e-9]))),
                 float(np.abs(X[-1, 0])))


def ensemble(shown: Episode, trials: Sequence[Trial]) -> Ensemble:
    """Put the runs of as many seeds beside one of them."""
    errors = np.stack([one.error for one in trials])
    largest = np.sqrt(errors[..., angles(errors)].max(axis=-1))
    return Ensemble(shown, trials, band(errors), band(largest))


def band(values: Array) -> Band:
    """Return the quantiles over the first axis; what is not known counts as beyond all."""
    known = np.where(np.isnan(values), np.inf, values)
    return Band(*np.quantile(known, SHARES, axis=0, method='nearest'))
