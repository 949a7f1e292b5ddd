# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Time contenders against each other: in turn, in one process, medians of many.

What else the machine does meets all contenders alike if they take turns, so ratios of medians are
steadier than the times themselves. Between two turns is a pause, for some threads (OpenMP's, that
torch uses) go on spinning for a while after their work, on a core that the next one needs; and
what is not long is called once before it is timed: the one before took its place in the caches.
"""

from collections.abc import Callable, Mapping
import gc
from importlib.metadata import distributions
import time
from typing import NamedTuple

import numpy as np

from dp_swing_ros.pendulum.state import Array

SHORTEST = 3e-3     # [s] of a sample; what is faster is repeated within it
PAUSE = 0.01        # [s] before each sample
LONG = 0.2          # [s] what takes longer does without the call before its sample
RESAMPLES = 2000    # of the bootstrap
CONFIDENCE = 0.95

Work = Callable[[], int]   # does something, and returns how many units (iterations, ...) it did


class Missing(Exception):
    """What is not measured; the message says why."""


class Interval(NamedTuple):
    """A number and its 95 % interval."""

    value: float
    low: float
    high: float


def has(distribution: str) -> bool:
    """Return whether a peer is installed."""
    return any(distributions(name=distribution))


def race(contenders: Mapping[str, Work], rounds: int) -> dict[str, Array]:
    """
    Let each contender work once a round, and return its times [s] per unit of work.

    The first call of each, which may compile, is not timed; another tells how often to repeat what
    is short. The order is another in each round. Raises RuntimeError where one gave up. Shapes:
    -> (rounds,) each.
    """
    alone = {}
    for name, work in contenders.items():
        work()
        began = time.perf_counter()
        work()
        alone[name] = time.perf_counter() - began
    times: dict[str, list[float]] = {name: [] for name in contenders}
    names, random = list(contenders), np.random.default_rng(0)
    gc.collect()
    gc.disable()    # a collection would be charged to whoever is running
    try:
        for _ in range(rounds):
            for name in random.permutation(names):
                times[name].append(_sample(contenders[name], alone[name]))
            gc.collect(0)
    finally:
        gc.enable()
    return {name: np.array(of_name) for name, of_name in times.items()}


def _sample(work: Work, alone: float) -> float:
    time.sleep(PAUSE)
    if alone < LONG:
        work()
    began, units = time.perf_counter(), 0
    for _ in range(int(np.clip(SHORTEST / alone, 1, 1000))):
        units += (done := work())
        if done <= 0:
            raise RuntimeError('a contender gave up')
    return (time.perf_counter() - began) / units


def median(times: Array) -> Interval:
    """Return the median of times, with the interval of the bootstrap."""
    drawn = np.median(times[_resamples(len(times))], axis=1)
    return Interval(float(np.median(times)), *_interval(drawn))


def ratio(slower: Array, faster: Array) -> Interval:
    """
    Return the ratio of two medians, with the interval of the bootstrap.

    Rounds are drawn as pairs, so that what slowed both down widens nothing. Shapes: (rounds,).
    """
    rounds = _resamples(len(slower))
    drawn = np.median(slower[rounds], axis=1) / np.median(faster[rounds], axis=1)
    return Interval(float(np.median(slower) / np.median(faster)), *_interval(drawn))


def _resamples(rounds: int) -> Array:
    return np.random.default_rng(0).integers(rounds, size=(RESAMPLES, rounds))


def _interval(drawn: Array) -> tuple[float, float]:
    low, high = np.quantile(drawn, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    return float(low), float(high)
