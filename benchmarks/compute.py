# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What a method makes of the time it has: closed-loop cost against the time of a solve.

Each method climbs a ladder of rungs, which change how much it may compute and nothing else. The
cost is that over the least known for a start: of optimum.py, or of any run here.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib.figure import Figure
import numpy as np
import optimum
import stamp

from dp_swing_ros import declarations
from dp_swing_ros.evaluation.campaign.contestants import Contestant
from dp_swing_ros.evaluation.campaign.report import number, ratio, share, spans
from dp_swing_ros.evaluation.campaign.rows import grouped, Row, solves
from dp_swing_ros.evaluation.comparison import paired_ratio, Rate, rate, Ratio
from dp_swing_ros.evaluation.metrics import quantile, TIME_LIMIT
from dp_swing_ros.evaluation.scenarios import Case, PERIOD
from dp_swing_ros.figures.style import as_share, colours, FAINT, in_numbers, solver_name, styled
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.tables import compact

OPTIMA = stamp.TOP / 'docs' / 'results' / 'optimum.csv.gz'
TEXTBOOK = 'textbook MPPI'
TIMED = 5                             # starts that one process plays alone
SWING_UP = 2.0                        # [s] in which computing matters; to hold takes next to none
RATIOS = 1.0, 1.2, 1.5, 2.0, 3.0, 5.0, 10.0   # that the picture names
BUDGETS = 1.0, 3.0, 10.0, 40.0        # [ms]
PASSES = 1, 2, 3, 5, 10, 50           # of iLQR and DDP, at most, in each solve of a tick
STARTS = 2, 4, 8, 16, 32              # beside the last plan
UPDATES = (64, 1), (128, 2), (256, 4), (512, 6), (1024, 8), (4096, 8), (16384, 6)
SAMPLES = 64, 256, 1024, 4096, 16384  # of textbook MPPI


class Rung(NamedTuple):
    """How much a method may compute, in words, and the parameters that say so."""

    method: str
    words: str
    solver: str
    mpc: Mapping[str, Any]

    @property
    def label(self) -> str:
        """Return what its rows are called."""
        return f'{self.method}, {self.words}'


def ladder() -> list[Rung]:
    """Return all rungs, method by method, from the least computing up."""
    textbook = declarations.read([Path('config/textbook_mppi.yaml')])['mpc']
    return [
        *(rung for solver in ('ilqr', 'ddp') for rung in (
            *(Rung(solver, f'passes {count}', solver, {f'{solver}.iterations': count})
              for count in PASSES),
            # as many at the first tick, where these are more than by default
            *(Rung(solver, f'starts {count}', solver,
                   {'other_starts': count, 'first_starts': max(count, 6)})
              for count in STARTS))),
        *(Rung('mppi', f'samples {samples}, updates {count}', 'mppi',
               {'mppi.samples': samples, 'mppi.iterations': count}) for samples, count in UPDATES),
        *(Rung(TEXTBOOK, f'samples {samples}', 'mppi', {**textbook, 'mppi.samples': samples})
          for samples in SAMPLES)]


def episodes() -> list[tuple[Contestant, Case]]:
    """Return the runs of all rungs."""
    return [(Contestant(rung.label, rung.solver, {}, dict(rung.mpc)), case)
            for rung in ladder() for case in optimum.cases()]


def is_timed(case: Case) -> bool:
    """Return whether solve times are those of this case."""
    return case.seed in optimum.SEEDS[:TIMED]


class Result(NamedTuple):
    """What came of a rung."""

    rung: Rung
    time: float        # [ms] median of the solves in SWING_UP
    p99: float         # [ms] of all
    held: Rate
    cost: Ratio        # over the least known
    left_out: int      # runs without a finite cost


def results(rows: Sequence[Row], least: Mapping[int, float]) -> list[Result]:
    """Return what came of each rung; least costs by seed."""
    of = grouped(rows, lambda row: row.key.contestant)
    return [result(rung, of[rung.label], least) for rung in ladder() if rung.label in of]


def result(rung: Rung, rows: Sequence[Row], least: Mapping[int, float]) -> Result:
    """Return what came of a rung from its rows."""
    early = np.concatenate([row.solve_times[:round(SWING_UP / PERIOD)] for row in rows])
    cost = paired_ratio(costs(rows), np.array([least[row.key.seed] for row in rows]))
    return Result(rung, 1e3 * quantile(early, 0.5), 1e3 * quantile(solves(rows), 0.99),
                  rate([row.metrics.success for row in rows]), cost, len(rows) - cost.pairs)


def costs(rows: Sequence[Row]) -> Array:
    """Return Σℓ of each run (N,), not a number where the state left the numbers."""
    found = np.array([row.metrics.closed_loop_cost for row in rows])
    return np.where(np.isfinite(found), found, np.nan)


def least_known(rows: Sequence[Row]) -> dict[int, float]:
    """Return the least cost of each start: of its optimum, or of a run."""
    optima = {one.seed: one.cost for one in optimum.read(OPTIMA)}
    return {seed: float(np.nanmin([optima[seed], *costs(of)]))
            for seed, of in grouped(rows, lambda row: row.key.seed).items()}


def page(rows: Sequence[Row], made: str) -> str:
    """Return the page from the rows of all runs."""
    found, optima = results(rows, least := least_known(rows)), optimum.read(OPTIMA)
    by_run = [one.seed for one in optima if one.seed in least and not one.cost <= least[one.seed]]
    methods = grouped(found, lambda one: one.rung.method)
    return '\n'.join([
        '# Cost against computing time\n', made,
        f'Random starts of seeds {spans(least)}, {optimum.DURATION:g} s without ROS, in lockstep; '
        'the rows: [compute.csv.gz](compute.csv.gz). Each rung changes how much a method may '
        'compute, all else is as by default. The cost is the closed-loop cost Σℓ of '
        '[evaluate](../evaluation.md), over the least known of the start: of '
        f'[an oracle](optimum.md), or of any run here, which is less in {len(by_run)} of '
        f'{len(least)} starts; geometric mean of all runs, held or not, with its 95 % interval '
        f'(bootstrap). The time is the median of the solves of the first {SWING_UP:g} s, in which '
        'it swings up, and the p99 that of all solves, of '
        f'seeds {spans(optimum.SEEDS[:TIMED])}, played by one process alone. In lockstep no solve '
        'is cut off.\n',
        '![Closed-loop cost and successes against the time of a solve](../figures/compute.png)\n',
        'Of each method the slowest rung within a time, and what it costs there:\n',
        compact([('median solve', *(f'`{name}`' for name in methods)),
                 *((f'≤ {budget:g} ms', *(within(of, budget) for of in methods.values()))
                   for budget in BUDGETS)]) + '\n',
        'All rungs:\n',
        compact([('method', 'rung', 'solve in the swing-up, median [ms]', 'solve, p99 [ms]',
                  'held', 'cost over the least known', 'left out'),
                 *((f'`{one.rung.method}`', one.rung.words, number(one.time), number(one.p99, 1),
                    share(one.held), ratio(one.cost), str(one.left_out)) for one in found)]), ''])


def within(found: Sequence[Result], budget: float) -> str:
    """Return the cost of the slowest rung that keeps a time [ms]."""
    fitting = [one for one in found if one.time <= budget]
    if not fitting:
        return '-'
    slowest = max(fitting, key=lambda one: one.time)
    return f'{ratio(slowest.cost)}: {slowest.rung.words}'


@styled
def picture(rows: Sequence[Row]) -> Figure:
    """Show cost and successes of all rungs against the time of a solve, a line a method."""
    found = grouped(results(rows, least_known(rows)), lambda one: one.rung.method)
    colour = colours(found)
    figure = Figure((6.4, 6.0), layout='constrained')
    above, below = figure.subplots(2, sharex=True, height_ratios=(2, 1))
    for name, of in found.items():
        look: dict[str, Any] = {'color': colour[name], 'marker': 'o', 'markersize': 3,
                                'linewidth': 1.2, 'elinewidth': 0.8}
        time = [one.time for one in of]
        for axes, shown in ((above, [one.cost for one in of]), (below, [one.held for one in of])):
            value = np.array([one.value if isinstance(one, Ratio) else one.successes / one.runs
                              for one in shown])
            ends = np.array([(one.low, one.high) for one in shown]).T
            axes.errorbar(time, value, np.abs(ends - value), label=solver_name(name), **look)
    for axes in (above, below):
        for limit, words in ((TIME_LIMIT, 'time limit'), (PERIOD, 'tick')):
            axes.axvline(1e3 * limit, color=FAINT, linewidth=1,
                         linestyle='--' if limit == TIME_LIMIT else '-')
            if axes is above:
                axes.annotate(f'{words} ', (1e3 * limit, 0.98), rotation=90, fontsize='x-small',
                              xycoords=('data', 'axes fraction'), va='top', color=FAINT,
                              ha='right' if limit == TIME_LIMIT else 'left')
        axes.grid()
    above.set(xscale='log', yscale='log', ylabel='closed-loop cost over the least known')
    above.set_yticks(RATIOS, [f'{value:g}' for value in RATIOS])
    above.minorticks_off()
    below.set(xlabel='median solve in the swing-up [ms]', ylabel='held')
    in_numbers(below.xaxis)
    as_share(below, 'y')
    above.legend(fontsize='small')
    return figure
