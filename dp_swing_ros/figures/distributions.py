# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How settling times and solve times are distributed, not their means alone."""

from collections.abc import Sequence

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
import numpy as np

from dp_swing_ros.evaluation.campaign.rows import Row, solves
from dp_swing_ros.evaluation.campaign.summary import Summary
from dp_swing_ros.evaluation.metrics import TIME_LIMIT
from dp_swing_ros.evaluation.scenarios import SCENARIOS
from dp_swing_ros.figures.contestants import as_share, looks, name_contestants
from dp_swing_ros.figures.style import FAINT, in_numbers, INK, styled, widths

GOAL = 0.01  # [s] a solve should take no longer than this but for one in a hundred


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
            times = np.array([row.metrics.settling_time for row in rows
                              if row.key[:2] == (label, name)])
            settled = np.sort(times[~np.isnan(times)])
            shares = np.arange(len(settled) + 1) / max(len(times), 1)
            axes.step([0.0, *settled, duration], [*shares, shares[-1]], where='post',
                      linewidth=width, **look.line())
        axes.set(title=name, xlim=(0.0, duration), xlabel='settling time [s]')
        as_share(axes, 'y')
        axes.grid(True)
    figure.axes[0].set_ylabel('episodes that have settled')
    name_contestants(figure, shown)
    figure.suptitle('Settling: where a curve ends is the success rate')
    return figure


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
    name_contestants(figure, {label: shown[label] for label in times})
    figure.suptitle('Solve times')
    return figure
