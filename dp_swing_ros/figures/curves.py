# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States, force and times of the solver over time; `squared_error` is the paper's Fig. 3."""

import math

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MultipleLocator, NullFormatter
import numpy as np

from dp_swing_ros.figures.style import (
    ALARM, CART, COLOURS, FAINT, FORCE, legend, limit_lines, LINK1, LINK2, SQUARES, styled,
    SYMBOLS, title)
from dp_swing_ros.pendulum.state import ANGLES, Array, SIZE, to_turn_of, UPRIGHT
from dp_swing_ros.simulation.episode import Episode

ERROR_FLOOR = 1e-8  # squared errors below are drawn here: a log axis has no zero
NEAR_HANGING = 0.5  # [rad] a start this close to hanging is drawn around +π, never around -π
MOST = 5 * np.pi    # [rad] of an axis with a tick at every half turn
UPRIGHT_AT = '0, ±2π: upright'


@styled
def squared_error(episode: Episode) -> Figure:
    """Draw the squared distance of the six states from upright at rest (the paper's Fig. 3)."""
    figure = Figure(figsize=(9.6, 5.0), layout='constrained')
    panels = figure.subplots(2, 3, sharex=True)
    error = to_turn_of(episode.X, np.array(UPRIGHT)) ** 2
    for i, axes in enumerate(panels.flat):
        curve = np.maximum(error[:, i], ERROR_FLOOR)
        axes.semilogy(episode.t, curve, color=COLOURS[i])
        axes.fill_between(episode.t, ERROR_FLOOR, curve, color=COLOURS[i], alpha=0.08,
                          linewidth=0)
        if i > 0:
            bound = 0.1 if i in range(SIZE)[ANGLES] else 1.0
            axes.axhline(bound ** 2, color=FAINT, linestyle='--', linewidth=1)
        axes.set(ylim=(ERROR_FLOOR, None), ylabel=f'error of {SYMBOLS[i]} [{SQUARES[i]}]')
        axes.grid(True)
    for axes in panels[1]:
        axes.set_xlabel('time [s]')
    figure.suptitle(f'{title(episode)}: squared error of the states over time '
                    '(dashed: what counts as upright)')
    return figure


@styled
def timeline(episode: Episode) -> Figure:
    """Draw angles, position, force and the controller's times over time, one below another."""
    figure = Figure(figsize=(9.6, 8.4), layout='constrained')
    angles, position, force, times = figure.subplots(
        4, 1, sharex=True, height_ratios=(1.2, 0.8, 1.0, 1.2))
    _draw_angles(angles, episode)
    _draw_position(position, episode)
    _draw_force(force, episode)
    _draw_times(times, episode)
    for axes in (angles, position, force, times):
        axes.grid(True)
        axes.margins(x=0.01)
    times.set_xlabel('time [s]')
    figure.align_ylabels()
    figure.suptitle(f'{title(episode)}: the run over time')
    return figure


def _draw_angles(axes: Axes, episode: Episode) -> None:
    for angle, symbol, colour in zip(unwrapped(episode.X).T, SYMBOLS[ANGLES], (LINK1, LINK2)):
        axes.plot(episode.t, angle, color=colour, label=symbol)
    mark_turns(axes)
    axes.set_ylabel(f'angle [rad]\n{UPRIGHT_AT}')
    legend(axes)


def unwrapped(X: Array) -> Array:
    """
    Return the angles of a run as they turned, from a start that every picture draws alike.

    The start lies within half a turn of upright, and hanging is +π, though a sensor says -π.
    Shapes: X (N, 6) -> (N, 2) [rad].
    """
    angles = np.array(X[:, ANGLES], dtype=float)
    jumps = np.nan_to_num(np.round(np.diff(angles, axis=0) / (2 * np.pi)))
    angles[1:] -= 2 * np.pi * np.cumsum(jumps, axis=0)
    beyond = (angles[:1] - np.pi - NEAR_HANGING) / (2 * np.pi)
    return angles - 2 * np.pi * np.nan_to_num(np.ceil(beyond))


def mark_turns(axes: Axes) -> None:
    """Let an axis of angles count in π."""
    low, high = axes.get_ylim()
    axes.yaxis.set_major_locator(MultipleLocator(np.pi * math.ceil((high - low) / MOST)))
    axes.yaxis.set_major_formatter(FuncFormatter(in_turns))


def in_turns(angle: float, _: int | None = None) -> str:
    """Return an angle in multiples of π, for an axis."""
    halves = round(angle / np.pi)
    return {0: '0', 1: 'π', -1: '−π'}.get(halves, f'{halves}π'.replace('-', '−'))


def _draw_position(axes: Axes, episode: Episode) -> None:
    axes.plot(episode.t, episode.X[:, 0], color=CART, label='cart')
    limit_lines(axes, episode.limits.track_limit, 'end stops')
    axes.set_ylabel('position $x$ [m]')
    legend(axes)


def _draw_force(axes: Axes, episode: Episode) -> None:
    if len(episode.U):
        axes.stairs(episode.U, episode.t, baseline=None, color=FORCE, linewidth=1.4,
                    label='applied')
    limit_lines(axes, episode.limits.force_limit, 'limits')
    axes.set_ylabel('force $u$ [N]')
    legend(axes)


def _draw_times(axes: Axes, episode: Episode) -> None:
    ticks = episode.ticks
    late = np.asarray(ticks.late, dtype=bool)
    axes.plot(ticks.t, 1e3 * ticks.solve_time, '.', color=LINK1, markersize=4,
              label='solve time')
    axes.plot(ticks.t, 1e3 * ticks.latency, '.', color=LINK2, markersize=4,
              label='latency, state to force')
    if late.any():
        axes.plot(ticks.t[late], 1e3 * ticks.solve_time[late], 'o', color='none', markersize=8,
                  markeredgecolor=ALARM, markeredgewidth=1.6,
                  label=f'late ({np.count_nonzero(late)})')
    if len(episode.t) > 1:
        axes.axhline(1e3 * float(np.median(np.diff(episode.t))), color=FAINT, linestyle='--',
                     linewidth=1, label='period')
    in_decades(axes)
    axes.set_ylabel('time [ms]')
    legend(axes)


def in_decades(axes: Axes) -> None:
    """Let an axis be logarithmic, from a power of ten to another, without powers at its ticks."""
    axes.set_yscale('log')
    low, high = np.log10(axes.get_ylim())
    axes.set_ylim(10 ** math.floor(low), 10 ** math.ceil(high))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f'{value:g}'))
    axes.yaxis.set_minor_formatter(NullFormatter())
