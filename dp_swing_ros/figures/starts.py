# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What came of each random start, over the angles that it began with."""

from collections.abc import Mapping, Sequence
import math
from typing import Any

from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
import numpy as np
from scipy.stats import binned_statistic_2d

from dp_swing_ros.evaluation.campaign.rows import Row
from dp_swing_ros.evaluation.campaign.summary import Summary
from dp_swing_ros.evaluation.scenarios import SCENARIOS
from dp_swing_ros.figures.curves import mark_turns
from dp_swing_ros.figures.style import ALARM, formulas, panels_of, plain, styled
from dp_swing_ros.pendulum.state import Array, links_of, units

SCENARIO = 'random'
EACH = 7         # starts in a cell, about
COLOURS = 'cividis'


@styled
def starts(summary: Summary, rows: Sequence[Row]) -> Figure | None:
    """Draw the settling times over the angles of random starts, and failures; None without any."""
    groups: dict[str, list[Row]] = {}
    for label in summary.campaign['contestants']:
        group = [row for row in rows if row.key[:2] == (label, SCENARIO)]
        if group:
            groups[label] = group
    if not groups:
        return None
    columns = min(len(groups), 3)
    lines = math.ceil(len(groups) / columns)
    figure = Figure(figsize=(max(1.4 + 2.6 * columns, 4.6), 1.3 + 2.9 * lines),
                    layout='constrained')
    panels = panels_of(figure, len(groups), columns, sharex=True, sharey=True)
    scale = _scale([row for group in groups.values() for row in group])
    for axes, (label, group) in zip(panels, groups.items()):
        X = np.array([_start(row, summary.campaign) for row in group])
        shown = [1, 2] if links_of(X) > 1 else [1, 3]   # two angles, or angle and speed of one
        _draw_starts(axes, label, group, X[:, shown], scale)
    figure.colorbar(ScalarMappable(scale, COLOURS), ax=figure.axes, extend='both', shrink=0.8,
                    label='median settling time [s]')
    for write, i in zip((figure.supxlabel, figure.supylabel), shown):
        write(f'{formulas(links_of(X))[i]} at the start [{units(links_of(X))[i]}]')
    figure.suptitle('How long a random start takes, by its angles\n'
                    '(0 is upright; crosses: not held)')
    return figure


def _scale(rows: Sequence[Row]) -> Normalize:
    """Return the range of colours: that of most settling times, so that differences show."""
    times = [row.metrics.settling_time for row in rows]
    known = np.array([time for time in times if not math.isnan(time)] or [0.0])
    low, high = np.quantile(known, (0.1, 0.9))
    return Normalize(low, max(high, low + 0.1))


def _draw_starts(axes: Axes, label: str, group: Sequence[Row], places: Array,
                 scale: Normalize) -> None:
    """
    Draw cells of starts, some in each, by the median of their settling times.

    Shapes: places (N, 2), of angles, or of an angle and its speed.
    """
    ends = np.maximum(math.pi, np.abs(places).max(axis=0))
    times = np.array([row.metrics.settling_time for row in group])
    failed = np.isnan(times)
    cells = min(max(round(math.sqrt(len(group) / EACH)), 1), 16)
    if not failed.all():
        medians = binned_statistic_2d(*places[~failed].T, times[~failed], 'median', cells,
                                      [(-end, end) for end in ends]).statistic
        axes.imshow(medians.T, origin='lower', norm=scale,
                    extent=(-ends[0], ends[0], -ends[1], ends[1]),
                    cmap=COLOURS, interpolation='nearest')
    axes.plot(*places[failed].T, 'x', color=ALARM, markersize=6, markeredgewidth=1.8)
    axes.set_title(f'{plain(label)}\n{np.count_nonzero(~failed)} of {len(group)} held, median '
                   f'{np.median(times[~failed]) if not failed.all() else math.nan:.2f} s',
                   size='medium')
    axes.set(xlim=(-ends[0], ends[0]), ylim=(-ends[1], ends[1]), aspect='equal')
    mark_turns(axes.xaxis)
    mark_turns(axes.yaxis)


def _start(row: Row, campaign: Mapping[str, Any]) -> tuple[float, ...]:
    """Return the state at the start, which follows from the seed."""
    seed = row.key.seed
    case, = SCENARIOS[SCENARIO].cases(SCENARIO, range(seed, seed + 1), 0, campaign['duration'],
                                      campaign['links'])
    return case.plant['initial_state']
