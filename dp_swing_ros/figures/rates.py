# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How many episodes of a campaign were held: by scenario, and as the plant gets worse."""

import math
from typing import Any

from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
import numpy as np

from dp_swing_ros.evaluation.campaign.scores import Level
from dp_swing_ros.evaluation.campaign.summary import Summary
from dp_swing_ros.evaluation.comparison import Rate
from dp_swing_ros.evaluation.scenarios import PROFILE, SCENARIOS
from dp_swing_ros.figures.contestants import looks
from dp_swing_ros.figures.style import (
    as_share, FAINT, INK, name_lines, PALETTE, panels_of, PAPER, plain, styled)

LINE = 0.19    # [inch] a contestant in a scenario
POINT: dict[str, Any] = {'markersize': 4.7, 'markevery': [1], 'clip_on': False,
                         'solid_capstyle': 'butt', 'zorder': 4}
COLUMNS = 2    # of sweeps
UNITS = {sweep.parameter: sweep.unit for scenario in SCENARIOS.values()
         for sweep in scenario.sweeps}
# what the numbers are that have no unit
MEASURES = {PROFILE: 'number', 'state_loss': 'share', 'command_loss': 'share',
            'actuator_response': 'share of the way in a step'}
SHARES = LinearSegmentedColormap.from_list('shares', ['white', PALETTE[0]])


@styled
def successes(summary: Summary) -> Figure:
    """Draw how many episodes each contestant held in each scenario, with the 95 % intervals."""
    shown = looks(summary.campaign)
    scenarios = list(dict.fromkeys(one.scenario for one in summary.standings))
    pitch = len(shown) + 0.9
    figure = Figure(figsize=(8.4, 1.3 + LINE * pitch * len(scenarios)), layout='constrained')
    axes = figure.subplots()
    for n in range(0, len(scenarios), 2):
        axes.axhspan(n * pitch - 0.95, (n + 1) * pitch - 0.95, color=PAPER, zorder=0)
    for one in summary.standings:
        y = pitch * scenarios.index(one.scenario) + list(shown).index(one.contestant)
        axes.plot(_interval(one.held), [y] * 3, **POINT, **shown[one.contestant].mark())
        axes.text(1.035, y, f'{one.held.successes} of {one.held.runs}', va='center',
                  size='small', color=INK, clip_on=False)
    axes.set_yticks(pitch * np.arange(len(scenarios)) + (len(shown) - 1) / 2, scenarios)
    axes.set(ylim=(pitch * len(scenarios) - 0.95, -0.95))
    axes.tick_params('y', length=0)
    as_share(axes, 'x')
    axes.set_xlabel('episodes held upright to the end, with 95 % intervals (Wilson)')
    axes.grid(True, axis='x')
    name_lines(figure, {label: look.mark() for label, look in shown.items()})
    figure.suptitle('Success by scenario')
    return figure


def _interval(held: Rate) -> list[float]:
    """Return a share between the ends of its interval."""
    return [held.low, held.successes / held.runs, held.high]


@styled
def criteria(summary: Summary) -> Figure | None:
    """Draw the episodes held over each way that the plant gets worse; None without any."""
    standings = [one for one in summary.standings
                 if SCENARIOS[one.scenario].sweeps or SCENARIOS[one.scenario].criterion]
    if not standings:
        return None
    shown = looks(summary.campaign)
    scenarios = list(dict.fromkeys(one.scenario for one in standings))
    figure = Figure(figsize=(1.6 + 1.2 * len(scenarios), 4.2), layout='constrained')
    axes = figure.subplots()
    for one in standings:
        place = list(shown).index(one.contestant) - (len(shown) - 1) / 2
        x = scenarios.index(one.scenario) + 0.74 / len(shown) * place
        axes.plot([x] * 3, _interval(one.held), **POINT, **shown[one.contestant].mark())
    for boundary in np.arange(len(scenarios) - 1) + 0.5:
        axes.axvline(boundary, color=FAINT, linewidth=0.5)
    axes.set_xticks(np.arange(len(scenarios)), [_range(name) for name in scenarios])
    axes.set(xlim=(-0.5, len(scenarios) - 0.5),
             ylabel='episodes held over all levels,\nwith 95 % intervals (Wilson)')
    axes.tick_params('x', length=0)
    as_share(axes, 'y')
    axes.grid(True, axis='y')
    robustness = {score.contestant: f', robustness {score.robustness:.3f}'
                  for score in summary.scores if not math.isnan(score.robustness)}
    name_lines(figure, {label + robustness.get(label, ''): look.mark()
                        for label, look in shown.items()}, entry=2.1)
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


@styled
def sweeps(summary: Summary) -> Figure | None:
    """Draw the share of episodes held at each level of each sweep; None without sweeps."""
    panels: dict[tuple[str, str], dict[str, list[Level]]] = {}
    for one in summary.standings:
        for parameter, levels in one.sweeps.items():
            panels.setdefault((one.scenario, parameter), {})[one.contestant] = levels
    if not panels:
        return None
    rows, strips = math.ceil(len(panels) / COLUMNS), len(summary.campaign['contestants'])
    figure = Figure(figsize=(8.4, 1.0 + rows * (0.75 + 0.17 * strips)), layout='constrained')
    places = panels_of(figure, len(panels), COLUMNS)
    for axes, ((scenario, parameter), found) in zip(places, panels.items()):
        _draw_sweep(axes, found)
        axes.xaxis.set_major_locator(MaxNLocator(6, integer=parameter == PROFILE))
        axes.set_title(_title(scenario, parameter), size='medium', loc='left')
    bar = figure.colorbar(ScalarMappable(Normalize(0.0, 1.0), SHARES), ax=figure.axes,
                          location='bottom', aspect=60, shrink=0.6, fraction=0.02, pad=0.01,
                          label='episodes held at a level; with more than half, it passes')
    bar.set_ticks([0.0, 0.5, 1.0], labels=['0', '50', '100 %'])
    figure.suptitle('Where each breaks')
    return figure


def _draw_sweep(axes: Axes, strips: dict[str, list[Level]]) -> None:
    """Draw one strip a contestant, one cell a level."""
    for row, levels in enumerate(strips.values()):
        values = [level.value for level in levels]
        shares = np.array([level.held / level.runs for level in levels])
        axes.bar(values, 0.8, _pitch(values), row - 0.4, linewidth=0.5, color=SHARES(shares),
                 edgecolor=FAINT)
    all_values = sorted({level.value for levels in strips.values() for level in levels})
    half = _pitch(all_values) / 2
    axes.set(xlim=(all_values[0] - half, all_values[-1] + half), ylim=(len(strips) - 0.4, -0.6))
    axes.set_yticks(range(len(strips)), [plain(label) for label in strips])
    axes.tick_params('y', length=0)
    axes.spines[:].set_visible(False)


def _pitch(values: list[float]) -> float:
    """Return the distance of neighbouring levels."""
    return values[1] - values[0] if len(values) > 1 else 1.0


def _title(scenario: str, parameter: str) -> str:
    words = parameter.replace('_', ' ').replace(' factor', '')
    unit = UNITS.get(parameter) or MEASURES.get(parameter, 'of the nominal')
    before = f'{scenario}: ' if scenario in ('model', 'pushes') else ''
    return f'{before}{words} [{unit}]'
