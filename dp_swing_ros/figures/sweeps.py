# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where each contestant breaks: one strip a contestant, one cell a level."""

import math

from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
import numpy as np

from dp_swing_ros.evaluation.campaign.scores import Level
from dp_swing_ros.evaluation.campaign.summary import Summary
from dp_swing_ros.evaluation.scenarios import PROFILE, SCENARIOS
from dp_swing_ros.figures.contestants import looks
from dp_swing_ros.figures.style import FAINT, PALETTE, panels_of, plain, styled

COLUMNS = 2
UNITS = {sweep.parameter: sweep.unit for scenario in SCENARIOS.values()
         for sweep in scenario.sweeps}
# what the numbers are that have no unit
MEASURES = {PROFILE: 'number', 'state_loss': 'share', 'command_loss': 'share',
            'actuator_response': 'share of the way in a step'}
SHARES = LinearSegmentedColormap.from_list('shares', ['white', PALETTE[0]])


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
    figure = Figure(figsize=(8.4, 1.0 + rows * (0.75 + 0.17 * len(shown))), layout='constrained')
    places = panels_of(figure, len(panels), COLUMNS)
    for axes, ((scenario, parameter), strips) in zip(places, panels.items()):
        _draw_panel(axes, scenario, parameter, strips, list(shown))
    bar = figure.colorbar(ScalarMappable(Normalize(0.0, 1.0), SHARES), ax=figure.axes,
                          location='bottom', aspect=60, shrink=0.6, fraction=0.02, pad=0.01,
                          label='episodes held at a level; with more than half, it passes')
    bar.set_ticks([0.0, 0.5, 1.0], labels=['0', '50', '100 %'])
    figure.suptitle('Where each breaks')
    return figure


def _draw_panel(axes: Axes, scenario: str, parameter: str, strips: dict[str, list[Level]],
                contestants: list[str]) -> None:
    labels = [label for label in contestants if label in strips]
    for row, label in enumerate(labels):
        _draw_strip(axes, row, strips[label])
    values = [level.value for levels in strips.values() for level in levels]
    half = _pitch(sorted(set(values))) / 2
    axes.set(xlim=(min(values) - half, max(values) + half), ylim=(len(labels) - 0.4, -0.6))
    axes.set_yticks(range(len(labels)), [plain(label) for label in labels])
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=parameter == PROFILE))
    axes.tick_params('y', length=0)
    axes.spines[:].set_visible(False)
    axes.set_title(_name(scenario, parameter), size='medium', loc='left')


def _name(scenario: str, parameter: str) -> str:
    words = parameter.replace('_', ' ').replace(' factor', '')
    unit = UNITS.get(parameter) or MEASURES.get(parameter, 'of the nominal')
    before = f'{scenario}: ' if scenario in ('model', 'pushes') else ''
    return f'{before}{words} [{unit}]'


def _draw_strip(axes: Axes, row: int, levels: list[Level]) -> None:
    width = _pitch([level.value for level in levels])
    shares = np.array([level.held / level.runs for level in levels])
    axes.bar([level.value for level in levels], 0.8, width, row - 0.4, linewidth=0.5,
             color=SHARES(shares), edgecolor=FAINT)


def _pitch(values: list[float]) -> float:
    """Return the distance of neighbouring levels."""
    return values[1] - values[0] if len(values) > 1 else 1.0
