# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Pictures, drawn from what was recorded alone.

Of an episode: `snapshots` and `squared_error` redraw the paper's two kinds of figure (its Figs. 2
and 3), `timeline`, `hero` and `animation` show a run, `overlay` several in one picture. Of a
campaign: `of_campaign` draws all. Of take-overs: `counterfactual` draws one, `regret` many.
"""

from collections.abc import Iterator, Sequence

from matplotlib.figure import Figure

from dp_swing_ros.evaluation.campaign.rows import Row
from dp_swing_ros.evaluation.campaign.summary import Summary
from dp_swing_ros.figures.counterfactual import counterfactual, regret
from dp_swing_ros.figures.cover import hero
from dp_swing_ros.figures.curves import ERROR_FLOOR, overlay, squared_error, timeline
from dp_swing_ros.figures.distributions import settling, solve_times, starts
from dp_swing_ros.figures.film import animation, snapshots
from dp_swing_ros.figures.rates import criteria, successes, sweeps
from dp_swing_ros.figures.style import mark

__all__ = ['animation', 'counterfactual', 'ERROR_FLOOR', 'hero', 'mark', 'of_campaign', 'overlay',
           'regret', 'snapshots', 'squared_error', 'timeline']


def of_campaign(summary: Summary, rows: Sequence[Row]) -> Iterator[tuple[str, Figure]]:
    """Yield the pictures of a campaign that has something to show in them, with their names."""
    found = {'successes': successes(summary), 'criteria': criteria(summary),
             'sweeps': sweeps(summary), 'settling': settling(summary, rows),
             'solve_times': solve_times(summary, rows), 'starts': starts(summary, rows)}
    for name, figure in found.items():
        if figure is not None:
            yield name, figure
