# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Several runs over the same time."""

from collections.abc import Mapping

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
import numpy as np

from dp_swing_ros.figures.curves import in_decades, mark_turns, unwrapped, UPRIGHT_AT
from dp_swing_ros.figures.style import (
    ALARM, FORCE, INK, limit_lines, LINK1, LINK2, plain, styled, SYMBOLS)
from dp_swing_ros.pendulum.state import ANGLES
from dp_swing_ros.simulation.episode import Episode

RUNS = (LINK1, LINK2, FORCE, ALARM, INK, '#56B4E9', '#E69F00')  # the rest of the palette at last
DASHES = ('-', (0, (4, 1.5)), (0, (1, 1)))  # where there are more runs than colours
ENTRY = 0.09  # [inch] a letter of the legend, about


@styled
def overlay(episodes: Mapping[str, Episode]) -> Figure:
    """Draw angles, position, force and solve times of runs over time, a colour for each name."""
    figure = Figure(figsize=(9.6, 9.6), layout='constrained')
    panels = figure.subplots(5, 1, sharex=True, height_ratios=(1.1, 1.1, 0.9, 1.0, 1.0))
    looks = [(RUNS[n % len(RUNS)], DASHES[n // len(RUNS) % len(DASHES)])
             for n in range(len(episodes))]
    # where curves lie on each other, the later is the thinner
    widths = np.linspace(3.0, 1.2, len(episodes)).tolist()
    for episode, (colour, dash), width in zip(episodes.values(), looks, widths):
        _draw(panels, episode, {'color': colour, 'linestyle': dash, 'linewidth': width})
    for angle, symbol in zip(panels, SYMBOLS[ANGLES]):
        mark_turns(angle)
        angle.set_ylabel(f'{symbol} [rad]\n{UPRIGHT_AT}')
    for axes, label in zip(panels[2:], ('position $x$ [m]', 'force $u$ [N]', 'solve time [ms]')):
        axes.set_ylabel(label)
    _draw_limits(panels[2:4], list(episodes.values()))
    if any(np.any(episode.ticks.solve_time > 0) for episode in episodes.values()):
        in_decades(panels[4])
    for axes in panels:
        axes.grid(True)
        axes.margins(x=0.01)
    panels[4].set_xlabel('time [s]')
    figure.align_ylabels()
    _name(figure, list(episodes), looks)
    return figure


def _draw(panels: list[Axes], episode: Episode, look: dict) -> None:
    for axes, angle in zip(panels, unwrapped(episode.X).T):
        axes.plot(episode.t, angle, **look)
    panels[2].plot(episode.t, episode.X[:, 0], **look)
    if len(episode.U):
        panels[3].stairs(episode.U, episode.t, baseline=None, **look)
    panels[4].plot(episode.ticks.t, 1e3 * episode.ticks.solve_time, '.', markersize=4,
                   color=look['color'])


def _draw_limits(panels: list[Axes], episodes: list[Episode]) -> None:
    """Draw the limits of position and force, those of each run."""
    for limit in sorted({episode.limits.track_limit for episode in episodes}):
        limit_lines(panels[0], limit, '')
    for limit in sorted({episode.limits.force_limit for episode in episodes}):
        limit_lines(panels[1], limit, '')


def _name(figure: Figure, names: list[str], looks: list) -> None:
    longest = max(map(len, names), default=0)
    figure.legend(
        handles=[Line2D([], [], color=colour, linestyle=dash, linewidth=2.4, label=plain(name))
                 for name, (colour, dash) in zip(names, looks)],
        loc='outside upper left', handlelength=1.8,
        ncols=max(1, min(len(names), int(9.0 / (0.6 + ENTRY * longest)))))
