# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Which method, when: what random starts and stress say together.

Nothing is played here; the rows are those that these parts leave in results/.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from campaigns import METHODS, STRESS
from matplotlib.figure import Figure
import numpy as np

from dp_swing_ros.evaluation.campaign.report import number, ratio, share, verdict
from dp_swing_ros.evaluation.campaign.rows import grouped, read, Row, solves
from dp_swing_ros.evaluation.campaign.summary import common
from dp_swing_ros.evaluation.comparison import paired_ratio, Rate, rate, Ratio
from dp_swing_ros.evaluation.metrics import quantile
from dp_swing_ros.figures.style import as_share, colours, FAINT, name_lines, solver_name, styled
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.tables import compact

NEEDED = 'random', 'stress'
FIRST = METHODS[0]          # whom the others are compared with
SHOWN = (*METHODS, 'mppi_textbook')
COST, APART = 'closed_loop_cost', 1.25   # times as much is in the tails
RESETS = 'uptime'           # where how it ends says little, and the time upright much

Stored = Mapping[str, Sequence[Row]]


def of(rows: Sequence[Row], method: str, scenario: str = '') -> list[Row]:
    """Return the rows of a method, in a scenario if one is named."""
    return [row for row in rows if row.key.contestant == method
            and scenario in ('', row.key.scenario)]


def held(rows: Sequence[Row]) -> Rate:
    """Return how many were held."""
    return rate([row.metrics.success for row in rows])


def both(rows: Sequence[Row], method: str, scenario: str, measure: str) -> tuple[Array, Array]:
    """Return a measure of a method and of FIRST, (N,) each, where both held."""
    pairs = [pair for pair in common(of(rows, method, scenario), of(rows, FIRST, scenario))
             if all(row.metrics.success for row in pair)]
    values = np.array([[getattr(row.metrics, measure) for row in pair] for pair in pairs])
    ours, first = values.reshape(-1, 2).T
    return ours, first


def cost(rows: Sequence[Row], method: str, scenario: str = '') -> Ratio:
    """Return the closed-loop cost of a method over that of FIRST, where both held."""
    return paired_ratio(*both(rows, method, scenario, COST))


def typical(rows: Sequence[Row], method: str, scenario: str = '') -> str:
    """Return the median of the same ratios, and where nine tenths of them are."""
    ours, first = both(rows, method, scenario, COST)
    if not len(ours):
        return '-'
    low, middle, high = np.quantile(ours / first, (0.05, 0.5, 0.95))
    return f'{middle:.2f} ({low:.2f}-{high:.2f})'


class Tails(NamedTuple):
    """The shares of cases that cost APART times less or more, and how much later is the dearer."""

    less: float
    more: float
    later: float   # [s] median


def tails(rows: Sequence[Row], method: str) -> Tails:
    """Return what the median of the cost over that of FIRST hides, where both held."""
    ours, first = both(rows, method, '', COST)
    less, more = ours * APART < first, ours > first * APART
    apart = np.subtract(*both(rows, method, '', 'settling_time'))
    return Tails(float(np.mean(less)), float(np.mean(more)),
                 float(np.median([*-apart[less], *apart[more]])))


def upright(rows: Sequence[Row]) -> float:
    """Return the mean share of the time that was spent upright."""
    return float(np.mean([row.metrics.uptime for row in rows]))


def page(rows: Stored) -> str:
    """Return the part."""
    lines = []
    for method in SHOWN:
        starts = of(rows['random'], method)
        starts_cost = cost(rows['random'], method)
        lines.append((
            f'`{method}`', share(held(starts)) if starts else '-',
            typical(rows['random'], method), ratio(starts_cost),
            verdict(starts_cost.same) if method != FIRST else '-',
            number(quantile(solves(starts), 0.99), 1, 1e3) if starts else '-',
            share(held(of(rows['stress'], method))), typical(rows['stress'], method),
            ratio(cost(rows['stress'], method))))
    by_scenario = [
        (f'`{method}`', *(f'{one.successes} of {one.runs}' for one in (
            held(of(rows['stress'], method, scenario)) for scenario in STRESS)),
         number(upright(of(rows['stress'], method, RESETS)), 1, 100.0))
        for method in grouped(rows['stress'], lambda row: row.key.contestant)]
    return '\n'.join([
        '# What each holds, and at what cost\n',
        'From the rows of [random starts](reliability.md#from-random-starts) and of '
        '[stress](reliability.md#under-stress).\n',
        '![What is held, and closed-loop cost beside iLQR](../figures/methods.png)\n',
        f'Σℓ is the closed-loop cost over that of `{FIRST}` on the same cases, where both held: '
        'the median and where nine tenths of the cases are, then the geometric mean, which the '
        'tails move, with its 95 % interval (bootstrap); equivalent is what an equivalence test '
        'shows of that to be within 5 %. Stress is all of '
        f'{", ".join(f"`{name}`" for name in STRESS)}.\n',
        compact([('method', 'random starts held', 'Σℓ, median (5-95 %)', 'Σℓ, mean',
                  'equivalent', 'solve, p99 [ms]', 'stress held',
                  'Σℓ under stress, median (5-95 %)', 'Σℓ under stress, mean'), *lines]) + '\n',
        'Held, by scenario:\n',
        compact([('method', *(f'`{name}`' for name in STRESS), f'upright in `{RESETS}` [%]'),
                 *by_scenario]), ''])


@styled
def picture(rows: Stored) -> Figure:
    """Show what is held from random starts and under stress, and cost beside the first method."""
    colour, apart = colours(SHOWN), np.linspace(-0.3, 0.3, len(SHOWN))
    figure = Figure((8.0, 3.9), layout='constrained')
    success, beside = figure.subplots(1, 2)
    places = -np.arange(len(STRESS) + 1)
    for n, method in enumerate(SHOWN):
        of_all = [('random', ''), *(('stress', scenario) for scenario in STRESS)]
        for y, (source, scenario) in zip(places - apart[n], of_all):
            some = of(rows[source], method, scenario)
            if not some:
                continue
            one, against = held(some), cost(rows[source], method, scenario)
            success.plot([one.low, one.high], [y, y], color=colour[method], linewidth=1)
            success.plot(one.successes / one.runs, y, 'o', color=colour[method], markersize=3.5)
            beside.plot([against.low, against.high], [y, y], color=colour[method], linewidth=1)
            beside.plot(against.value, y, 'o', color=colour[method], markersize=3.5)
    success.set(title='held', yticks=places, yticklabels=['random starts', *STRESS])
    as_share(success, 'x')
    beside.axvline(1, color=FAINT, linewidth=1)
    beside.set(title=f'cost over that of {solver_name(FIRST)}', yticks=places, yticklabels=[])
    for axes in (success, beside):
        axes.grid()
    name_lines(figure, {solver_name(method): {'color': colour[method], 'marker': 'o'}
                        for method in SHOWN}, entry=1.6)
    return figure


def write(stored: Path, docs: Path) -> None:
    """Write the part and its picture, from a folder of rows into one of documents."""
    rows = {name: read(stored / f'{name}.csv.gz') for name in NEEDED}
    picture(rows).savefig(docs / 'figures' / 'methods.png')
    (docs / 'results' / 'methods.md').write_text(page(rows), encoding='utf-8')
