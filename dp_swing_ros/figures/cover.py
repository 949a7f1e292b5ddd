# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The picture for a first look."""

import math

from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
import numpy as np

from dp_swing_ros.evaluation.metrics import settling_time
from dp_swing_ros.figures.pendulum import Drawing, FINE, TRACK
from dp_swing_ros.figures.sampling import states_at, times_of
from dp_swing_ros.figures.style import FAINT, FORCE, limit_lines, LINKS, solver_name, styled
from dp_swing_ros.pendulum.geometry import joint_positions
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.simulation.episode import Episode

CUT = 0.5   # [s] on the film between what it shows and the last state


@styled
def hero(episode: Episode, seconds: float = 4.0, speed: float = 3.4) -> Figure:
    """
    Draw the swing-up as on film that runs past the cart: again and again, to the right with time.

    The film runs at `speed` [m/s], so that every cart stands above the force of its moment. Of a
    longer run than `seconds` [s] it is cut, and ends with the last state.
    """
    length = float(episode.t[-1] - episode.t[0]) if len(episode.t) else 0.0
    cut = length > seconds + CUT
    times = times_of(episode, FINE, seconds)
    places = _places_on_film(episode, times, speed)
    figure, film, force = _hero_axes(places, speed, seconds + CUT if cut else 0.0)
    _draw_ghosts(film, places)
    keys = times_of(episode, 0.25, seconds)
    for t, strength in zip(keys, np.linspace(0.3, 1.0, len(keys))):
        x = states_at(episode, np.array([t]))[0]
        Drawing(film, episode.physical, strength=strength).show(x, speed * (t - keys[0]) - x[0])
    if len(episode.U):
        t = episode.t - episode.t[0]
        shown = int(np.count_nonzero(t[:-1] < seconds - 1e-9))
        force.stairs(episode.U[:shown], t[:shown + 1], baseline=0, fill=True, color=FORCE,
                     alpha=0.85)
    if cut:
        _draw_end(film, force, episode, seconds, speed)
    limit_lines(force, episode.limits.force_limit)
    figure.text(0.055, 0.94, f'Swing-up by {solver_name(episode.solver)}', size=15, va='top',
                weight='bold')
    figure.text(0.055, 0.865, f'every 0.25 s, seen from the cart;\n{_ending(episode, length)}',
                size=10, va='top')
    return figure


def _draw_end(film: Axes, force: Axes, episode: Episode, seconds: float, speed: float) -> None:
    """Draw the last state beyond a cut of the film, and its time."""
    x, place = states_at(episode, episode.t[-1:])[0], speed * (seconds + CUT)
    Drawing(film, episode.physical).show(x, place - x[0])
    film.text(speed * (seconds + CUT / 2), TRACK, '⋯', size=18, ha='center', va='center',
              backgroundcolor='white', zorder=2)
    force.axvspan(seconds, seconds + CUT - 0.01, color='white', zorder=3)
    force.text(seconds + CUT / 2, 0.0, '⋯', size=14, ha='center', va='center', zorder=4)
    ticks = np.arange(0.0, seconds + 1e-9, 0.5)
    force.set_xticks([*ticks, seconds + CUT], [
        *(f'{tick:.1f}' for tick in ticks), f'{episode.t[-1] - episode.t[0]:.1f}'])


def _ending(episode: Episode, length: float) -> str:
    settled = settling_time(np.asarray(episode.t, dtype=float), episode.X)
    if math.isnan(settled):
        return f'not upright at the end, {length:.1f} s'
    return f'upright from {settled - episode.t[0]:.2f} to {length:.1f} s'


def _places_on_film(episode: Episode, times: Array, speed: float) -> Array:
    """Return the joint positions (M, n + 1, 2) [m], the cart moving at the film's speed."""
    X = states_at(episode, times)
    X[:, 0] = speed * (times - times[:1])
    return joint_positions(X, episode.physical.lengths)


def _hero_axes(places: Array, speed: float, until: float) -> tuple[Figure, Axes, Axes]:
    """Return axes with room for places (M, n + 1, 2) [m] above an axis of time to its scale."""
    finite = places[np.isfinite(places).all(axis=(1, 2))].reshape(-1, 2)
    corners = np.vstack([finite, [(0.0, -1.0), (speed * max(until, 1.0), 1.0)]])
    left, bottom = corners.min(axis=0) - (0.5, 0.25)
    right, top = corners.max(axis=0) + (0.5, 0.25)
    width, strip, below, margin = 11.0, 0.9, 0.5, 0.6  # [inch]
    height = width * (top - bottom) / (right - left)
    total = (width + margin, height + strip + below)
    figure = Figure(figsize=total)
    film = figure.add_axes((margin / total[0], (strip + below) / total[1],
                            width / total[0], height / total[1]))
    film.set(xlim=(left, right), ylim=(bottom, top))
    film.set_axis_off()
    force = figure.add_axes((margin / total[0], below / total[1],
                             width / total[0], strip / total[1]))
    force.set(xlim=(left / speed, right / speed), xlabel='time [s]', ylabel='force [N]')
    return figure, film, force


def _draw_ghosts(film: Axes, places: Array) -> None:
    """Draw every state as hairlines that grow stronger, and the paths of all tips."""
    film.axhline(TRACK, color=FAINT, linewidth=1.0, zorder=1)
    for link, colour in enumerate(LINKS[:places.shape[1] - 1]):
        colours = np.tile(to_rgba(colour), (len(places), 1))
        colours[:, 3] = np.linspace(0.06, 0.2, len(places))
        film.add_collection(LineCollection(list(places[:, link:link + 2]), colors=colours,
                                           linewidths=1.2))
        film.plot(*places[:, link + 1].T, color=colour, linewidth=1.2, alpha=0.8)
