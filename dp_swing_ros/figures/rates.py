# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Success rates with their intervals, by scenario, and as the plant gets worse."""

import math
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np

from dp_swing_ros.evaluation.campaign.summary import Summary
from dp_swing_ros.evaluation.comparison import Rate
from dp_swing_ros.evaluation.scenarios import SCENARIOS
from dp_swing_ros.figures.contestants import as_share, Look, looks, name_contestants
from dp_swing_ros.figures.style import FAINT, INK, PAPER, styled

LINE = 0.19  # [inch] a contestant in a scenario


@styled
def successes(summary: Summary) -> Figure:
    """Draw how many episodes each contestant held in each scenario, with the 95 % intervals."""
    shown = looks(summary.campaign)
    scenarios = _with_standings(summary)
    pitch = len(shown) + 0.9
    figure = Figure(figsize=(8.4, 1.3 + LINE * pitch * len(scenarios)), layout='constrained')
    axes = figure.subplots()
    for n, name in enumerate(scenarios):
        if n % 2 == 0:
            axes.axhspan(n * pitch - 0.95, (n + 1) * pitch - 0.95, color=PAPER, zorder=0)
        for place, (label, look) in enumerate(shown.items()):
            for one in summary.standings:
                if (one.scenario, one.contestant) == (name, label):
                    y = n * pitch + place
                    _draw_rate(axes, one.held, look, 'x', y)
                    axes.text(1.035, y, f'{one.held.successes} of {one.held.runs}', va='center',
                              size='small', color=INK, clip_on=False)
    axes.set_yticks(pitch * np.arange(len(scenarios)) + (len(shown) - 1) / 2, scenarios)
    axes.set(ylim=(pitch * len(scenarios) - 0.95, -0.95))
    axes.tick_params('y', length=0)
    as_share(axes, 'x')
    axes.set_xlabel('episodes held upright to the end, with 95 % intervals (Wilson)')
    axes.grid(True, axis='x')
    name_contestants(figure, shown, points=True)
    figure.suptitle('Success by scenario')
    return figure


def _with_standings(summary: Summary) -> list[str]:
    return [name for name in summary.campaign['scenarios']
            if any(one.scenario == name for one in summary.standings)]


def _draw_rate(axes: Axes, held: Rate, look: Look, along: str, place: float) -> None:
    """Draw a share on its interval along one axis, at a place on the other."""
    def plot(shares: list[float], **line: Any) -> None:
        places = [place] * len(shares)
        axes.plot(*((shares, places) if along == 'x' else (places, shares)), clip_on=False, **line)

    plot([held.low, held.high], color=look.colour, linewidth=1.4, solid_capstyle='butt')
    plot([held.successes / held.runs], linestyle='none', markersize=4.7, zorder=4, **look.point())


@styled
def criteria(summary: Summary) -> Figure | None:
    """Draw the episodes held over each way that the plant gets worse; None without any."""
    scenarios = [name for name in _with_standings(summary)
                 if SCENARIOS[name].sweeps or SCENARIOS[name].criterion]
    if not scenarios:
        return None
    shown = looks(summary.campaign)
    figure = Figure(figsize=(1.6 + 1.2 * len(scenarios), 4.2), layout='constrained')
    axes = figure.subplots()
    width = 0.74 / len(shown)
    for one in summary.standings:
        if one.scenario in scenarios:
            place = list(shown).index(one.contestant) - (len(shown) - 1) / 2
            _draw_rate(axes, one.held, shown[one.contestant], 'y',
                       scenarios.index(one.scenario) + width * place)
    for boundary in np.arange(len(scenarios) - 1) + 0.5:
        axes.axvline(boundary, color=FAINT, linewidth=0.5)
    axes.set_xticks(np.arange(len(scenarios)), [_range(name) for name in scenarios])
    axes.set(xlim=(-0.5, len(scenarios) - 0.5),
             ylabel='episodes held over all levels,\nwith 95 % intervals (Wilson)')
    axes.tick_params('x', length=0)
    as_share(axes, 'y')
    axes.grid(True, axis='y')
    name_contestants(figure, shown, points=True, words={
        score.contestant: f'{score.contestant}, robustness {score.robustness:.3f}'
        for score in summary.scores if not math.isnan(score.robustness)})
    figure.suptitle('Who still holds the pendulum as the plant gets worse')
    return figure


def _range(name: str) -> str:
    """Return the name of a scenario, and what its first sweep goes through."""
    words = name.replace('_', '\n')
    if not SCENARIOS[name].sweeps:
        return words
    sweep = SCENARIOS[name].sweeps[0]
    between = ' ' if len(sweep.unit) < 3 else '\n'
    return f'{words}\n{sweep.low:g} to {sweep.high:g}{between}{sweep.unit}'.rstrip()
