# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
From random forces with each kind of learned dynamics, beside equations with wrong parameters.

Run by `make results`.
"""

from collections.abc import Mapping, Sequence
import math
import time
from typing import Any, NamedTuple

from campaigns import METHODS
from joblib import delayed
from learned import draw_since, held_since, HOLD, in_parallel, SET_UP
from matplotlib.figure import Figure
import numpy as np
import pandas as pd
from stamp import asked, made, sources, store_table

from dp_swing_ros import configuration
from dp_swing_ros.evaluation.campaign.report import interval, share
from dp_swing_ros.evaluation.comparison import median, rate
from dp_swing_ros.evaluation.scenarios import PERIOD
from dp_swing_ros.evaluation.soak import OUT
from dp_swing_ros.figures.style import styled
from dp_swing_ros.learning.learner import FIRST, Learner
from dp_swing_ros.learning.models import HIDDEN
from dp_swing_ros.learning.trials import trials
from dp_swing_ros.pendulum.state import deviation, upright
from dp_swing_ros.simulation.closed_loop import simulate
from dp_swing_ros.tables import compact

SEEDS = 10
LONG = 30.0    # [s] of a run without a break


class Way(NamedTuple):
    """A kind of dynamics, and what it costs that members disagree."""

    kind: str
    weight: float = 0.0

    def __str__(self) -> str:
        paid = f', disagreement_weight {self.weight:g}' if self.weight else ''
        return self.kind.replace('_', ' ') + paid


EQUATIONS = Way('equations')   # with the bodies of our own plant, and the estimator
WAYS = (EQUATIONS, *(Way(kind, weight) for kind in ('structured', 'residual', 'black_box')
                     for weight in (0.0, 1.0)))


def without_break(way: Way, solver: str, seed: int, plant: Mapping[str, Any] = SET_UP,
                  duration: float = LONG, hidden: int = HIDDEN) -> dict[str, Any]:
    """Learn without a break; return from which experience on it was held to the end."""
    began, first = time.perf_counter(), 0.0 if way == EQUATIONS else FIRST
    mpc = {'solver': solver, 'seed': seed, 'disagreement_weight': way.weight}
    plant = {**plant, 'seed': seed}
    if way == EQUATIONS:
        off = deviation(simulate(configuration.plant(plant), configuration.controller(mpc),
                                 duration).X[1:], upright())
    else:
        off = next(trials(Learner(mpc, kind=way.kind, hidden=hidden), plant, math.inf, duration,
                          math.inf)).deviation
    return {'way': str(way), 'solver': solver, 'seed': seed, 'since': held_since(off, duration),
            'up': float(np.mean(off[round(first / PERIOD):] < OUT)),
            'seconds': time.perf_counter() - began}


@styled
def picture(found: pd.DataFrame) -> Figure:
    """Draw who is held for good after some experience: a column a kind, below it who pays."""
    figure = Figure(figsize=(10.2, 5.6), layout='constrained')
    ways = [way for way in WAYS if str(way) in set(found.way)]
    kinds = list(dict.fromkeys(way.kind for way in ways))
    panels = figure.subplots(2, len(kinds), sharex=True, sharey=True, squeeze=False)
    for axes in panels.flat:
        axes.set_axis_off()
    for way in ways:
        axes = panels[int(way.weight > 0), kinds.index(way.kind)]
        axes.set_axis_on()
        draw_since(axes, found[found.way == str(way)], 0.0, LONG)
        axes.axvspan(0, 0 if way == EQUATIONS else FIRST, color='#f4f6f8')
        axes.grid(True)
        axes.set(title=str(way).replace(', ', '\n'), xlim=(0, LONG), ylim=(-0.02, 1.02),
                 xlabel='experience [s]')
        axes.tick_params(labelbottom=True, labelleft=True)
    panels[0, 0].set(ylabel='share held from here on')
    panels[0, 0].legend(loc='lower right', fontsize='small')
    figure.suptitle('Without a break, from random forces, by the kind of dynamics')
    return figure


def page(found: pd.DataFrame, made: str) -> str:
    """Return the page as Markdown."""
    lines = []
    for (way, solver), of in found.groupby(['way', 'solver'], sort=False):
        lines.append((
            way, f'`{solver}`', share(rate(of.since.notna().tolist())),
            interval(median(of.since.to_numpy()), '.1f'),
            f'{100 * of.up.median():.0f}', f'{of.seconds.median() / LONG:.2f}'))
    return '\n'.join([
        '# Kinds of learned dynamics\n', made,
        "PILCO's set-up as on the page of [learned dynamics](learned.md), without a break: "
        f'told are limits and number of links, forces are random for {FIRST:g} s, and '
        'every transition counts. A residual model is about the bodies of our own plant, which '
        'are not those; the equations, of that structure, begin with the same and have an '
        'estimator, and no random '
        f'forces. Networks have {HIDDEN} hidden units. Held is who was within {OUT:g} rad for the '
        f'last {HOLD:g} s of {LONG:g} s; then since when [s], the share of the time after the '
        'random forces that it was upright, and all computing, planning and learning, per second '
        'of experience (medians). In brackets intervals of 95 %, Wilson and by the bootstrap. The '
        'rows: [learned_kinds.csv.gz](learned_kinds.csv.gz).\n',
        '![Experience and the share of seeds that it holds](../figures/learned_kinds.png)\n',
        compact([('dynamics', 'solver', 'held', 'since [s]', 'upright [%]', 'computing [s/s]'),
                 *lines]), ''])


def main(argv: Sequence[str] | None = None) -> None:
    """Learn in all ways, and write the page."""
    seeds, results, figures = asked(__doc__, argv, SEEDS)
    rows = in_parallel('kinds', [
        delayed(without_break)(way, solver, seed)
        for seed in range(seeds) for way in WAYS for solver in METHODS])
    found = pd.DataFrame(rows)
    ways = list(map(str, WAYS))
    found = found.sort_values('way', key=lambda of: of.map(ways.index), kind='stable')
    store_table(found, results / 'learned_kinds.csv.gz')
    picture(found).savefig(figures / 'learned_kinds.png')
    (results / 'learned_kinds.md').write_text(page(
        found, made('learned_kinds', sources('learned_kinds'))), encoding='utf-8')


if __name__ == '__main__':
    main()
