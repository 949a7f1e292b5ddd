# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What a soak measured, plant and mpc in real time beside a bare echo, and the figures of it.

Latencies are from the publication of a state to that of its answer, by the clock of both
publishers: how long whoever watches them takes to hear of it does not count.
"""

from collections.abc import Mapping
from dataclasses import dataclass
import math
from typing import Any, NamedTuple

import numpy as np

from dp_swing_ros.evaluation.metrics import quantile, WITHOUT_SOLVE
from dp_swing_ros.pendulum.state import Array

QUANTILES = {'p50': 0.5, 'p99': 0.99, 'p99.9': 0.999, 'max': 1.0}
ALLOWED = 1e-3      # [s] beyond what the echo and a solve take, for the mpc around a solve
OUT = 0.2           # [rad] of the largest error of an angle: no longer held
FALLEN = math.pi / 2
HOLD = 1.0          # [s] within OUT: swung up
WARM, FIRST, LAST = 60.0, 10.0, 0.1   # [s], [s] after that, share of the run at its end
SHORTEST = (WARM + FIRST) / (1 - LAST)   # [s] of a run that tells how memory grows


class Forces(NamedTuple):
    """How many there were, and how many of them must not have been."""

    total: int
    not_finite: int
    beyond_limit: int
    largest: float   # [N]


class Usage(NamedTuple):
    """
    What a process took of the machine.

    Shapes: t (K,) [s] from the first state, resident and private memory (K,) [bytes], processor
    time (K,) [s].
    """

    t: Array
    resident: Array
    private: Array
    processor: Array

    @property
    def share(self) -> float:
        """Return the processor time in a second, NaN where it was seen but once."""
        passed = np.ptp(self.t) if len(self.t) else 0.0
        return float(np.ptp(self.processor) / passed) if passed > 0 else math.nan

    @property
    def growth(self) -> float:
        """
        Return by how much the resident memory grew [bytes], NaN where the run is too short.

        From the ten seconds after the first minute to the last tenth; medians.
        """
        if not len(self.t):
            return math.nan
        first = (self.t >= WARM) & (self.t < WARM + FIRST)
        last = self.t >= (1 - LAST) * self.t[-1]
        if not first.any() or self.t[last][0] < WARM + FIRST:
            return math.nan
        return float(np.median(self.resident[last]) - np.median(self.resident[first]))


@dataclass(frozen=True)
class Soak:
    """
    A soak, from the first state that the mpc answered on.

    Shapes, N states and M ticks of the mpc with a solve: t (N,) [s] when the states were
    published, latency and echo (N,) [s] until mpc and echo answered, NaN where they did not,
    deviation (N,) [rad], the largest error of an angle, solve_time (M,) [s].
    """

    solver: str
    period: float               # [s] of the plant
    t: Array
    latency: Array
    echo: Array
    deviation: Array
    solve_time: Array
    statuses: Mapping[str, int]   # ticks of the mpc, by how their solve ended
    late_total: int             # ticks whose solve took longer than a period, as the mpc counts
    skipped_ticks: int          # of the plant
    forces: Forces
    missed: int                 # messages that the watching node did not hear
    usage: Mapping[str, Usage]  # by the name of the process
    failure: str = ''           # why it ended early, if it did

    @property
    def until_next(self) -> Array:
        """Return the time from each state to the next (N,) [s], from the last a period."""
        return np.append(np.diff(self.t), self.period) if len(self.t) else self.t

    @property
    def late(self) -> Array:
        """Return which states (N,) were answered after the next one came."""
        return self.latency > self.until_next

    @property
    def late_by_itself(self) -> Array:
        """
        Return which late answers (N,) the machine did not cause.

        It did where, within a period, the echo took so much longer than its median that without
        that the answer had been in time; and where the state was late, so that the next came
        sooner than a period after it.
        """
        if not self.late.any():
            return self.late
        echo = np.where(np.isnan(self.echo), math.inf, self.echo)   # without an answer
        slowest = np.max([echo, np.append(echo[1:], 0.0), np.append(0.0, echo[:-1])], axis=0)
        lost = slowest - quantile(self.echo, 0.5)
        return self.late & (self.latency - lost > np.maximum(self.until_next, self.period))

    @property
    def swung_up(self) -> float:
        """Return the time [s] since which the angles first stayed within OUT, NaN if never."""
        changes = np.flatnonzero(np.diff(self.deviation <= OUT, prepend=False, append=False))
        return next((float(self.t[begin]) for begin, end in zip(changes[::2], changes[1::2])
                     if self.t[end - 1] - self.t[begin] >= HOLD), math.nan)

    @property
    def held(self) -> Array:
        """Return the deviations since it has swung up."""
        return self.deviation[self.t >= self.swung_up]   # of NaN none is

    @property
    def falls(self) -> int:
        """Return how often it fell, to beyond FALLEN."""
        return int(np.count_nonzero(np.diff((self.held > FALLEN).astype(int)) > 0))

    @property
    def success(self) -> bool:
        """Return whether it stayed up, every force was in its limits and no process failed."""
        return bool(not self.failure and len(self.held) and self.falls == 0
                    and self.held[-1] <= OUT and self.forces.not_finite == 0
                    and self.forces.beyond_limit == 0)

    @property
    def bound(self) -> float:
        """Return what the p99 of the latency should stay below [s]: echo, solve and ALLOWED."""
        return quantile(self.echo, 0.99) + quantile(self.solve_time, 0.99) + ALLOWED


def match(stamps: Array, sent: Array, answered: Array, answers: Array) -> Array:
    """
    Return how long after each state its first answer was sent [s], NaN where none was.

    Shapes: of states stamps and times of sending (N,) [ns], of answers the stamps that they
    answer and times of sending (M,) [ns] -> (N,).
    """
    latency = np.full(len(stamps), math.nan)
    if len(answered):
        known, first = np.unique(answered, return_index=True)
        place = np.minimum(np.searchsorted(known, stamps), len(known) - 1)
        found = known[place] == stamps
        latency[found] = (answers[first[place[found]]] - sent[found]) / 1e9
    return latency


def before(times: Array, others: Array) -> Array:
    """
    Return the last of the other times before each, or itself where there is none.

    Shapes: times (N,), others (M,), in order -> (N,).
    """
    place = np.searchsorted(others, times, side='right') - 1
    found = times.copy()
    found[place >= 0] = others[place[place >= 0]]
    return found


def quantiles(times: Array) -> dict[str, float]:
    """Return count and quantiles [ms] of times [s]; those that are NaN do not count."""
    known = times[np.isfinite(times)]
    return {'count': len(known),
            **{name: 1e3 * quantile(known, share) for name, share in QUANTILES.items()}}


def times(soak: Soak) -> dict[str, dict[str, float]]:
    """Return the quantiles [ms] of all that was timed, by its name."""
    return {'mpc, state to force': quantiles(soak.latency),
            'echo, state to answer': quantiles(soak.echo),
            'mpc, solve': quantiles(soak.solve_time)}


def answers(soak: Soak) -> dict[str, dict[str, float]]:
    """Return how many states mpc and echo answered, and when, by who it is."""
    return {name: {'states': len(soak.t),
                   'answered in time': int(np.sum(times <= soak.until_next)),
                   'late': int(np.sum(times > soak.until_next)),
                   'late by itself': by_itself,
                   'unanswered': int(np.sum(np.isnan(times)))}
            for name, times, by_itself in (
                ('mpc', soak.latency, int(soak.late_by_itself.sum())),
                ('echo', soak.echo, math.nan))}


def ticks(soak: Soak) -> dict[str, float]:
    """Return what became of the ticks of mpc and plant."""
    return {'of the mpc': sum(soak.statuses.values()),
            'without a solve': sum(soak.statuses.get(name, 0) for name in WITHOUT_SOLVE),
            'longer than a period': soak.late_total,
            'skipped by the plant': soak.skipped_ticks,
            'messages not heard': soak.missed}


def pendulum(soak: Soak) -> dict[str, float]:
    """Return how the pendulum was held since it has swung up."""
    held, last = soak.held, len(soak.t) - len(soak.held)
    return {'up after [s]': soak.swung_up,
            'largest angle since [rad]': float(held.max()) if len(held) else math.nan,
            f'out of {OUT:g} rad [s]': float(soak.until_next[last:][held > OUT].sum())
            if len(held) else math.nan, 'falls': soak.falls}


def processes(soak: Soak) -> dict[str, dict[str, float]]:
    """Return by the name of a process: its share of a processor, and memory [MB]."""
    found = {}
    for name, usage in soak.usage.items():
        resident, private = (float(each[-1]) / 1e6 if len(each) else math.nan
                             for each in (usage.resident, usage.private))
        found[name] = {'processor [%]': 100 * usage.share, 'resident [MB]': resident,
                       'private [MB]': private, 'growth [MB]': usage.growth / 1e6}
    return found


def summary(soak: Soak) -> dict[str, Any]:
    """Return all figures of a soak by their names."""
    return {'success': soak.success, 'failure': soak.failure, 'times [ms]': times(soak),
            'bound of p99 [ms]': 1e3 * soak.bound, 'answers': answers(soak),
            'ticks': ticks(soak), 'statuses': dict(soak.statuses),
            'forces': soak.forces._asdict(), 'pendulum': pendulum(soak),
            'processes': processes(soak)}
