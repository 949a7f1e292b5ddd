# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pendulum at one moment after another: the paper's Fig. 2."""

import math

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator
import numpy as np

from dp_swing_ros.figures.pendulum import Drawing, room_for, scene, trail_of
from dp_swing_ros.figures.sampling import states_at, times_of
from dp_swing_ros.figures.style import panels_of, PAPER, solver_name, styled
from dp_swing_ros.pendulum.state import is_upright
from dp_swing_ros.simulation.episode import Episode


@styled
def snapshots(episode: Episode) -> Figure:
    """Draw the pendulum every 0.5 s, left to right, then top to bottom (the paper's Fig. 2)."""
    most = 48
    length = episode.t[-1] - episode.t[0] if len(episode.t) else 0.0
    period = 0.5 * max(1, math.ceil(length / 0.5 / most))
    times = times_of(episode, period)
    columns = _columns(len(times))
    rows = max(1, math.ceil(len(times) / columns))
    half_width = room_for(episode)
    height = 1.65 * 1.1 * sum(episode.physical.lengths) / half_width  # [inch] of a picture
    figure = Figure(figsize=(1.65 * max(columns, 3), 0.75 + rows * height),
                    layout='constrained')
    panels = panels_of(figure, len(times), columns, sharex=True, sharey=True)
    for axes, t in zip(panels, times):
        snapshot(axes, episode, t, half_width)
    figure.suptitle(f'{solver_name(episode.solver)}: the pendulum every {period:g} s '
                    '(bold: upright)')
    figure.supxlabel('x [m]')
    figure.supylabel('z [m]')
    return figure


def _columns(pictures: int) -> int:
    """Return the number of columns that leaves the fewest places empty."""
    if pictures <= 8:
        return max(pictures, 1)
    return min((8, 7, 6), key=lambda columns: -pictures % columns)


def snapshot(axes: Axes, episode: Episode, t: float, half_width: float) -> None:
    """Draw the pendulum at a time [s], with the path of its tip before that."""
    scene(axes, episode, half_width)
    x = states_at(episode, np.array([t]))[0]
    axes.add_collection(trail_of(episode, t, 0.5, 1.2))
    Drawing(axes, episode.physical, size=0.7).show(x)
    axes.spines[:].set_visible(False)
    axes.set_facecolor(PAPER)
    axes.tick_params(length=0, labelsize='x-small')
    axes.xaxis.set_major_locator(MultipleLocator(1.0))
    axes.yaxis.set_major_locator(MultipleLocator(1.0))
    after = t - episode.t[0]
    digits = 1 if abs(after - round(after, 1)) < 1e-6 else 2
    axes.set_title(f'{after:.{digits}f} s', fontsize='small', pad=2,
                   weight='bold' if is_upright(x) else 'normal')
