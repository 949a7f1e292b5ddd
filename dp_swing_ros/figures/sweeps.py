# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where each contestant breaks: one strip a contestant, one cell a level."""

import math

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
import numpy as np

from dp_swing_ros.campaign.scores import Level
from dp_swing_ros.campaign.summary import Summary
from dp_swing_ros.figures.contestants import Look, looks
from dp_swing_ros.figures.style import FAINT, INK, styled, tint
from dp_swing_ros.scenarios import PROFILE, SCENARIOS

COLUMNS = 3
UNITS = {sweep.parameter: sweep.unit for scenario in SCENARIOS.values()
         for sweep in scenario.sweeps}


@styled
def sweeps(summary: Summary) -> Figure | None:
    """Draw the share of episodes held at each level of each sweep; None without sweeps."""
    shown = looks(summary.campaign)
    panels: dict[tuple[str, str], dict[str, list[Level]]] = {}
    for one in summary.standings:
        for parameter, levels in one.sweeps.items():
            panels.setdefault((one.scenario, parameter), {})[one.contestant] = levels
    if not panels:
        return None
    rows = math.ceil(len(panels) / COLUMNS)
    figure = Figure(figsize=(11.0, 0.9 + rows * (0.75 + 0.2 * len(shown))), layout='constrained')
    places = figure.subplots(rows, COLUMNS, squeeze=False).flat
    for axes, ((scenario, parameter), strips) in zip(places, panels.items()):
        _draw_panel(axes, scenario, parameter, strips, shown)
    for unused in places[len(panels):]:
        unused.set_axis_off()
    figure.suptitle('Where each breaks: the stronger the colour, the more episodes of a level '
                    'were held; crossed, not more than half')
    return figure


def _draw_panel(axes: Axes, scenario: str, parameter: str, strips: dict[str, list[Level]],
                shown: dict[str, Look]) -> None:
    labels = [label for label in shown if label in strips]
    for row, label in enumerate(labels):
        _draw_strip(axes, row, strips[label], shown[label])
    values = [level.value for levels in strips.values() for level in levels]
    half = _pitch(sorted(set(values))) / 2
    axes.set(xlim=(min(values) - half, max(values) + half), ylim=(len(labels) - 0.4, -0.6))
    axes.set_yticks(range(len(labels)), labels, size=8)
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=parameter == PROFILE))
    axes.tick_params('y', length=0)
    axes.spines[:].set_visible(False)
    axes.set_title(_name(scenario, parameter), size=9, loc='left')


def _name(scenario: str, parameter: str) -> str:
    words, unit = parameter.replace('_', ' ').replace(' factor', ''), UNITS.get(parameter, '')
    if scenario == 'model' and not unit:
        return f'model: {words}, share of the nominal'
    before = f'{scenario}: ' if scenario in ('model', 'pushes') else ''
    return f'{before}{words} [{unit}]' if unit else f'{before}{words}'


def _draw_strip(axes: Axes, row: int, levels: list[Level], look: Look) -> None:
    width = _pitch([level.value for level in levels])
    shares = np.array([level.held / level.runs for level in levels])
    axes.bar([level.value for level in levels], 0.78, width, row - 0.39, linewidth=0.8,
             color=[tint(look.colour, share) for share in shares],
             edgecolor=['white' if level.passed else FAINT for level in levels])
    for level, share in zip(levels, shares):
        if not level.passed:
            axes.plot([level.value], [row], 'x', color=INK, markersize=3, markeredgewidth=0.8)


def _pitch(values: list[float]) -> float:
    """Return the distance of neighbouring levels."""
    return values[1] - values[0] if len(values) > 1 else 1.0
