# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Success rates with their intervals, and the robustness score's criteria."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np

from dp_swing_ros.campaign.scores import CRITERIA
from dp_swing_ros.campaign.summary import Standing, Summary
from dp_swing_ros.figures.contestants import as_share, Look, looks, name_contestants
from dp_swing_ros.figures.style import FAINT, INK, PAPER, styled

LINE = 0.19  # [inch] a contestant in a scenario


@styled
def successes(summary: Summary) -> Figure:
    """Draw how many episodes each contestant held in each scenario, with the 95 % intervals."""
    shown = looks(summary.campaign)
    scenarios = [name for name in summary.campaign['scenarios']
                 if any(one.scenario == name for one in summary.standings)]
    pitch = len(shown) + 0.9
    figure = Figure(figsize=(8.4, 1.3 + LINE * pitch * len(scenarios)), layout='constrained')
    axes = figure.subplots()
    for n, name in enumerate(scenarios):
        if n % 2 == 0:
            axes.axhspan(n * pitch - 0.95, (n + 1) * pitch - 0.95, color=PAPER, zorder=0)
        for place, (label, look) in enumerate(shown.items()):
            for one in summary.standings:
                if (one.scenario, one.contestant) == (name, label):
                    _draw_rate(axes, one, n * pitch + place, look)
    axes.set_yticks(pitch * np.arange(len(scenarios)) + (len(shown) - 1) / 2, scenarios)
    axes.set(ylim=(pitch * len(scenarios) - 0.95, -0.95))
    axes.tick_params('y', length=0)
    as_share(axes, 'x')
    axes.set_xlabel('episodes held upright to the end, with 95 % intervals (Wilson)')
    axes.grid(True, axis='x')
    name_contestants(figure, shown, points=True)
    figure.suptitle('Success by scenario')
    return figure


def _draw_rate(axes: Axes, one: Standing, y: float, look: Look) -> None:
    held = one.held
    axes.plot([held.low, held.high], [y, y], color=look.colour, linewidth=1.4,
              solid_capstyle='butt', alpha=0.6)
    axes.plot([held.successes / held.runs], [y], linestyle='none', markersize=4.5,
              clip_on=False, zorder=4, **look.point())
    axes.text(1.035, y, f'{held.successes} of {held.runs}', va='center', size=7.5, color=INK,
              clip_on=False)


@styled
def criteria(summary: Summary) -> Figure | None:
    """Draw the passed fraction of each robustness criterion, and their mean; None without any."""
    shown = looks(summary.campaign)
    names = [name for name in CRITERIA
             if any(name in score.criteria for score in summary.scores)]
    if not names:
        return None
    columns = [*names, 'mean'] if len(names) == len(CRITERIA) else names
    figure = Figure(figsize=(1.4 + 1.15 * len(columns), 3.9), layout='constrained')
    axes = figure.subplots()
    width = 0.8 / len(shown)
    for n, score in enumerate(summary.scores):
        look = shown[score.contestant]
        values = [score.criteria.get(name, score.robustness) for name in columns]
        x = np.arange(len(columns)) + width * (n - (len(shown) - 1) / 2)
        axes.vlines(x, 0.0, values, color=look.colour, linewidth=1.2, alpha=0.5)
        axes.plot(x, values, linestyle='none', markersize=6, zorder=4, clip_on=False,
                  **look.point())
    if 'mean' in columns:
        axes.axvspan(len(columns) - 1.5, len(columns) - 0.5, color=PAPER, zorder=0)
    for boundary in np.arange(len(columns) - 1) + 0.5:
        axes.axvline(boundary, color=FAINT, linewidth=0.5)
    axes.set_xticks(np.arange(len(columns)), [name.replace('_', '\n') for name in columns])
    axes.set(xlim=(-0.5, len(columns) - 0.5), ylabel='levels that pass')
    axes.tick_params('x', length=0)
    as_share(axes, 'y')
    axes.grid(True, axis='y')
    name_contestants(figure, shown, points=True)
    figure.suptitle('Robustness by criterion')
    return figure
