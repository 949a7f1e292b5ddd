# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who holds the pendulum near the goal, of the starts that an oracle holds; see oracle.py."""

from collections.abc import Mapping, Sequence
from typing import Any

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


def judged() -> tuple[set[int], set[int]]:
    """Return the seeds that the oracle holds, and those for which it found nothing."""
    verdicts = oracle.read(VERDICTS)
    possible = {one.seed for one in verdicts if one.held}
    return possible, {one.seed for one in verdicts} - possible


def held_by(rows: Sequence[Row]) -> Mapping[str, set[int]]:
    """Return the seeds that each solver holds."""
    return {name: {row.key.seed for row in of if oracle.is_held(row.metrics)}
            for name, of in grouped(rows, lambda row: row.key.contestant).items()}


def leaning(rows: Sequence[Row], seeds: set[int]) -> str:
    """Return how far it leans [rad] in some runs, and which do not end upright."""
    return ', '.join(f'{row.key.seed}: {row.metrics.largest_angle:.2f}'
                     + ('' if row.metrics.success else ', not upright at the end')
                     for row in rows if row.key.seed in seeds) or 'none'


def page(rows: Sequence[Row], made: str) -> str:
    """Return the page from the rows of all runs."""
    possible, none_found = judged()
    held = held_by(rows)
    return '\n'.join([
        '# Near the goal\n', made,
        "Starts at rest with both angles within ±0.3 rad (the paper's Figs. 8-10), "
        f'seeds {spans(possible | none_found)}, {oracle.DURATION:g} s, defaults, so 20 N at '
        'most; the rows: [near_goal.csv.gz](near_goal.csv.gz). Held is what stays within '
        f'{DROP:g} rad, and upright to the end, without a track strike; dropped what '
        f'leaves {DROP:g} rad. What is possible at all says [an oracle](oracle.md) that '
        f'has no part of any solver of ours: a nonlinear program holds {len(possible)} of the '
        f'{len(possible | none_found)} starts. No solver is counted for or against the other '
        f'{len(none_found)}.\n',
        compact([('solver', 'held, of those that the oracle holds',
                  'dropped though possible: the largest angle [rad]',
                  'held though the oracle found nothing'),
                 *((f'`{name}`',
                    share(rate([seed in held[name] for seed in possible])),
                    leaning(of, possible - held[name]), spans(none_found & held[name]) or 'none')
                   for name, of in grouped(rows, lambda row: row.key.contestant).items())]) + '\n',
        '![Starts near the goal by their angles: what can be held, and what is]'
        '(../figures/near_goal.png)\n'])


@styled
def picture(rows: Sequence[Row]) -> Figure:
    """Show the starts by their angles: what can be held, and what is."""
    starts = {case.seed: np.array(case.plant['initial_state'])[1:3] for case in oracle.cases()}
    (possible, none_found), held = judged(), held_by(rows)
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
