# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What each solver would have done from a recorded tick on, and what that would have cost."""

from collections.abc import Sequence
import math
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter
import numpy as np

from dp_swing_ros.figures.contestants import colours
from dp_swing_ros.figures.curves import mark_turns, unwrapped, UPRIGHT_AT
from dp_swing_ros.figures.style import (
    FAINT, INK, legend, limit_lines, plain, SOLVERS, styled, SYMBOLS)
from dp_swing_ros.pendulum.parameters import LimitParameters
from dp_swing_ros.pendulum.state import ANGLES
from dp_swing_ros.rerun.counterfactual import Fork
from dp_swing_ros.rerun.runs import Course

DASH = 5         # [line widths]
STRIP = 0.85      # [inch] of a force
REST = 1.0        # [s] that is shown of what all have held
SMALLEST = 1e-3   # a regret below is drawn as none


@styled
def counterfactual(fork: Fork, limits: LimitParameters) -> Figure:
    """Draw the run until a tick and what followed: together, then each one's force and cost."""
    shown = _looks(fork)
    figure = Figure(figsize=(9.6, 5.6 + STRIP * len(shown)), layout='constrained')
    grid = figure.add_gridspec(3 + len(shown), 2, width_ratios=(2.6, 1.0), height_ratios=(
        1.5, 1.5, 1.3, *[STRIP] * len(shown)))
    first = figure.add_subplot(grid[0, 0])
    left = [first, *(figure.add_subplot(grid[row, 0], sharex=first)
                     for row in range(1, 3 + len(shown)))]
    for (course, colour), dash in zip(shown, _dashes(fork)):
        _draw_states(left[:3], fork, course, {'color': colour, 'linestyle': dash})
    _name_states(left[:3], limits)
    for axes, (course, colour) in zip(left[3:], shown):
        _draw_force(axes, fork, course, colour, limits)
    for axes in left:
        axes.axvline(fork.at, color=INK, linewidth=1, linestyle=(0, (1, 1.5)))
        axes.grid(True)
        axes.tick_params('x', labelbottom=axes is left[-1])
    first.set_xlim(fork.past.t[0], _end(fork))
    left[-1].set_xlabel('time [s]')
    figure.align_ylabels(left)
    _list_names(figure.add_subplot(grid[:3, 1]), fork)
    _draw_costs(figure.add_subplot(grid[3:, 1]), fork)
    figure.suptitle(f'Had another solver taken over at {fork.at:.2f} s')
    return figure


def _dashes(fork: Fork) -> list[Any]:
    """Return line styles whose dashes fall into each other's gaps: lines that agree all show."""
    others = len(fork.others)
    return ['-', *((DASH * n, (DASH, DASH * (others - 1))) if others > 1 else '-'
                   for n in range(others))]


def _looks(fork: Fork) -> list[tuple[Course, str]]:
    """Return the courses, the recorded first, and their colours."""
    colour = colours(course.solver for course in fork.others)
    return [(fork.recorded, INK), *((course, colour[course.solver]) for course in fork.others)]


def _label(fork: Fork, course: Course) -> str:
    name = plain(SOLVERS.get(course.solver, course.solver))
    return f'recorded ({name})' if course is fork.recorded else name


def _end(fork: Fork) -> float:
    """Return when all who hold the pendulum have held it for a while; else the end of the run."""
    settled = [course.settled for course, _ in _looks(fork)]
    return float(np.nanmin([fork.recorded.t[-1], max(settled) + REST]))


def _draw_states(panels: Sequence[Axes], fork: Fork, course: Course,
                 look: dict[str, Any]) -> None:
    t, X = course.t, course.X
    if course is fork.recorded:
        t, X = np.append(fork.past.t, t[1:]), np.vstack((fork.past.X, X[1:]))
    # all on the turn of the recorded run, which begins as every picture begins
    base = fork.past.X[:1] if len(fork.past.X) else fork.recorded.X[:1]
    shift = unwrapped(base)[0] - base[0, ANGLES]
    th_1, th_2, position = panels
    for axes, values in ((th_1, X[:, 1] + shift[0]), (th_2, X[:, 2] + shift[1]),
                         (position, X[:, 0])):
        axes.plot(t, values, **look)


def _name_states(panels: Sequence[Axes], limits: LimitParameters) -> None:
    th_1, th_2, position = panels
    for axes, symbol in zip((th_1, th_2), SYMBOLS[ANGLES]):
        mark_turns(axes)
        axes.set_ylabel(f'{symbol} [rad]\n{UPRIGHT_AT}')
    limit_lines(position, limits.track_limit, '')
    position.set_ylabel('$x$ [m]')


def _draw_force(axes: Axes, fork: Fork, course: Course, colour: str,
                limits: LimitParameters) -> None:
    """Draw one force as an area; before the tick it is everybody's, the recorded one."""
    if len(fork.past.U):
        axes.stairs(fork.past.U, fork.past.t, fill=True, color=FAINT)
    axes.stairs(course.U, course.t, fill=True, color=colour)
    limit_lines(axes, limits.force_limit, '')
    axes.set_ylabel('$u$ [N]')


def _list_names(axes: Axes, fork: Fork) -> None:
    axes.set_axis_off()
    axes.legend(handles=[Line2D([], [], color=colour, linewidth=2.4, label=_label(fork, course))
                         for course, colour in _looks(fork)],
                loc='upper left', fontsize='medium', borderaxespad=0.0)
    axes.text(0.0, 0.0, 'many-coloured: lines that agree\ndotted: the take-over\n'
                        'dashed grey: limits of track and force\n'
                        'grey: the force until the take-over', va='bottom', size='small',
              transform=axes.transAxes)


def _draw_costs(axes: Axes, fork: Fork) -> None:
    """Draw the costs to go beside the forces that they are of, with the regret in words."""
    shown = _looks(fork)
    values = np.nan_to_num([course.cost for course, _ in shown])
    axes.barh(range(len(shown)), values, height=0.34, color=[colour for _, colour in shown])
    for row, (course, _) in enumerate(shown):
        axes.text(0.0, row - 0.24, _verdict(fork, course), va='bottom', size='small')
    axes.set(ylim=(len(shown) - 0.5, -0.5), xlim=(0.0, 1.02 * max(values.max(), SMALLEST)),
             xlabel='cost to go, without unit')
    axes.set_yticks([])
    axes.spines['left'].set_visible(False)
    axes.xaxis.set_major_locator(MaxNLocator(3))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f'{value:,g}'))


def _verdict(fork: Fork, course: Course) -> str:
    regret = fork.regret(course)
    above = 'the least' if regret == 0 else f'regret {regret:,.4g}'
    held = 'not held' if math.isnan(course.settled) else f'settled at {course.settled:.2f} s'
    return f'{_label(fork, course)}: {course.cost:,.0f}, {above}\n{held}'


@styled
def regret(forks: Sequence[Fork]) -> Figure:
    """Draw the least cost to go of many take-overs, and how much more each solver's costs."""
    figure = Figure(figsize=(9.6, 5.8), layout='constrained')
    least, regrets = figure.subplots(2, 1, sharex=True, height_ratios=(0.6, 1.0))
    _draw_least(least, forks)
    for n, (course, colour) in enumerate(_looks(forks[0])):
        _draw_regret(regrets, forks, n, colour, _label(forks[0], course))
    regrets.set_yscale('symlog', linthresh=SMALLEST)
    regrets.set(ylim=(-SMALLEST / 2, None), xlabel='taken over at [s]',
                ylabel='regret, without unit')
    for axes in (least, regrets):
        axes.grid(True)
        axes.margins(x=0.02)
    legend(regrets)
    figure.align_ylabels()
    figure.suptitle('Had another solver taken over: least cost to go, and regret '
                    '(hollow: not held)')
    return figure


def _draw_least(axes: Axes, forks: Sequence[Fork]) -> None:
    axes.semilogy([fork.at for fork in forks], [fork.least for fork in forks], color=INK,
                  marker='o', markersize=3)
    low, high = np.log10(axes.get_ylim())
    axes.set_ylim(10 ** math.floor(low), 10 ** math.ceil(high))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_ylabel('least cost to go')


def _draw_regret(axes: Axes, forks: Sequence[Fork], n: int, colour: str, label: str) -> None:
    at = [fork.at for fork in forks]
    courses = [(fork.recorded, *fork.others)[n] for fork in forks]
    values = [fork.regret(course) for fork, course in zip(forks, courses)]
    axes.plot(at, values, color=colour, linewidth=1.0, label=label)
    for x, y, course in zip(at, values, courses):
        axes.plot(x, y, 'o', color=colour, markersize=5,
                  markerfacecolor='white' if math.isnan(course.settled) else colour)
