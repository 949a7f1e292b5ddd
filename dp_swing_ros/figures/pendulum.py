# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pendulum at any time of a run, and on its track as all pictures of it draw it."""

import math

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.patches import FancyBboxPatch
import numpy as np

from dp_swing_ros.figures.style import CART, FAINT, INK, LINKS, tint
from dp_swing_ros.pendulum.geometry import drawn_centres, drawn_scale, joint_positions
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import Array, between
from dp_swing_ros.pendulum.units import Units
from dp_swing_ros.simulation.episode import Episode

# all of the default bodies, and scaled for others as they are drawn; see drawn_scale
CART_SIZE = (0.44, 0.22)  # [m]
CORNER = 0.05             # [m] its radius
TRACK = -0.15             # [m] height of the track under the joint of the cart
STOP = 0.25               # [m] height of an end stop
FAR = 1e3                 # [m] where a track without an end ends
MARGIN = 0.2              # [m] beside what moves
FINE = 0.0125             # [s] between the points of a trail
# of a force beside the cart: its gap, its length, its head at most, the least that is shown
ARROW = {'gap': (0.04, 'm'), 'scale': (0.05, 'm/N'), 'head': (0.18, 'm'), 'least': (0.5, 'N')}


def cart_size(scale: Units) -> tuple[float, float]:
    """Return width and height [m] of the cart."""
    width, height = CART_SIZE
    return scale.sized(width, 'm'), scale.sized(height, 'm')


def arrow_size(scale: Units) -> dict[str, float]:
    """Return the sizes of the arrow of a force."""
    return {name: scale.sized(*size) for name, size in ARROW.items()}


def times_of(episode: Episode, period: float, until: float = math.inf) -> Array:
    """Return times from the first state to the last, or until a time, a period [s] apart."""
    return period * np.arange(math.floor(min(episode.t[-1], until) / period + 0.02) + 1)


def states_at(episode: Episode, times: Array) -> Array:
    """
    Return the states between the recorded ones, by cubics.

    Shapes: times (M,) [s] -> (M, 2n + 2); before the first and after the last state these hold.
    """
    t, X = episode.t, episode.X
    if len(t) < 2:
        return np.repeat(X, len(times), axis=0)
    n = np.clip(np.searchsorted(t, times, side='right') - 1, 0, len(t) - 2)
    h = (t[n + 1] - t[n])[:, None]
    s = np.clip((times - t[n])[:, None] / h, 0.0, 1.0)
    return between(X[n], X[n + 1], s, h)


def force_at(episode: Episode, t: float) -> float:
    """Return the force [N] that acts from a time [s] on."""
    n = int(np.searchsorted(episode.t, t + 1e-9)) - 1
    return float(episode.U[n]) if 0 <= n < len(episode.U) else 0.0


def room_for(episode: Episode) -> float:
    """Return how far [m] from the centre anything of the run gets, with a margin."""
    lengths = episode.physical.lengths
    places = joint_positions(episode.X, lengths)[..., 0]
    reached = np.abs(places[np.isfinite(places)])
    margin = drawn_scale(episode.physical).sized(MARGIN, 'm')
    return max(float(reached.max(initial=0.0)) + margin, 0.6 * sum(lengths))


def draw_scene(axes: Axes, episode: Episode, half_width: float) -> None:
    """Set the view and lay the track."""
    draw_track(axes, episode.physical, episode.limits)
    reach = 1.1 * sum(episode.physical.lengths)
    axes.set(xlim=(-half_width, half_width), ylim=(-reach, reach), aspect='equal')


def draw_track(axes: Axes, physical: PendulumParameters, limits: LimitParameters,
               size: float = 1.0) -> None:
    """Draw the track of a pendulum and its end stops."""
    for line, width in zip(track_lines(drawn_scale(physical), limits), (1.2, 2.5, 2.5)):
        axes.plot(*line.T, color=FAINT, linewidth=width * size, zorder=1)


def track_lines(scale: Units, limits: LimitParameters) -> Array:
    """Return the lines (3, 2, 2) [m] of the track and its two end stops."""
    low, top = scale.sized(TRACK, 'm'), scale.sized(TRACK + STOP, 'm')
    end = min(limits.track_limit + cart_size(scale)[0] / 2, scale.sized(FAR, 'm'))
    return np.array([[(-end, low), (end, low)],
                     *([(side, low), (side, top)] for side in (-end, end))])


def draw_pendulum(axes: Axes, physical: PendulumParameters, x: Array, size: float = 1.0,
                  strength: float = 1.0) -> list[Artist]:
    """
    Draw cart and links in the state x (2n + 2,), white at strength 0; return the artists.

    A dot is the centre of mass of a link that has it elsewhere than in its middle.
    """
    places, scale = joint_positions(x, physical.lengths), drawn_scale(physical)
    width, height = cart_size(scale)
    cart = axes.add_patch(FancyBboxPatch(
        (places[0, 0] - width / 2, -height / 2), width, height,
        boxstyle=f'round,pad=0,rounding_size={scale.sized(CORNER, "m")}',
        facecolor=tint(CART, strength), edgecolor='none', zorder=3))
    lines = [line for link, colour in enumerate(LINKS[:physical.links]) for line in axes.plot(
        *places[link:link + 2].T, color=tint(colour, strength), linewidth=4 * size,
        solid_capstyle='round', zorder=4)]
    joints = axes.plot(*places[:-1].T, 'o', color='white', markeredgecolor=tint(INK, strength),
                       markeredgewidth=size, markersize=3.6 * size, zorder=5)
    centres = [point for link, share in enumerate(drawn_centres(physical)) if share is not None
               for point in axes.plot(*(places[link] + share * (places[link + 1] - places[link])),
                                      'o', color=tint(INK, strength), markeredgecolor='white',
                                      markeredgewidth=0.6 * size, markersize=5 * size, zorder=6)]
    return [cart, *lines, *joints, *centres]


def draw_trail(axes: Axes, episode: Episode, t: float, length: float, width: float) -> Artist:
    """Draw the path of the last tip over the time [s], scaled, before t, fading to its start."""
    begin = t - drawn_scale(episode.physical).sized(length, 's')
    times = np.linspace(max(begin, 0.0), t, max(2, round(length / FINE)))
    tips = joint_positions(states_at(episode, times), episode.physical.lengths)[:, -1]
    pieces = np.stack([tips[:-1], tips[1:]], axis=1)
    colours = [to_rgba(LINKS[episode.physical.links - 1], 0.8 * strength ** 1.5)
               for strength in np.linspace(0.0, 1.0, len(pieces))]
    return axes.add_collection(LineCollection(
        list(pieces), colors=colours, linewidths=width, capstyle='butt', zorder=2))
