# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What is worth what around a solver: each part of the scaffold alone, all of them, and none.

The parts are those of the receding horizon that a solver does not have itself. Each solver meets
the same starts, pushes, noises and drives with each.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import campaigns
from matplotlib.figure import Figure
import numpy as np

from dp_swing_ros.control.starts import StartParameters
from dp_swing_ros.evaluation.campaign.contestants import Contestant, key, parse
from dp_swing_ros.evaluation.campaign.report import share
from dp_swing_ros.evaluation.campaign.rows import Row
from dp_swing_ros.evaluation.comparison import paired_ratio, rate
from dp_swing_ros.evaluation.scenarios import Case, SCENARIOS
from dp_swing_ros.figures.style import colours, name_lines, solver_name, styled
from dp_swing_ros.tables import compact

SOLVERS = {'ilqr': 'ilqr', 'ddp': 'ddp', 'mppi': 'mppi', 'textbook MPPI': campaigns.TEXTBOOK,
           'sampled_ilqr': 'sampled_ilqr'}
NONE: dict[str, Any] = {
    'first_starts': 1, 'other_starts': 0, 'bounded_lqr': False, 'regulator': False,
    'estimator': 'none', 'warm_start': 'forces'}
STARTS = {name: getattr(StartParameters(), name) for name in ('first_starts', 'other_starts')}
# what of NONE is as by default again
ALONE: dict[str, dict[str, Any]] = {
    'none': {},
    'other starts': STARTS,
    'other starts, bounded LQR too': {**STARTS, 'bounded_lqr': True},
    'regulator where cheaper': {'regulator': True},
    'estimator': {'estimator': 'ekf'},
    'policy shifted': {'warm_start': 'policy'}}
ALL = 'all, the defaults'
SET_UPS: Mapping[str, dict[str, Any]] = {
    **{title: {**NONE, **some} for title, some in ALONE.items()}, ALL: {}}


class Trial(NamedTuple):
    """What a set-up meets: cases of a scenario, at one level where it has some."""

    title: str
    scenario: str
    seeds: range
    level: float | None = None

    def cases(self) -> list[Case]:
        """Return the cases."""
        return [case for case in SCENARIOS[self.scenario].cases(
            self.scenario, self.seeds, None, campaigns.DURATION)
            if self.level is None or case.level == self.level]


TRIALS = (
    Trial('random starts', 'random', range(1000, 1050)),   # held out
    Trial('pushes', 'pushes', range(20)),
    Trial('pushes of 30 N', 'strong_pushes', range(20), 30.0),
    Trial('noise of 10 mm, mrad', 'position_noise', range(20), 0.01),
    Trial('50 ms late', 'unknown_delay', range(20), 0.05),
    Trial('all at once', 'all_at_once', range(20), 1.0))


def contestant(title: str, name: str) -> Contestant:
    """Return a solver with a set-up."""
    solver = parse(SOLVERS[name])
    return replace(solver, label=f'{name}, {title}', mpc={**solver.mpc, **SET_UPS[title]})


def of_trial(title: str, name: str, trial: Trial) -> list[tuple[Contestant, Case]]:
    """Return the episodes of a cell of the page."""
    return [(contestant(title, name), case) for case in trial.cases()]


def episodes() -> list[tuple[Contestant, Case]]:
    """Return the episodes of the page."""
    return [episode for trial in TRIALS for title in SET_UPS for name in SOLVERS
            for episode in of_trial(title, name, trial)]


def cell(rows: Sequence[Row]) -> str:
    """Return how many of some runs were held."""
    return f'{sum(row.metrics.success for row in rows)} of {len(rows)}'


def cost(rows: Sequence[Row], defaults: Sequence[Row]) -> str:
    """Return the closed-loop cost over that of the defaults, of the runs that both held."""
    both = [(row.metrics.closed_loop_cost, other.metrics.closed_loop_cost)
            for row, other in zip(rows, defaults)
            if row.metrics.success and other.metrics.success]
    if len(both) < 2:
        return '-'
    of = paired_ratio(*np.array(both).T)
    return f'{of.value:.2f} ({of.low:.2f}-{of.high:.2f}), {of.pairs}'


def page(rows: Sequence[Row], made: str) -> str:
    """Return the page from the rows of all runs."""
    found = {row.key: row for row in rows}

    def runs(title: str, name: str, trial: Trial) -> list[Row]:
        return [found[key(*episode)] for episode in of_trial(title, name, trial)]

    def line(title: str, name: str) -> tuple[str, ...]:
        of = [runs(title, name, trial) for trial in TRIALS]
        every = [row.metrics.success for some in of for row in some]
        return (f'`{name}`', title, *map(cell, of), share(rate(every), 0),
                cost(of[0], runs(ALL, name, TRIALS[0])))
    return '\n'.join([
        '# What the scaffold is worth\n', made,
        f'{len(rows)} episodes of {campaigns.DURATION:g} s; the rows: '
        '[ablation.csv.gz](ablation.csv.gz). Around a solver stand parts that are no part of '
        'its method: [other starts](../model.md) than the last plan (the LQR for a bounded force '
        'among them), the regulator in place of the last plan where that costs less, the '
        'estimator, and a warm start by the last policy instead of its forces. Here each is '
        'alone, none is there, or all. The regulator is compared with a policy that is shifted: '
        'where forces are, it has no part. Textbook MPPI is `config/textbook_mppi.yaml`: '
        'no elite, no derivatives. '
        + ' '.join(f'{trial.title[0].upper()}{trial.title[1:]}: `{trial.scenario}`, seeds '
                   f'{trial.seeds.start}-{trial.seeds.stop - 1}.' for trial in TRIALS)
        + ' Columns are how many were held; all: with the 95 % interval (Wilson) in percent. Σℓ '
        'is the closed-loop cost of random starts over that of the same solver with all parts, '
        'where both held: geometric mean, 95 % interval (bootstrap), pairs.\n',
        compact([('solver', 'parts', *(trial.title for trial in TRIALS), 'all', 'Σℓ'),
                 *(line(title, name) for name in SOLVERS for title in SET_UPS)]) + '\n',
        '![What is held with which parts, by solver](../figures/ablation.png)\n'])


@styled
def picture(rows: Sequence[Row]) -> Figure:
    """Show which share of the runs is held with which parts, by solver."""
    found = {row.key: row for row in rows}
    names = {name: solver_name(name) for name in SOLVERS}
    colour = colours(SOLVERS)
    figure = Figure((8.0, 4.6), layout='constrained')
    panels = figure.subplots(2, 3, sharex=True, sharey=True)
    places = -np.arange(len(SET_UPS))
    for axes, trial in zip(panels.flat, TRIALS):
        for n, name in enumerate(SOLVERS):
            held = [np.mean([found[key(*episode)].metrics.success
                             for episode in of_trial(title, name, trial)]) for title in SET_UPS]
            axes.plot(held, places + 0.12 * (2 - n), 'o', color=colour[name], markersize=4,
                      clip_on=False)
        axes.set(title=trial.title, xlim=(0, 1), yticks=places, yticklabels=list(SET_UPS))
        axes.grid()
    for axes in panels[-1]:
        axes.set_xlabel('share that is held')
    name_lines(figure, {names[name]: {'color': colour[name], 'marker': 'o', 'linestyle': ''}
                        for name in SOLVERS})
    return figure
