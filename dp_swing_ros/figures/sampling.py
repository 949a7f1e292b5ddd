# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States and forces between the recorded ones."""

import math

import numpy as np

from dp_swing_ros.pendulum.state import Array, between
from dp_swing_ros.simulation.episode import Episode


def states_at(episode: Episode, times: Array) -> Array:
    """
    Return the states between the recorded ones, by cubics.

    Shapes: times (M,) [s] -> (M, 2n + 2); before the first and after the last state these hold.
    """
    t, X = np.asarray(episode.t, dtype=float), episode.X
    if len(t) < 2:
        return np.repeat(X[:1], len(times), axis=0)
    n = np.clip(np.searchsorted(t, times, side='right') - 1, 0, len(t) - 2)
    h = np.maximum(t[n + 1] - t[n], 1e-9)[:, None]
    s = np.clip((times - t[n])[:, None] / h, 0.0, 1.0)
    return between(X[n], X[n + 1], s, h)


def force_at(episode: Episode, t: float) -> float:
    """Return the force [N] that acts from a time [s] on."""
    n = int(np.searchsorted(episode.t, t + 1e-9)) - 1
    return float(episode.U[n]) if 0 <= n < len(episode.U) else 0.0


def times_of(episode: Episode, period: float, until: float = math.inf) -> Array:
    """Return times from the first state to the last, or until a time, a period [s] apart."""
    if not len(episode.t):
        return np.zeros(0)
    length = min(episode.t[-1] - episode.t[0], until)
    return episode.t[0] + period * np.arange(math.floor(length / period + 0.02) + 1)
