# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pendulum on its track, as all pictures of it draw it."""

from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.patches import FancyBboxPatch
import numpy as np

from dp_swing_ros.figures.sampling import states_at
from dp_swing_ros.figures.style import CART, FAINT, INK, LINK1, LINK2, tint
from dp_swing_ros.pendulum.equations import joints
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.simulation.episode import Episode

CART_SIZE = (0.44, 0.22)  # [m]
TRACK = -0.15             # [m] height of the track under the joint of the cart
FINE = 0.0125             # [s] between the points of a trail


class Drawing:
    """A cart with its two links on some axes, moved to one state after another."""

    def __init__(self, axes: Axes, bodies: PendulumParameters, size: float = 1.0,
                 strength: float = 1.0) -> None:
        self._bodies = bodies
        width, height = CART_SIZE
        self._cart = FancyBboxPatch(
            (0, -height / 2), width, height, boxstyle='round,pad=0,rounding_size=0.05',
            facecolor=tint(CART, strength), edgecolor='none', zorder=3)
        axes.add_patch(self._cart)
        self._links = [
            axes.plot([], [], color=tint(colour, strength), linewidth=4 * size,
                      solid_capstyle='round', zorder=4)[0] for colour in (LINK1, LINK2)]
        self._joints = axes.plot(
            [], [], 'o', color='white', markeredgecolor=tint(INK, strength),
            markeredgewidth=size, markersize=3.6 * size, zorder=5)[0]

    def show(self, x: Array, shift: float = 0.0) -> None:
        """Move to the state x (6,), drawn a distance [m] to the right."""
        places = joints(x, self._bodies) + (shift, 0.0)
        self._cart.set_x(places[0, 0] - CART_SIZE[0] / 2)
        for link, line in enumerate(self._links):
            line.set_data(*places[link:link + 2].T)
        self._joints.set_data(*places[:2].T)


def fading(points: Array, colour: str, width: float) -> LineCollection:
    """Return a line through points (M, 2) that is clear at its end and fades to its start."""
    pieces = np.stack([points[:-1], points[1:]], axis=1)
    colours = np.tile(to_rgba(colour), (len(pieces), 1))
    colours[:, 3] = 0.8 * np.linspace(0.0, 1.0, len(pieces)) ** 1.5
    return LineCollection(list(pieces), colors=colours, linewidths=width, capstyle='butt',
                          zorder=2)


def trail_of(episode: Episode, t: float, length: float) -> Array:
    """Return the way (M, 2) [m] of the second tip over the time [s] before t."""
    times = np.linspace(max(t - length, episode.t[0]), t, max(2, round(length / FINE)))
    return joints(states_at(episode, times), episode.bodies)[:, 2]


def scene(axes: Axes, episode: Episode, half_width: float) -> None:
    """Set the view and lay the track."""
    reach = episode.bodies.link1_length + episode.bodies.link2_length
    limit = episode.limits.track_limit + CART_SIZE[0] / 2
    end = min(limit, 2 * half_width)
    axes.plot([-end, end], [TRACK, TRACK], color=FAINT, linewidth=1.2, zorder=1)
    if limit <= half_width:
        for stop in (-limit, limit):
            axes.plot([stop, stop], [TRACK, TRACK + 0.25], color=FAINT, linewidth=2.5, zorder=1)
    axes.set(xlim=(-half_width, half_width), ylim=(-1.1 * reach, 1.1 * reach), aspect='equal')


def room_for(episode: Episode) -> float:
    """Return how far [m] from the centre anything of the run gets, with a margin."""
    places = joints(episode.X, episode.bodies)[..., 0]
    reached = np.abs(places[np.isfinite(places)])
    reach = episode.bodies.link1_length + episode.bodies.link2_length
    return max(float(reached.max(initial=0.0)) + 0.2, 0.6 * reach)
