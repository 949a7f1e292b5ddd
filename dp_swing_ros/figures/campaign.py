# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pictures of a campaign: how many episodes were held, and how long that took."""

from collections.abc import Iterator, Mapping, Sequence
import math
from typing import Any

from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator
import numpy as np

from dp_swing_ros.evaluation.campaign.rows import grouped, Row, solves
from dp_swing_ros.evaluation.campaign.summary import Level, Summary
from dp_swing_ros.evaluation.comparison import Rate
from dp_swing_ros.evaluation.metrics import reduced, TIME_LIMIT
from dp_swing_ros.evaluation.scenarios import PERIOD, PROFILE, SCENARIOS, sized
from dp_swing_ros.figures.curves import mark_turns
from dp_swing_ros.figures.style import (
    ALARM, as_share, FAINT, formulas, in_numbers, INK, looks, name_lines, PALETTE, panels_of,
    PAPER, plain, styled, widths)
from dp_swing_ros.parameters import group
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import Array, links_of, units

LINE = 0.19      # [inch] a contestant in a scenario
POINT: dict[str, Any] = {'markersize': 4.7, 'markevery': [1], 'clip_on': False,
                         'solid_capstyle': 'butt', 'zorder': 4}
UNITS = {sweep.parameter: sweep.unit for scenario in SCENARIOS.values()
         for sweep in scenario.sweeps}
# what the numbers are that have no unit
MEASURES = {PROFILE: 'number', 'state_loss': 'share', 'command_loss': 'share',
            'actuator_response': 'share of the way in a step'}
SHARES = LinearSegmentedColormap.from_list('shares', ['white', PALETTE[0]])
GOAL = 0.01      # [s] a solve should take no longer than this but for one in a hundred
RANDOM = 'random'
EACH = 7         # random starts in a cell, about
COLOURS = 'cividis'  # of their settling times


def of_campaign(summary: Summary, rows: Sequence[Row]) -> Iterator[tuple[str, Figure]]:
    """Yield the pictures of a campaign that has something to show in them, with their names."""
    found = {'successes': successes(summary), 'criteria': criteria(summary),
             'sweeps': sweeps(summary), 'settling': settling(summary, rows),
             'solve_times': solve_times(summary, rows), 'starts': starts(summary, rows)}
    for name, figure in found.items():
        if figure is not None:
            yield name, figure


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
        axes.plot(_interval(one.held), [y] * 3, **POINT, **shown[one.contestant].mark)
        axes.text(1.035, y, f'{one.held.successes} of {one.held.runs}', va='center',
                  size='small', color=INK, clip_on=False)
    axes.set_yticks(pitch * np.arange(len(scenarios)) + (len(shown) - 1) / 2, scenarios)
    axes.set(ylim=(pitch * len(scenarios) - 0.95, -0.95))
    axes.tick_params('y', length=0)
    as_share(axes, 'x')
    axes.set_xlabel('episodes held upright to the end, with 95 % intervals (Wilson)')
    axes.grid(True, axis='x')
    name_lines(figure, {label: look.mark for label, look in shown.items()})
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
        axes.plot([x] * 3, _interval(one.held), **POINT, **shown[one.contestant].mark)
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
    name_lines(figure, {label + robustness.get(label, ''): look.mark
                        for label, look in shown.items()}, entry=2.4)
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
    rows, strips = math.ceil(len(panels) / 2), len(summary.campaign['contestants'])
    figure = Figure(figsize=(8.4, 1.0 + rows * (0.75 + 0.17 * strips)), layout='constrained')
    places = panels_of(figure, len(panels), columns=2)
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


@styled
def settling(summary: Summary, rows: Sequence[Row]) -> Figure | None:
    """Draw the share of episodes that have settled by a time; None where all are sweeps."""
    names = [name for name in summary.campaign['scenarios'] if not SCENARIOS[name].sweeps]
    if not names:
        return None
    shown = looks(summary.campaign)
    figure = Figure(figsize=(max(1.2 + 2.9 * len(names), 6.0), 3.8), layout='constrained')
    for axes, name in zip(figure.subplots(1, len(names), sharey=True, squeeze=False).flat, names):
        played = [row for row in rows if row.key.scenario == name]
        end = _duration(played, name, summary.campaign)
        for (label, look), width in zip(shown.items(), widths(len(shown))):
            times = _settling_times([row for row in played if row.key.contestant == label])
            settled = np.sort(times[~np.isnan(times)])
            shares = np.arange(len(settled) + 1) / max(len(times), 1)
            axes.step([0.0, *settled, end], [*shares, shares[-1]], where='post',
                      linewidth=width, **look.line)
        axes.set(title=name, xlim=(0.0, end), xlabel='settling time [s]')
        as_share(axes, 'y')
        axes.grid(True)
    figure.axes[0].set_ylabel('episodes that have settled')
    name_lines(figure, {label: look.line for label, look in shown.items()})
    figure.suptitle('Settling: where a curve ends is the success rate')
    return figure


def _duration(rows: Sequence[Row], name: str, campaign: Mapping[str, Any]) -> float:
    """Return how long the longest episodes of a scenario are [s]."""
    known = [row.metrics.duration for row in rows if not math.isnan(row.metrics.duration)]
    return max(known) if known else SCENARIOS[name].times * float(campaign['duration'])


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
                  where='pre', **shown[label].line)
    for limit, word in ((GOAL, 'goal for 99 %'), (TIME_LIMIT, 'time limit')):
        axes.axvline(1e3 * limit, color=FAINT, linestyle='--', linewidth=1)
        axes.text(1e3 * limit, 1.12, word, ha='center', va='bottom', size=8, color=INK)
    axes.axhline(0.01, color=FAINT, linestyle='--', linewidth=1)
    axes.set(xscale='log', yscale='log', ylim=(0.5 / max(map(len, times.values())), 1.0),
             xlabel='solve time [ms]', ylabel='share of solves that took longer')
    in_numbers(axes.xaxis)
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f'{100 * value:g} %'))
    axes.grid(True)
    name_lines(figure, {label: shown[label].line for label in times})
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
    scale = _scale(np.concatenate([_settling_times(own) for own in groups.values()]))
    for axes, (label, own) in zip(panels, groups.items()):
        X = np.array([_start(row, summary.campaign) for row in own])
        shown = [1, 2] if links_of(X) > 1 else [1, 3]   # two angles, or angle and speed of one
        _draw_starts(axes, label, X[:, shown], _settling_times(own), scale)
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
    mpc = campaign['contestants'][row.key.contestant]['mpc']
    of = group(PendulumParameters, {'links': campaign['links'], **mpc})
    return sized(case, of, PERIOD).plant['initial_state']


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
