# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a run is judged by: pure functions of an episode, and the table that compares runs."""

from collections.abc import Callable, Mapping, Sequence
import dataclasses
import math
from typing import Any

import numpy as np
from scipy.stats import binomtest

from dp_swing_ros.episode import Episode
from dp_swing_ros.state import ANGLES, Array, is_upright, to_turn_of, UPRIGHT

HOLD = 1.0  # [s] upright for less than this at the end may be passing by
REST = 2.0  # [s] at the end of a run, where holding is judged


def quantity(label: str, unit: str = '', digits: int = 2, scale: float = 1.0) -> Any:
    """Declare one metric as a dataclass field; the table shows `scale` times its value."""
    return dataclasses.field(metadata={
        'label': label, 'unit': unit, 'digits': digits, 'scale': scale})


@dataclasses.dataclass(frozen=True)
class Metrics:
    """The figures of one run in SI units; NaN where a run does not tell."""

    success: bool = quantity('upright to the end')
    settling_time: float = quantity('settling time', 's')
    hold_error: float = quantity(f'angle error, last {REST:g} s (RMS)', 'rad', digits=4)
    smoothness: float = quantity(f'force step, last {REST:g} s (std)', 'N', digits=3)
    largest_force: float = quantity('largest force u', 'N')
    largest_position: float = quantity('largest position x', 'm')
    median_solve_time: float = quantity('solve time, median', 'ms', scale=1e3)
    p99_solve_time: float = quantity('solve time, p99', 'ms', scale=1e3)
    largest_solve_time: float = quantity('solve time, largest', 'ms', scale=1e3)
    median_latency: float = quantity('latency, median', 'ms', scale=1e3)
    p99_latency: float = quantity('latency, p99', 'ms', scale=1e3)
    late_ticks: int = quantity('late ticks')
    ticks: int = quantity('ticks')
    states: int = quantity('states')
    duration: float = quantity('duration', 's')


def measure(episode: Episode) -> Metrics:
    """
    Measure a run.

    It succeeds when both angles stay within 0.1 rad and all speeds under 1 over its last second
    (or all of it, where it is shorter); it has settled where that last unbroken stay begins.
    """
    t, ticks = np.asarray(episode.t, dtype=float), episode.ticks
    settled = settling_time(t, episode.X)
    rest = t >= t[-1] - REST if t.size else np.zeros(0, dtype=bool)
    return Metrics(
        success=not math.isnan(settled),
        settling_time=settled,
        hold_error=_rms(to_turn_of(episode.X, np.array(UPRIGHT))[rest, ANGLES]),
        # the force of the period that starts at a state
        smoothness=_spread(np.diff(episode.U[rest[:-1]])),
        largest_force=_largest(episode.U),
        largest_position=_largest(episode.X[:, 0]),
        median_solve_time=_quantile(ticks.solve_time, 0.5),
        p99_solve_time=_quantile(ticks.solve_time, 0.99),
        largest_solve_time=_quantile(ticks.solve_time, 1.0),
        median_latency=_quantile(ticks.latency, 0.5),
        p99_latency=_quantile(ticks.latency, 0.99),
        late_ticks=int(np.count_nonzero(ticks.late)),
        ticks=len(ticks.t),
        states=len(t),
        duration=float(t[-1] - t[0]) if t.size else math.nan)


def settling_time(t: Array, X: Array) -> float:
    """
    Return the start [s] of the last unbroken upright stay; NaN where none is held to the end.

    Shapes: t (N,) [s], X (N, 6).
    """
    if not len(t):
        return math.nan
    fallen = np.flatnonzero(~is_upright(X))
    first = int(fallen[-1]) + 1 if fallen.size else 0
    # a stay that began with the run counts however short the run is
    if first == len(t) or (first > 0 and t[-1] - t[first] < HOLD - 1e-9):
        return math.nan
    return float(t[first])


def _quantile(values: Array, share: float) -> float:
    values = np.asarray(values, dtype=float)
    values = values[np.isfinite(values)]
    return float(np.quantile(values, share)) if values.size else math.nan


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values))) if np.size(values) else math.nan


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if np.size(values) else math.nan


def _spread(values: Array) -> float:
    return float(np.std(values)) if np.size(values) else math.nan


def wilson(successes: int, runs: int) -> tuple[float, float]:
    """Return Wilson's 95 % confidence interval of a share of successes."""
    interval = binomtest(successes, runs).proportion_ci(method='wilson')
    return float(interval.low), float(interval.high)


def spread(runs: Sequence[Metrics]) -> dict[str, Metrics]:
    """Return the smallest, the median and the largest of each figure over repeated runs."""
    return {name: Metrics(**{
        field.name: _of_runs(reduce, [getattr(run, field.name) for run in runs])
        for field in dataclasses.fields(Metrics)})
        for name, reduce in (('smallest', np.min), ('median', np.median), ('largest', np.max))}


def _of_runs(reduce: Callable[[Array], Any], values: list[Any]) -> Any:
    """Reduce the values that runs could tell."""
    kind, known = type(values[0]), [value for value in values if not math.isnan(value)]
    return kind(reduce(np.array(known, dtype=float))) if known else math.nan


def summary(name: str, runs: Sequence[Metrics]) -> str:
    """Return one line on repeated runs: successes, late ticks and the worst median solve."""
    successes = sum(run.success for run in runs)
    low, high = wilson(successes, len(runs))
    late = sum(run.late_ticks for run in runs)
    slowest = max((run.median_solve_time for run in runs), default=math.nan)
    return (f'{name}: upright in {successes} of {len(runs)} runs (95 % interval '
            f'{100 * low:.0f}-{100 * high:.0f} %), late ticks {late}, '
            f'worst median solve {1e3 * slowest:.2f} ms')


def table(runs: Mapping[str, Metrics]) -> str:
    """Return a Markdown table, aligned for a terminal: a row for a metric, a column for a run."""
    rows = [['', 'unit', *runs]]
    for field in dataclasses.fields(Metrics):
        about = field.metadata
        rows.append([about['label'], about['unit'],
                     *(_text(getattr(run, field.name), about) for run in runs.values())])
    widths = [max(map(len, column)) for column in zip(*rows)]
    lines = ['| ' + ' | '.join(
        cell.rjust(width) if column > 1 else cell.ljust(width)
        for column, (cell, width) in enumerate(zip(row, widths))) + ' |' for row in rows]
    rule = '|'.join('-' * (width + 1) + (':' if column > 1 else '-')
                    for column, width in enumerate(widths))
    return '\n'.join([lines[0], f'|{rule}|', *lines[1:]])


def _text(value: Any, about: Mapping[str, Any]) -> str:
    if isinstance(value, bool):
        return 'yes' if value else 'no'
    if isinstance(value, int):
        return str(value)
    return '-' if math.isnan(value) else f'{value * about["scale"]:.{about["digits"]}f}'
