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

from dp_swing_ros.figures.curves import name_angles, unwrapped
from dp_swing_ros.figures.style import (
    colours, FAINT, formulas, in_decades, INK, legend, limit_lines, solver_name, styled,
    unit_of_input)
from dp_swing_ros.pendulum.parameters import acting, FORCE, LimitParameters
from dp_swing_ros.pendulum.state import angles, links_of
from dp_swing_ros.pendulum.units import SAME, Units
from dp_swing_ros.rerun.counterfactual import Counterfactual, ScoredTrajectory

DASH = 5          # [line widths]
STRIP = 0.85      # [inch] of a force
REST = 1.0        # [s] scaled, that is shown of what all have held
SMALLEST = 1e-3   # a regret below is drawn as none


@styled
def counterfactual(one: Counterfactual, limits: LimitParameters, scale: Units = SAME,
                   drive: str = FORCE) -> Figure:
    """Draw the run until a tick and what followed: together, then each one's force and cost."""
    shown, states = _coloured(one), links_of(one.recorded.X) + 1
    figure = Figure(figsize=(9.6, 1.6 + 1.33 * states + STRIP * len(shown)),
                    layout='constrained')
    rows = range(states + len(shown))
    panels = figure.subplot_mosaic(
        [[row, 'names' if row < states else 'costs'] for row in rows], width_ratios=(2.6, 1.0),
        height_ratios=[*[1.5] * (states - 1), 1.3, *[STRIP] * len(shown)])
    left = [panels[row] for row in rows]
    for axes, (trajectory, colour), dash in zip(left[states:], shown, _dashes(len(shown) - 1)):
        _draw_states(left[:states], one, trajectory, {'color': colour, 'linestyle': dash})
        _draw_force(axes, one, trajectory, colour, limits.applied_limit(drive))
        axes.set_ylabel(f'$u$ [{unit_of_input(drive)}]')
    *of_angles, position = left[:states]
    for axes, symbol in zip(of_angles, formulas(states - 1)[1:]):
        name_angles(axes, symbol)
    limit_lines(position, limits.track_limit)
    position.set_ylabel('$x$ [m]')
    # until all who hold the pendulum have held it for a while; else to the end of the run
    settled = np.fmax.reduce([trajectory.settled for trajectory, _ in shown])
    end = np.fmin(one.recorded.t[-1], settled + scale.sized(REST, 's'))
    for axes in left:
        axes.axvline(one.at, color=INK, linewidth=1, linestyle=(0, (1, 1.5)))
        axes.grid(True)
        axes.set_xlim(one.past.t[0], end)
        axes.tick_params('x', labelbottom=axes is left[-1])
    left[-1].set_xlabel('time [s]')
    figure.align_ylabels(left)
    _list_names(panels['names'], one, acting(drive))
    _draw_costs(panels['costs'], one)
    figure.suptitle(f'Had another solver taken over at {one.at:.2f} s')
    return figure


def _dashes(others: int) -> list[Any]:
    """Return line styles whose dashes fall into each other's gaps: lines that agree all show."""
    return ['-', *((DASH * n, (DASH, DASH * (others - 1))) if others > 1 else '-'
                   for n in range(others))]


def _coloured(one: Counterfactual) -> list[tuple[ScoredTrajectory, str]]:
    """Return the trajectories, the recorded first, and their colours."""
    colour = colours(other.solver for other in one.others)
    return [(one.recorded, INK), *((other, colour[other.solver]) for other in one.others)]


def _label(one: Counterfactual, trajectory: ScoredTrajectory) -> str:
    name = solver_name(trajectory.solver)
    return f'recorded ({name})' if trajectory is one.recorded else name


def _draw_states(panels: Sequence[Axes], one: Counterfactual, trajectory: ScoredTrajectory,
                 look: dict[str, Any]) -> None:
    t, X = trajectory.t, trajectory.X
    if trajectory is one.recorded:
        t, X = np.append(one.past.t, t[1:]), np.vstack((one.past.X, X[1:]))
    # all on the turn of the recorded run, which begins as every picture begins
    base = one.past.X[:1]
    turned = X[:, angles(X)] + unwrapped(base) - base[:, angles(base)]
    for axes, values in zip(panels, (*turned.T, X[:, 0])):
        axes.plot(t, values, **look)


def _draw_force(axes: Axes, one: Counterfactual, trajectory: ScoredTrajectory, colour: str,
                limit: float) -> None:
    """Draw one force as an area; before the tick it is everybody's, the recorded one."""
    if len(one.past.U):
        axes.stairs(one.past.U, one.past.t, fill=True, color=FAINT)
    axes.stairs(trajectory.U, trajectory.t, fill=True, color=colour)
    limit_lines(axes, limit)


def _list_names(axes: Axes, one: Counterfactual, force: str) -> None:
    axes.set_axis_off()
    axes.legend(handles=[Line2D([], [], color=colour, linewidth=2.4, label=_label(one, trajectory))
                         for trajectory, colour in _coloured(one)],
                loc='upper left', fontsize='medium', borderaxespad=0.0)
    axes.text(0.0, 0.0, 'many-coloured: lines that agree\ndotted: the take-over\n'
                        f'dashed grey: limits of track and {force}\n'
                        f'grey: the {force} until the take-over', va='bottom', size='small',
              transform=axes.transAxes)


def _draw_costs(axes: Axes, one: Counterfactual) -> None:
    """Draw the costs to go beside the forces that they are of, with the regret in words."""
    shown = _coloured(one)
    values = np.nan_to_num([trajectory.cost for trajectory, _ in shown])
    axes.barh(range(len(shown)), values, height=0.34, color=[colour for _, colour in shown])
    for row, (trajectory, _) in enumerate(shown):
        axes.text(0.0, row - 0.24, _verdict(one, trajectory), va='bottom', size='small')
    axes.set(ylim=(len(shown) - 0.5, -0.5), xlim=(0.0, 1.02 * max(values.max(), SMALLEST)),
             xlabel='cost to go, without unit')
    axes.set_yticks([])
    axes.spines['left'].set_visible(False)
    axes.xaxis.set_major_locator(MaxNLocator(3))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f'{value:,g}'))


def _verdict(one: Counterfactual, trajectory: ScoredTrajectory) -> str:
    regret = one.regret(trajectory)
    above = 'the least' if regret == 0 else f'regret {regret:,.4g}'
    held = 'not held' if math.isnan(trajectory.settled) \
        else f'settled at {trajectory.settled:.2f} s'
    return f'{_label(one, trajectory)}: {trajectory.cost:,.0f}, {above}\n{held}'


@styled
def regret(many: Sequence[Counterfactual]) -> Figure:
    """Draw the least cost to go of many take-overs, and how much more each solver's costs."""
    figure = Figure(figsize=(9.6, 5.8), layout='constrained')
    least, regrets = figure.subplots(2, 1, sharex=True, height_ratios=(0.6, 1.0))
    at = [one.at for one in many]
    least.plot(at, [one.least for one in many], color=INK, marker='o', markersize=3)
    in_decades(least)
    least.yaxis.set_minor_formatter(NullFormatter())
    least.set_ylabel('least cost to go')
    for n, (trajectory, colour) in enumerate(_coloured(many[0])):
        followed = [(one.recorded, *one.others)[n] for one in many]
        values = [one.regret(each) for one, each in zip(many, followed)]
        regrets.plot(at, values, color=colour, linewidth=1.0, label=_label(many[0], trajectory))
        regrets.scatter(at, values, 25, linewidths=1.0, edgecolors=colour, zorder=2, facecolors=[
            'white' if math.isnan(each.settled) else colour for each in followed])
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
