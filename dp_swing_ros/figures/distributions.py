# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How the times of a campaign are distributed, not their means alone."""

from collections.abc import Mapping, Sequence
import math
from typing import Any

from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
import numpy as np

from dp_swing_ros.evaluation.campaign.rows import grouped, Row, solves
from dp_swing_ros.evaluation.campaign.summary import Summary
from dp_swing_ros.evaluation.metrics import reduced, TIME_LIMIT
from dp_swing_ros.evaluation.scenarios import SCENARIOS
from dp_swing_ros.figures.contestants import looks
from dp_swing_ros.figures.curves import mark_turns
from dp_swing_ros.figures.style import (
    ALARM, as_share, FAINT, formulas, in_numbers, INK, name_lines, panels_of, plain, styled,
    widths)
from dp_swing_ros.pendulum.state import Array, links_of, units

GOAL = 0.01      # [s] a solve should take no longer than this but for one in a hundred
RANDOM = 'random'
EACH = 7         # starts in a cell, about
COLOURS = 'cividis'


@styled
def settling(summary: Summary, rows: Sequence[Row]) -> Figure | None:
    """Draw the share of episodes that have settled by a time; None where all are sweeps."""
    names = [name for name in summary.campaign['scenarios'] if not SCENARIOS[name].sweeps]
    if not names:
        return None
    shown, duration = looks(summary.campaign), summary.campaign['duration']
    figure = Figure(figsize=(max(1.2 + 2.9 * len(names), 6.0), 3.8), layout='constrained')
    for axes, name in zip(figure.subplots(1, len(names), sharey=True, squeeze=False).flat, names):
        for (label, look), width in zip(shown.items(), widths(len(shown))):
            times = _settling_times([row for row in rows if row.key[:2] == (label, name)])
            settled = np.sort(times[~np.isnan(times)])
            shares = np.arange(len(settled) + 1) / max(len(times), 1)
            axes.step([0.0, *settled, duration], [*shares, shares[-1]], where='post',
                      linewidth=width, **look.line())
        axes.set(title=name, xlim=(0.0, duration), xlabel='settling time [s]')
        as_share(axes, 'y')
        axes.grid(True)
    figure.axes[0].set_ylabel('episodes that have settled')
    name_lines(figure, {label: look.line() for label, look in shown.items()})
    figure.suptitle('Settling: where a curve ends is the success rate')
    return figure


def _settling_times(rows: Sequence[Row]) -> Array:
    return np.array([row.metrics.settling_time for row in rows])


@styled
def solve_times(summary: Summary, rows: Sequence[Row]) -> Figure | None:
    """Draw the share of solves that took longer than a time; None where nothing was solved."""
    shown = looks(summary.campaign)
    times = {label: np.sort(solves([row for row in rows if row.key.contestant == label]))
             for label in shown}
    times = {label: found for label, found in times.items() if len(found)}
    if not times:
        return None
    figure = Figure(figsize=(8.0, 4.4), layout='constrained')
    axes = figure.subplots()
    for label, found in times.items():
        axes.step(1e3 * found, 1 - np.arange(len(found)) / len(found),
                  where='pre', **shown[label].line())
    for limit, word in ((GOAL, 'goal for 99 %'), (TIME_LIMIT, 'time limit')):
        axes.axvline(1e3 * limit, color=FAINT, linestyle='--', linewidth=1)
        axes.text(1e3 * limit, 1.12, word, ha='center', va='bottom', size=8, color=INK)
    axes.axhline(0.01, color=FAINT, linestyle='--', linewidth=1)
    axes.set(xscale='log', yscale='log', ylim=(0.5 / max(map(len, times.values())), 1.0),
             xlabel='solve time [ms]', ylabel='share of solves that took longer')
    in_numbers(axes.xaxis)
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f'{100 * value:g} %'))
    axes.grid(True)
    name_lines(figure, {label: shown[label].line() for label in times})
    figure.suptitle('Solve times')
    return figure


@styled
def starts(summary: Summary, rows: Sequence[Row]) -> Figure | None:
    """Draw the settling times over the angles of random starts, and failures; None without any."""
    found = grouped((row for row in rows if row.key.scenario == RANDOM),
                    lambda row: row.key.contestant)
    groups = {label: found[label] for label in summary.campaign['contestants'] if label in found}
    if not groups:
        return None
    columns = min(len(groups), 3)
    lines = math.ceil(len(groups) / columns)
    figure = Figure(figsize=(max(1.4 + 2.6 * columns, 4.6), 1.3 + 2.9 * lines),
                    layout='constrained')
    panels = panels_of(figure, len(groups), columns, sharex=True, sharey=True)
    scale = _scale(np.concatenate([_settling_times(group) for group in groups.values()]))
    for axes, (label, group) in zip(panels, groups.items()):
        X = np.array([_start(row, summary.campaign) for row in group])
        shown = [1, 2] if links_of(X) > 1 else [1, 3]   # two angles, or angle and speed of one
        _draw_starts(axes, label, X[:, shown], _settling_times(group), scale)
    figure.colorbar(ScalarMappable(scale, COLOURS), ax=figure.axes, extend='both', shrink=0.8,
                    label='median settling time [s]')
    for write, i in zip((figure.supxlabel, figure.supylabel), shown):
        write(f'{formulas(links_of(X))[i]} at the start [{units(links_of(X))[i]}]')
    figure.suptitle('How long a random start takes, by its angles\n'
                    '(0 is upright; crosses: not held)')
    return figure


def _start(row: Row, campaign: Mapping[str, Any]) -> tuple[float, ...]:
    """Return the state at the start, which follows from the seed."""
    seed = row.key.seed
    case, = SCENARIOS[RANDOM].cases(RANDOM, range(seed, seed + 1), 0, campaign['duration'],
                                    campaign['links'])
    return case.plant['initial_state']


def _scale(times: Array) -> Normalize:
    """Return the range of colours: that of most settling times, so that differences show."""
    low, high = (0.0, 0.0) if np.isnan(times).all() else np.nanquantile(times, (0.1, 0.9))
    return Normalize(low, max(high, low + 0.1))


def _draw_starts(axes: Axes, label: str, places: Array, times: Array, scale: Normalize) -> None:
    """
    Draw cells of starts, some in each, by the median of their settling times.

    Shapes: places (N, 2), of angles, or of an angle and its speed; times (N,) [s].
    """
    right, top = np.maximum(math.pi, np.abs(places).max(axis=0))
    failed = np.isnan(times)
    cells = min(max(round(math.sqrt(len(times) / EACH)), 1), 16)
    if not failed.all():
        from scipy.stats import binned_statistic_2d   # here: 0.4 s of loading
        medians = binned_statistic_2d(*places[~failed].T, times[~failed], 'median', cells,
                                      [(-right, right), (-top, top)]).statistic
        axes.imshow(medians.T, origin='lower', norm=scale, extent=(-right, right, -top, top),
                    cmap=COLOURS, interpolation='nearest')
    axes.plot(*places[failed].T, 'x', color=ALARM, markersize=6, markeredgewidth=1.8)
    axes.set_title(f'{plain(label)}\n{np.count_nonzero(~failed)} of {len(times)} held, median '
                   f'{reduced(np.median, times[~failed]):.2f} s', size='medium')
    axes.set(xlim=(-right, right), ylim=(-top, top), aspect='equal')
    mark_turns(axes.xaxis)
    mark_turns(axes.yaxis)
