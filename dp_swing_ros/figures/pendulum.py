# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pendulum on its track, as all pictures of it draw it."""

from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.patches import FancyBboxPatch
import numpy as np

from dp_swing_ros.figures.sampling import states_at
from dp_swing_ros.figures.style import CART, FAINT, INK, LINKS, tint
from dp_swing_ros.pendulum.geometry import joint_positions
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.simulation.episode import Episode

CART_SIZE = (0.44, 0.22)  # [m]
TRACK = -0.15             # [m] height of the track under the joint of the cart
STOP = 0.25               # [m] height of an end stop
FAR = 1e3                 # [m] where a track without an end ends
FINE = 0.0125             # [s] between the points of a trail


class Arrow(NamedTuple):
    """How a force is drawn beside the cart."""

    gap: float = 0.04    # [m] from the cart
    scale: float = 0.05  # [m/N]
    head: float = 0.18   # [m] at most
    least: float = 0.5   # [N] of a force that is shown


class Drawing:
    """A cart with its links on some axes, moved to one state after another."""

    def __init__(self, axes: Axes, physical: PendulumParameters, size: float = 1.0,
                 strength: float = 1.0) -> None:
        self._lengths = physical.lengths
        width, height = CART_SIZE
        self._cart = FancyBboxPatch(
            (0, -height / 2), width, height, boxstyle='round,pad=0,rounding_size=0.05',
            facecolor=tint(CART, strength), edgecolor='none', zorder=3)
        axes.add_patch(self._cart)
        self._links = [
            axes.plot([], [], color=tint(colour, strength), linewidth=4 * size,
                      solid_capstyle='round', zorder=4)[0] for colour in LINKS[:physical.links]]
        self._joints = axes.plot(
            [], [], 'o', color='white', markeredgecolor=tint(INK, strength),
            markeredgewidth=size, markersize=3.6 * size, zorder=5)[0]

    def show(self, x: Array) -> None:
        """Move to the state x (2n + 2,)."""
        places = joint_positions(x, self._lengths)
        self._cart.set_x(places[0, 0] - CART_SIZE[0] / 2)
        for link, line in enumerate(self._links):
            line.set_data(*places[link:link + 2].T)
        self._joints.set_data(*places[:-1].T)


def trail_of(episode: Episode, t: float, length: float, width: float) -> LineCollection:
    """Return the path of the last tip over the time [s] before t, fading to its start."""
    times = np.linspace(max(t - length, episode.t[0]), t, max(2, round(length / FINE)))
    tips = joint_positions(states_at(episode, times), episode.physical.lengths)[:, -1]
    pieces = np.stack([tips[:-1], tips[1:]], axis=1)
    colours = [to_rgba(LINKS[episode.physical.links - 1], 0.8 * strength ** 1.5)
               for strength in np.linspace(0.0, 1.0, len(pieces))]
    return LineCollection(list(pieces), colors=colours, linewidths=width, capstyle='butt',
                          zorder=2)


def track_lines(limits: LimitParameters) -> list[Array]:
    """Return the lines (2, 2) [m] of the track and its two end stops."""
    end = min(limits.track_limit + CART_SIZE[0] / 2, FAR)
    return [np.array(ends) for ends in (
        [(-end, TRACK), (end, TRACK)], *([(side, TRACK), (side, TRACK + STOP)]
                                         for side in (-end, end)))]


def draw_track(axes: Axes, limits: LimitParameters, size: float = 1.0) -> None:
    """Draw the track and its end stops."""
    for line, width in zip(track_lines(limits), (1.2, 2.5, 2.5)):
        axes.plot(*line.T, color=FAINT, linewidth=width * size, zorder=1)


def scene(axes: Axes, episode: Episode, half_width: float) -> None:
    """Set the view and lay the track."""
    draw_track(axes, episode.limits)
    reach = 1.1 * sum(episode.physical.lengths)
    axes.set(xlim=(-half_width, half_width), ylim=(-reach, reach), aspect='equal')


def room_for(episode: Episode) -> float:
    """Return how far [m] from the centre anything of the run gets, with a margin."""
    lengths = episode.physical.lengths
    places = joint_positions(episode.X, lengths)[..., 0]
    reached = np.abs(places[np.isfinite(places)])
    return max(float(reached.max(initial=0.0)) + 0.2, 0.6 * sum(lengths))
