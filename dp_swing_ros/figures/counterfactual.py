# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What each solver would have done from a recorded tick on, and what that would have cost."""

from collections.abc import Callable, Sequence
import math
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator, MultipleLocator, NullFormatter
import numpy as np

from dp_swing_ros.figures.contestants import OWN
from dp_swing_ros.figures.curves import in_turns
from dp_swing_ros.figures.style import INK, legend, limit_lines, SOLVERS, styled, SYMBOLS
from dp_swing_ros.parameters import LimitParameters
from dp_swing_ros.rerun.counterfactual import Fork
from dp_swing_ros.rerun.runs import Course
from dp_swing_ros.state import ANGLES

RECORDED = '#c3cbd3'  # a wide band that the lines of those who do the same lie upon
WIDTHS = (7.0, 4.2, 2.6, 1.1)
MOST = 5 * np.pi      # [rad] of an axis with a tick at every half turn
SMALLEST = 1e-3       # a regret below is drawn as none


@styled
def counterfactual(fork: Fork, limits: LimitParameters) -> Figure:
    """Draw the run until a tick, what followed, what else might have, and the costs."""
    figure = Figure(figsize=(9.6, 9.8), layout='constrained')
    grid = figure.add_gridspec(5, 2, height_ratios=(1.0, 1.0, 0.8, 0.9, 0.3 + 0.2 * len(
        fork.courses())))
    first = figure.add_subplot(grid[0, :])
    panels = [first, *(figure.add_subplot(grid[row, :], sharex=first) for row in (1, 2, 3))]
    for course, look in _looks(fork):
        _draw_course(panels, fork.past, course, look)
    _name_panels(panels, limits)
    for axes in panels:
        axes.axvline(fork.at, color=INK, linewidth=1, linestyle=(0, (1, 1.5)))
        axes.grid(True)
        axes.margins(x=0.01)
        axes.tick_params('x', labelbottom=axes is panels[-1])
    panels[-1].set_xlabel('time [s]')
    figure.align_ylabels(panels)
    legend(first)
    _draw_bars(figure.add_subplot(grid[4, 0]), fork, 'cost to go', lambda course: course.cost)
    _draw_bars(figure.add_subplot(grid[4, 1]), fork, 'regret', fork.regret)
    figure.suptitle(f'Had another solver taken over at {fork.at:.2f} s')
    return figure


def _looks(fork: Fork) -> list[tuple[Course, dict[str, Any]]]:
    """Return the courses and the look of their lines: each thinner, so that all can be seen."""
    recorded = {'color': RECORDED, 'label': f'recorded: {_name(fork.recorded)}'}
    others = [{'color': OWN[course.solver], 'label': _name(course)} for course in fork.others]
    return [(course, {**look, 'linewidth': width}) for course, look, width in zip(
        (fork.recorded, *fork.others), (recorded, *others), WIDTHS)]


def _name(course: Course) -> str:
    return SOLVERS.get(course.solver, course.solver)


def _draw_course(panels: Sequence[Axes], past: Course, course: Course,
                 look: dict[str, Any]) -> None:
    t, X, U = course.t, course.X, course.U
    if look['color'] == RECORDED:
        t, X = np.append(past.t, t[1:]), np.vstack((past.X, X[1:]))
        U = np.append(past.U, U)
    th_1, th_2, position, force = panels
    for axes, i in ((th_1, 1), (th_2, 2), (position, 0)):
        axes.plot(t, X[:, i], **look)
    force.stairs(U, t, baseline=None, **look)


def _name_panels(panels: Sequence[Axes], limits: LimitParameters) -> None:
    th_1, th_2, position, force = panels
    for axes, symbol in zip((th_1, th_2), SYMBOLS[ANGLES]):
        low, high = axes.get_ylim()
        axes.yaxis.set_major_locator(MultipleLocator(np.pi * math.ceil((high - low) / MOST)))
        axes.yaxis.set_major_formatter(FuncFormatter(in_turns))
        axes.set_ylabel(f'angle {symbol} [rad]\n0 is upright')
    limit_lines(position, limits.track_limit, 'end stops')
    position.set_ylabel('position $x$ [m]')
    limit_lines(force, limits.force_limit, 'limits')
    force.set_ylabel('force $u$ [N]')


def _draw_bars(axes: Axes, fork: Fork, what: str, figure_of: Callable[[Course], float]) -> None:
    courses = [course for course, _ in _looks(fork)]
    values = [figure_of(course) for course in courses]
    labels = ['recorded', *(_name(course) for course in fork.others)]
    colours = [RECORDED, *(OWN[course.solver] for course in fork.others)]
    axes.barh(range(len(values)), np.nan_to_num(values), height=0.62, color=colours)
    largest = max(np.nan_to_num(values).max(), SMALLEST)
    for row, (value, course) in enumerate(zip(values, courses)):
        fell = '' if not math.isnan(course.settled) else '  not held'
        axes.text(max(np.nan_to_num(value), 0.0) + 0.015 * largest, row, f'{value:,.2f}{fell}',
                  va='center', size=8)
    axes.set(xlim=(0.0, 1.55 * largest), ylim=(len(values) - 0.4, -0.6), xlabel=what)
    axes.set_yticks(range(len(values)), labels)
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f'{value:,g}'))
    axes.tick_params('y', length=0)
    axes.grid(True, axis='x')


@styled
def regret(forks: Sequence[Fork]) -> Figure:
    """Draw the least cost to go of many take-overs, and how much more each solver's costs."""
    figure = Figure(figsize=(9.6, 5.8), layout='constrained')
    least, regrets = figure.subplots(2, 1, sharex=True, height_ratios=(0.6, 1.0))
    _draw_least(least, forks)
    for n, (_, look) in enumerate(_looks(forks[0])):
        _draw_regret(regrets, forks, n, look)
    regrets.set_yscale('symlog', linthresh=SMALLEST)
    regrets.set(ylim=(-SMALLEST / 2, None), xlabel='taken over at [s]', ylabel='regret')
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


def _draw_regret(axes: Axes, forks: Sequence[Fork], n: int, look: dict[str, Any]) -> None:
    at = [fork.at for fork in forks]
    courses = [list(fork.courses().values())[n] for fork in forks]
    values = [fork.regret(course) for fork, course in zip(forks, courses)]
    axes.plot(at, values, color=look['color'], linewidth=look['linewidth'] / 2, alpha=0.45)
    axes.plot([], [], 'o', color=look['color'], label=look['label'])
    for x, y, course in zip(at, values, courses):
        axes.plot(x, y, 'o', color=look['color'], markersize=3 + look['linewidth'],
                  markerfacecolor='white' if math.isnan(course.settled) else look['color'])
