# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Several runs over the same time."""

from collections.abc import Mapping
from typing import Any

from matplotlib.figure import Figure
import numpy as np

from dp_swing_ros.figures.curves import mark_turns, unwrapped, UPRIGHT_AT
from dp_swing_ros.figures.style import (
    DASHES, formulas, in_decades, in_numbers, INK, limit_lines, name_lines, PALETTE, styled,
    widths)
from dp_swing_ros.simulation.episode import Episode

RUNS = (*PALETTE[:4], INK, *PALETTE[4:])
LETTER = 0.09  # [inch] of the legend, about


@styled
def overlay(episodes: Mapping[str, Episode]) -> Figure:
    """
    Draw angles, position, force and solve times of runs over time, a colour for each name.

    Runs may be of pendulums with different numbers of links.
    """
    links = max(episode.physical.links for episode in episodes.values())
    figure = Figure(figsize=(9.6, 5.4 + 2.1 * links), layout='constrained')
    panels = figure.subplots(links + 3, 1, sharex=True,
                             height_ratios=[*[1.1] * links, 0.9, 1.0, 1.0])
    angles, (position, force, times) = panels[:links], panels[links:]
    # where there are more runs than colours, their lines differ
    looks: list[dict[str, Any]] = [
        {'color': RUNS[n % len(RUNS)], 'linestyle': DASHES[n // len(RUNS) % len(DASHES)]}
        for n in range(len(episodes))]
    for episode, look, width in zip(episodes.values(), looks, widths(len(episodes))):
        line = {**look, 'linewidth': width}
        for axes, angle in zip(angles, unwrapped(episode.X).T):
            axes.plot(episode.t, angle, **line)
        position.plot(episode.t, episode.X[:, 0], **line)
        if len(episode.U):
            force.stairs(episode.U, episode.t, baseline=None, **line)
        times.plot(episode.ticks.t, 1e3 * episode.ticks.solve_time, '.', markersize=4,
                   color=look['color'])
    for axes, symbol in zip(angles, formulas(links)[1:]):
        mark_turns(axes)
        axes.set_ylabel(f'{symbol} [rad]\n{UPRIGHT_AT}')
    for limit in {episode.limits.track_limit for episode in episodes.values()}:
        limit_lines(position, limit)
    for limit in {episode.limits.force_limit for episode in episodes.values()}:
        limit_lines(force, limit)
    position.set_ylabel('position $x$ [m]')
    force.set_ylabel('force $u$ [N]')
    times.set(ylabel='solve time [ms]', xlabel='time [s]')
    if any(np.any(episode.ticks.solve_time > 0) for episode in episodes.values()):
        in_decades(times)
        in_numbers(times.yaxis)
    for axes in panels:
        axes.grid(True)
        axes.margins(x=0.01)
    figure.align_ylabels()
    name_lines(figure, {name: {**look, 'linewidth': 2.4} for name, look in zip(episodes, looks)},
               'upper left', 0.6 + LETTER * max(map(len, episodes)))
    return figure
