# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Statistics of many runs: rates with their intervals, spreads, and runs in pairs."""

from collections.abc import Callable, Collection, Mapping, Sequence
import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np

from dp_swing_ros.evaluation.metrics import Metrics, named, reduced
from dp_swing_ros.pendulum.parameters import FORCE
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.tables import aligned

CONFIDENCE = 0.95
RESAMPLES = 2000  # of a bootstrap
# what makes no difference to a user, so that within it two controllers count as equivalent
SAME_HELD = 0.01   # of all cases
SAME_COST = 1.05   # times the cost


class Rate(NamedTuple):
    """Successes of a number of runs, and Wilson's 95 % interval of their share."""

    successes: int
    runs: int
    low: float
    high: float


class Median(NamedTuple):
    """The median of some runs, and its 95 % interval by the bootstrap."""

    runs: int
    value: float
    low: float
    high: float


class Paired(NamedTuple):
    """
    How one figure differs between two controllers over the same cases.

    The median of the differences, its 95 % interval by the bootstrap, and the p of the sign test.
    """

    pairs: int
    median: float
    low: float
    high: float
    p: float


class Ratio(NamedTuple):
    """
    The geometric mean of paired ratios, and its 95 % interval by the bootstrap.

    same is the p of the equivalence test that it is within 1 / SAME_COST and SAME_COST.
    """

    pairs: int
    value: float
    low: float
    high: float
    same: float


def rate(successes: Sequence[bool]) -> Rate:
    """Count successes; without a run there is no interval."""
    count, runs = sum(successes), len(successes)
    if not runs:
        return Rate(0, 0, math.nan, math.nan)
    from scipy.stats import binomtest   # here and below: 0.4 s of loading, which few need
    interval = binomtest(count, runs).proportion_ci(method='wilson')
    return Rate(count, runs, float(interval.low), float(interval.high))


def median(values: Array) -> Median:
    """
    Return the median of the values (N,) that are known, NaN where unknown.

    Source as of `paired`.
    """
    known = _known(values)
    return Median(len(known), *_bootstrapped(known, np.median))


def paired(a: Array, b: Array) -> Paired:
    """
    Compare the values of two controllers case by case, a - b, where both are known.

    Shapes: a and b (N,), NaN where unknown. Source: Efron and Tibshirani, "An Introduction to the
    Bootstrap", 1993, 13 (percentile intervals).
    """
    apart = _known(a - b)
    p = sign_test(int(np.sum(apart > 0)), int(np.sum(apart < 0))) if len(apart) > 1 else math.nan
    return Paired(len(apart), *_bootstrapped(apart, np.median), p)


def paired_ratio(a: Array, b: Array) -> Ratio:
    """
    Compare positive values of two controllers case by case, a / b, where both are known.

    Equivalence is that of two one-sided t tests on the logarithms. Shapes: a and b (N,), NaN where
    unknown. Sources as of `paired`, and Schuirmann, "A comparison of the two one-sided tests
    procedure and the power approach ...", J. Pharmacokinetics and Biopharmaceutics 15, 1987.
    """
    logarithm = _known(np.log(a / b))
    value, low, high = map(math.exp, _bootstrapped(logarithm, np.mean))
    return Ratio(len(logarithm), value, low, high, _within(logarithm, math.log(SAME_COST)))


def _within(values: Array, margin: float) -> float:
    """Return the p of the two one-sided tests that the mean of values is within a margin."""
    if len(values) < 2:
        return math.nan
    if not np.ptp(values):   # without a spread the test is none
        return float(abs(values[0]) >= margin)
    from scipy.stats import ttest_1samp
    return float(max(ttest_1samp(values, -margin, alternative='greater').pvalue,
                     ttest_1samp(values, margin, alternative='less').pvalue))


def same_held(first_only: int, second_only: int, cases: int) -> float:
    """
    Return the p of the equivalence test that two controllers hold the same share of all cases.

    Both what only the one held and what only the other held must be shown to be less than
    SAME_HELD of the cases, by exact binomial tests; the difference of the shares then is.
    """
    if not cases:
        return math.nan
    from scipy.stats import binomtest
    return max(float(binomtest(count, cases, SAME_HELD, alternative='less').pvalue)
               for count in (first_only, second_only))


def _known(values: Array) -> Array:
    return values[np.isfinite(values)]


def _bootstrapped(values: Array, statistic: Callable[..., Any]) -> tuple[float, float, float]:
    """Return a statistic and its percentile interval, NaN where there are too few values."""
    value = reduced(statistic, values)
    if len(values) < 2:
        return value, math.nan, math.nan
    from scipy.stats import bootstrap
    interval = bootstrap(
        (values,), statistic, confidence_level=CONFIDENCE, n_resamples=RESAMPLES, batch=100,
        method='percentile', random_state=np.random.default_rng(0)).confidence_interval
    return value, float(interval.low), float(interval.high)


def sign_test(first: int, second: int) -> float:
    """
    Return the two-sided p of such counts of unequal pairs, were both sides equally likely.

    Of successes it is McNemar's exact test.
    """
    from scipy.stats import binomtest
    return float(binomtest(first, first + second).pvalue) if first + second else 1.0


def spread(runs: Sequence[Metrics]) -> dict[str, Metrics]:
    """Return the smallest, the median and the largest of each figure over repeated runs."""
    return {name: Metrics(**{
        field.name: _of_runs(reduce, [getattr(run, field.name) for run in runs])
        for field in dataclasses.fields(Metrics)})
        for name, reduce in (('smallest', np.min), ('median', np.median), ('largest', np.max))}


def _of_runs(reduce: Callable[[Array], Any], values: list[Any]) -> Any:
    """Reduce the values that are known."""
    kind, known = type(values[0]), [value for value in values if not math.isnan(value)]
    if not known:
        return math.nan
    found = reduce(np.array(known, dtype=float))
    # of as many that are held as are not, the median is not; a count is a whole number
    return kind(found > 0.5 if kind is bool else np.round(found) if kind is int else found)


def summary(name: str, runs: Sequence[Metrics]) -> str:
    """Return one line on repeated runs: successes, late ticks and the worst median solve."""
    held = rate([run.success for run in runs])
    late = sum(run.late_ticks for run in runs)
    slowest = _of_runs(np.max, [run.median_solve_time for run in runs])
    return (f'{name}: upright in {held.successes} of {held.runs} runs (95 % interval '
            f'{100 * held.low:.0f}-{100 * held.high:.0f} %), late ticks {late}, '
            f'worst median solve {_text(slowest, {"scale": 1e3, "digits": 2})} ms')


def table(runs: Mapping[str, Metrics], drives: Collection[str] = (FORCE,)) -> str:
    """
    Return a Markdown table, aligned for a terminal: a row for a metric, a column for a run.

    drives are those of the runs.
    """
    return aligned([['', 'unit', *runs], *rows(list(runs.values()), drives).values()], names=2)


def rows(runs: Sequence[Metrics], drives: Collection[str] = (FORCE,)) -> dict[str, list[str]]:
    """
    Return by the name of each metric its cells in a table: label, unit, and each run's.

    drives are those of the runs; what makes no sense with any of them is left out.
    """
    found = {}
    for field in dataclasses.fields(Metrics):
        label, unit = named(field.metadata['label'], field.metadata['unit'], drives)
        if unit is not None:
            found[field.name] = [label, unit, *(_text(getattr(run, field.name), field.metadata)
                                                for run in runs)]
    return found


def _text(value: Any, about: Mapping[str, Any]) -> str:
    if isinstance(value, bool):
        return 'yes' if value else 'no'
    if isinstance(value, int):
        return str(value)
    return '-' if math.isnan(value) else f'{value * about["scale"]:.{about["digits"]}f}'
