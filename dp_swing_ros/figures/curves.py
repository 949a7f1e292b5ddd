# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States, force and times of the solver over time; `squared_error` is the paper's Fig. 3."""

from collections.abc import Mapping
from itertools import cycle, product
import math
from typing import Any

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MultipleLocator
import numpy as np

from dp_swing_ros.figures.style import (
    ALARM, CART, DASHES, FAINT, FORCE, formulas, in_decades, in_numbers, INK, input_name, legend,
    limit_lines, LINKS, name_lines, PALETTE, solver_name, styled, widths)
from dp_swing_ros.pendulum.equations import scale_of
from dp_swing_ros.pendulum.state import angles, Array, links_of, SLOW, units, UPRIGHT
from dp_swing_ros.pendulum.units import SAME, scaled_speeds, Units
from dp_swing_ros.simulation.episode import Episode

ERROR_FLOOR = 1e-8  # scaled squared errors below are drawn here: a log axis has no zero
NEAR_HANGING = 0.5  # [rad] a start this close to hanging is drawn around +π, never around -π
MOST = 5 * np.pi    # [rad] of an axis with a tick at every half turn
# colours of runs over each other; where there are more runs, their lines differ
RUNS = (*PALETTE[:4], INK, *PALETTE[4:])
LETTER = 0.09       # [inch] of their legend, about


@styled
def squared_error(episode: Episode) -> Figure:
    """Draw the squared distance of the states from upright at rest (the paper's Fig. 3)."""
    links, scale = links_of(episode.X), scale_of(episode.physical)
    figure = Figure(figsize=(3.2 * (links + 1), 5.0), layout='constrained')
    panels = figure.subplots(2, links + 1, sharex=True)
    errors = episode.errors.T ** 2
    for axes, error, unit, colour in zip(panels.flat, errors, units(links),
                                         (CART, *LINKS[:links]) * 2):
        floor = _floor(scale, unit)
        curve = np.maximum(error, floor)
        axes.semilogy(episode.t, curve, color=colour)
        axes.fill_between(episode.t, floor, curve, color=colour, alpha=0.08, linewidth=0)
    name_errors(panels, scale)
    figure.suptitle(f'{solver_name(episode.solver)}: squared error of the states over time '
                    '(dashed: what counts as upright)')
    return figure


def name_errors(panels: Array, scale: Units = SAME) -> None:
    """Name the squared errors that panels (2, n + 1) show, and mark what counts as upright."""
    links = panels.shape[1] - 1
    bounds = (math.nan, *[UPRIGHT] * links, *scaled_speeds(SLOW, scale, links))
    for axes, symbol, unit, bound in zip(panels.flat, formulas(links), units(links), bounds):
        if not math.isnan(bound):
            axes.axhline(bound ** 2, color=FAINT, linestyle='--', linewidth=1)
        square = '/'.join(f'{part}²' for part in unit.split('/'))
        axes.set(yscale='log', ylim=(_floor(scale, unit), None),
                 ylabel=f'error of {symbol} [{square}]')
        axes.grid(True)
    for axes in panels[1]:
        axes.set_xlabel('time [s]')


def _floor(scale: Units, unit: str) -> float:
    """Return the least squared error that is drawn of a state in a unit."""
    return ERROR_FLOOR * scale.factor(unit) ** 2


@styled
def timeline(episode: Episode) -> Figure:
    """Draw angles, position, force and the controller's times over time, one below another."""
    figure = Figure(figsize=(9.6, 8.4), layout='constrained')
    panels = figure.subplots(4, 1, sharex=True, height_ratios=(1.2, 0.8, 1.0, 1.2))
    of_angles, position, force, times = panels
    for angle, symbol, colour in zip(unwrapped(episode.X).T, formulas(links_of(episode.X))[1:],
                                     LINKS):
        of_angles.plot(episode.t, angle, color=colour, label=symbol)
    name_angles(of_angles, 'angle')
    _draw_position(position, episode, color=CART, label='cart')
    limit_lines(position, episode.limits.track_limit, 'end stops')
    _draw_force(force, episode, color=FORCE, linewidth=1.4, label='applied')
    limit_lines(force, episode.limits.applied_limit(episode.bodies.drive), 'limits')
    _draw_times(times, episode)
    for axes in panels:
        legend(axes)
    _finish(figure, panels)
    figure.suptitle(f'{solver_name(episode.solver)}: the run over time')
    return figure


def _draw_position(axes: Axes, episode: Episode, **look: Any) -> None:
    axes.plot(episode.t, episode.X[:, 0], **look)
    axes.set_ylabel('position $x$ [m]')


def _draw_force(axes: Axes, episode: Episode, **look: Any) -> None:
    if len(episode.U):
        axes.stairs(episode.U, episode.t, baseline=None, **look)
    axes.set_ylabel(input_name(episode.bodies.drive, '$u$ '))


def _draw_times(axes: Axes, episode: Episode) -> None:
    ticks = episode.ticks
    axes.plot(ticks.t, 1e3 * ticks.solve_time, '.', color=PALETTE[0], markersize=4,
              label='solve time')
    axes.plot(ticks.t, 1e3 * ticks.latency, '.', color=PALETTE[1], markersize=4,
              label='latency, state to force')
    if ticks.late.any():
        axes.plot(ticks.t[ticks.late], 1e3 * ticks.solve_time[ticks.late], 'o', color='none',
                  markersize=8, markeredgecolor=ALARM, markeredgewidth=1.6,
                  label=f'late ({np.count_nonzero(ticks.late)})')
    if len(episode.t) > 1:
        axes.axhline(1e3 * float(np.median(np.diff(episode.t))), color=FAINT, linestyle='--',
                     linewidth=1, label='period')
    in_decades(axes)
    in_numbers(axes.yaxis)
    axes.set_ylabel('time [ms]')


def _finish(figure: Figure, panels: Array) -> None:
    """Lay a grid under panels that share one axis of time."""
    for axes in panels:
        axes.grid(True)
        axes.margins(x=0.01)
    panels[-1].set_xlabel('time [s]')
    figure.align_ylabels()


@styled
def overlay(episodes: Mapping[str, Episode]) -> Figure:
    """
    Draw angles, position, force and solve times of runs over time, a colour for each name.

    Runs may be of pendulums with different numbers of links.
    """
    runs = episodes.values()
    links = max(episode.physical.links for episode in runs)
    figure = Figure(figsize=(9.6, 5.4 + 2.1 * links), layout='constrained')
    panels = figure.subplots(links + 3, 1, sharex=True,
                             height_ratios=[*[1.1] * links, 0.9, 1.0, 1.0])
    *of_angles, position, force, times = panels
    looks: dict[str, dict[str, Any]] = {
        name: {'color': colour, 'linestyle': dash}
        for name, (dash, colour) in zip(episodes, cycle(product(DASHES, RUNS)))}
    for episode, look, width in zip(runs, looks.values(), widths(len(runs))):
        for axes, angle in zip(of_angles, unwrapped(episode.X).T):
            axes.plot(episode.t, angle, linewidth=width, **look)
        _draw_position(position, episode, linewidth=width, **look)
        _draw_force(force, episode, linewidth=width, **look)
        times.plot(episode.ticks.t, 1e3 * episode.ticks.solve_time, '.', markersize=4,
                   color=look['color'])
    for axes, symbol in zip(of_angles, formulas(links)[1:]):
        name_angles(axes, symbol)
    for limits, drive in {(episode.limits, episode.bodies.drive) for episode in runs}:
        limit_lines(position, limits.track_limit)
        limit_lines(force, limits.applied_limit(drive))
    force.set_ylabel(' or\n'.join(dict.fromkeys(
        input_name(episode.bodies.drive, '$u$ ') for episode in runs)))
    times.set_ylabel('solve time [ms]')
    if any(np.any(episode.ticks.solve_time > 0) for episode in runs):
        in_decades(times)
        in_numbers(times.yaxis)
    _finish(figure, panels)
    name_lines(figure, {name: {**look, 'linewidth': 2.4} for name, look in looks.items()},
               'upper left', 0.6 + LETTER * max(map(len, episodes)))
    return figure


def unwrapped(X: Array) -> Array:
    """
    Return the angles of a run as they turned, from a start that every picture draws alike.

    The start lies within half a turn of upright, and hanging is +π, though a sensor may
    measure -π.
    Shapes: X (N, 2n + 2) -> (N, n) [rad].
    """
    turned = np.array(X[:, angles(X)], dtype=float)
    for angle in turned.T:
        known = np.isfinite(angle)
        angle[known] = np.unwrap(angle[known])
    beyond = (turned[:1] - np.pi - NEAR_HANGING) / (2 * np.pi)
    return turned - 2 * np.pi * np.nan_to_num(np.ceil(beyond))


def name_angles(axes: Axes, name: str) -> None:
    """Name the angles that axes show, and let them count in π."""
    mark_turns(axes.yaxis)
    axes.set_ylabel(f'{name} [rad]\n0, ±2π: upright')


def mark_turns(axis: Axis) -> None:
    """Let an axis of angles count in π."""
    low, high = axis.get_view_interval()
    axis.set_major_locator(MultipleLocator(np.pi * math.ceil((high - low) / MOST)))
    axis.set_major_formatter(FuncFormatter(_in_turns))


def _in_turns(angle: float, _: int) -> str:
    halves = round(angle / np.pi)
    return {0: '0', 1: 'π', -1: '−π'}.get(halves, f'{halves}π'.replace('-', '−'))
