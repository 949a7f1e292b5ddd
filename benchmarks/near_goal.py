# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who holds the pendulum near the goal, of the starts that an oracle holds; see oracle.py."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from campaigns import METHODS
from matplotlib.figure import Figure
import numpy as np
import oracle
import stamp

from dp_swing_ros.evaluation.campaign.contestants import Contestant, parse_all
from dp_swing_ros.evaluation.campaign.report import share, spans
from dp_swing_ros.evaluation.campaign.rows import grouped, Row
from dp_swing_ros.evaluation.campaign.summary import DROP
from dp_swing_ros.evaluation.comparison import rate
from dp_swing_ros.evaluation.scenarios import Case
from dp_swing_ros.figures.style import colours, FAINT, INK, solver_name, styled
from dp_swing_ros.tables import compact

VERDICTS = stamp.TOP / 'docs' / 'results' / 'oracle.csv.gz'


def episodes() -> list[tuple[Contestant, Case]]:
    """Return the runs of all solvers."""
    contestants = parse_all(METHODS)
    return [(contestant, case) for case in oracle.cases() for contestant in contestants]


def judged() -> tuple[Mapping[int, float], set[int]]:
    """Return the seeds that the oracle holds, at what cost, and those it found nothing for."""
    verdicts = oracle.read(VERDICTS)
    return ({one.seed: one.cost for one in verdicts if one.held},
            {one.seed for one in verdicts if not one.held})


def held_by(rows: Sequence[Row]) -> Mapping[str, set[int]]:
    """Return the seeds that each solver holds."""
    return {name: {row.key.seed for row in of if oracle.is_held(row.metrics)}
            for name, of in grouped(rows, lambda row: row.key.contestant).items()}


class Drop(NamedTuple):
    """A run that is not held from a start that the oracle holds."""

    solver: str
    seed: int
    angle: float        # [rad] the largest
    upright: bool       # to the end, without a strike
    ratio: float        # of its closed-loop cost to the oracle's

    def __str__(self) -> str:
        return (f'{self.seed}: {self.angle:.2f} rad at {self.ratio:.2f}'
                + ('' if self.upright else ', falls or strikes'))


def drops(rows: Sequence[Row], costs: Mapping[int, float]) -> list[Drop]:
    """Return the runs that are not held, of the seeds that the oracle holds at these costs."""
    return [Drop(row.key.contestant, row.key.seed, row.metrics.largest_angle,
                 row.metrics.success,
                 row.metrics.closed_loop_cost / costs[row.key.seed])
            for row in rows if row.key.seed in costs and not oracle.is_held(row.metrics)]


def reasons(dropped: Sequence[Drop]) -> str:
    """Return in sentences why starts are dropped that can be held."""
    if not dropped:
        return 'No solver drops a start that the oracle holds.'
    cheaper = [one for one in dropped if one.upright and one.ratio < 1]
    dearer = [one for one in dropped if one.ratio >= 1]
    lost = [one for one in dropped if one not in cheaper + dearer]
    sentences = [f'{len(dropped)} runs drop starts that the oracle holds, '
                 f'{len({one.seed for one in dropped})} starts in all.']
    if cheaper:
        sentences.append(
            f'{len(cheaper)} of these runs ({named(cheaper)}) are upright to the end and cost '
            f"{extent(one.ratio for one in cheaper)} of the oracle's: "
            f'leaning {extent(one.angle for one in cheaper)} rad is cheaper than its way of '
            f'staying within {DROP:g} rad, a bound that is no part of what the solvers minimise.')
    if dearer:
        sentences.append(
            f'{len(dearer)} ({named(dearer)}) cost {extent(one.ratio for one in dearer)} times '
            "the oracle's: there was a cheaper way, so the solver ended in a worse optimum.")
    if lost:
        sentences.append(f'{len(lost)} ({named(lost)}) fall, or strike an end of the track.')
    return ' '.join(sentences)


def named(dropped: Sequence[Drop]) -> str:
    """Return runs by solver and seeds."""
    return '; '.join(f'`{solver}` {spans(one.seed for one in of)}'
                     for solver, of in grouped(dropped, lambda one: one.solver).items())


def extent(values: Iterable[float]) -> str:
    """Return the least and the largest of some values, or the one that there is."""
    found = sorted(values)
    return ' to '.join(dict.fromkeys(f'{end:.2f}' for end in (found[0], found[-1])))


def page(rows: Sequence[Row], made: str) -> str:
    """Return the page from the rows of all runs."""
    costs, none_found = judged()
    held, dropped = held_by(rows), drops(rows, costs)
    return '\n'.join([
        '# Near the goal\n', made,
        "Starts at rest with both angles within ±0.3 rad (the paper's Figs. 8-10), "
        f'seeds {spans(costs.keys() | none_found)}, {oracle.DURATION:g} s, defaults, so 20 N at '
        'most; the rows: [near_goal.csv.gz](near_goal.csv.gz). Held is what stays within '
        f'{DROP:g} rad, and upright to the end, without a track strike; all else is dropped. '
        'What is possible at all says [an oracle](oracle.md) that '
        f'has no part of any solver of ours: a nonlinear program holds {len(costs)} of the '
        f'{len(costs) + len(none_found)} starts. No solver is counted for or against the other '
        f'{len(none_found)}.\n',
        compact([('solver', 'held, of those that the oracle holds',
                  'dropped though possible: the largest angle, and the closed-loop cost over '
                  "the oracle's", 'held though the oracle found nothing'),
                 *((f'`{name}`',
                    share(rate([seed in of for seed in costs])),
                    '; '.join(str(one) for one in dropped if one.solver == name) or 'none',
                    spans(none_found & of) or 'none')
                   for name, of in held.items())]) + '\n',
        f'{reasons(dropped)} The cost is Σℓ of [the measures](../evaluation.md#measures), by the '
        "default weights; the oracle's is that of the run that it is believed for.\n",
        '![Starts near the goal by their angles: what can be held, and what is]'
        '(../figures/near_goal.png)\n'])


@styled
def picture(rows: Sequence[Row]) -> Figure:
    """Show the starts by their angles: what can be held, and what is."""
    starts = {case.seed: np.array(case.plant['initial_state'])[1:3] for case in oracle.cases()}
    (costs, none_found), held = judged(), held_by(rows)
    possible = set(costs)
    missed = {name: possible - of for name, of in held.items()}
    dropped, colour = set().union(*missed.values()), colours(missed)
    figure = Figure((5.0, 4.4), layout='constrained')
    axes = figure.subplots()

    def marks(seeds: set[int], label: str, **look: Any) -> None:
        points = np.array([starts[seed] for seed in sorted(seeds)]).reshape(-1, 2)
        axes.plot(*points.T, linestyle='', label=f'{label}: {len(seeds)}', **look)
    marks(possible - dropped, 'the oracle and all solvers hold it', marker='o', color=INK,
          markersize=4)
    for size, (name, seeds) in enumerate(missed.items(), 1):
        if seeds:
            marks(seeds, f'the oracle holds it, {solver_name(name)} does not', marker='o',
                  color=colour[name], markerfacecolor='none', markersize=4 * size)
    marks(none_found, 'the oracle found nothing', marker='x', color=FAINT, markersize=4)
    axes.set(xlabel=r'$\theta_1$ at the start [rad]', ylabel=r'$\theta_2$ at the start [rad]',
             aspect='equal')
    axes.grid()
    figure.legend(loc='outside lower center', fontsize='small')
    return figure
