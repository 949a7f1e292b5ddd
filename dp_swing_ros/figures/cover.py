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
from dp_swing_ros.figures.pendulum import draw_pendulum, FINE, states_at, times_of, TRACK
from dp_swing_ros.figures.style import FAINT, FORCE, limit_lines, LINKS, solver_name, styled
from dp_swing_ros.pendulum.geometry import joint_positions
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.simulation.episode import Episode

SPEED = 3.4      # [m/s] of the film
BETWEEN = 0.25   # [s] between two carts
TICK = 0.5       # [s] on the axis of time
UP = 1.0         # [s] upright that are shown before the cut, at least
SHORTEST, LONGEST = 4.0, 10.0  # [s] of film before the cut
CUT = 0.5        # [s] on the film between what it shows and the last state


@styled
def hero(episode: Episode) -> Figure:
    """
    Draw the swing-up as on film that runs past the cart: again and again, to the right with time.

    Every cart stands above the force of its moment. Of a run that goes on for long after it has
    settled the film is cut, and ends with the last state.
    """
    length, settled = float(episode.t[-1]), settling_time(episode.t, episode.X)
    seconds = SHORTEST if math.isnan(settled) else min(
        max(SHORTEST, TICK * math.ceil((settled + UP) / TICK)), LONGEST)
    cut = length > seconds + CUT
    times, fine = (times_of(episode, period, seconds) for period in (BETWEEN, FINE))
    keys = _on_film(states_at(episode, times), times)
    ghosts = _on_film(states_at(episode, fine), fine)
    strengths = np.linspace(0.3, 1.0, len(keys))
    if cut:
        keys = np.vstack([keys, _on_film(episode.X[-1:], seconds + CUT)])
        strengths = np.append(strengths, 1.0)
    lengths = episode.physical.lengths
    figure, film, force = _hero_axes(joint_positions(np.vstack([ghosts, keys]), lengths),
                                     sum(lengths))
    _draw_ghosts(film, joint_positions(ghosts, lengths))
    for x, strength in zip(keys, strengths):
        draw_pendulum(film, episode.physical, x, strength=strength)
    if len(episode.U):
        shown = int(np.count_nonzero(episode.t[:-1] < seconds - 1e-9))
        force.stairs(episode.U[:shown], episode.t[:shown + 1], baseline=0, fill=True,
                     color=FORCE, alpha=0.85)
    if cut:
        _mark_cut(film, force, seconds, length)
    limit_lines(force, episode.limits.force_limit)
    ending = f'not upright at the end, {length:.1f} s' if math.isnan(settled) \
        else f'upright from {settled:.2f} to {length:.1f} s'
    # long links reach up to it
    readable = {'color': 'white', 'alpha': 0.7, 'linewidth': 0, 'pad': 1}
    figure.text(0.055, 0.94, f'Swing-up by {solver_name(episode.solver)}', size=15, va='top',
                weight='bold', bbox=readable)
    figure.text(0.055, 0.865, f'every {BETWEEN:g} s, seen from the cart;\n{ending}', size=10,
                va='top', bbox=readable)
    return figure


def _on_film(X: Array, t: Array | float) -> Array:
    """Return states (M, 2n + 2) with the cart where the film is at their times [s]."""
    moved = X.copy()
    # by a sum: a state that is not known stays so, and no cart is drawn of it
    moved[:, 0] += SPEED * t - X[:, 0]
    return moved


def _hero_axes(places: Array, reach: float) -> tuple[Figure, Axes, Axes]:
    """
    Return axes with room for places (M, n + 1, 2) [m] above an axis of time to its scale.

    They are as high as links of a length [m] in all reach up and down.
    """
    left = np.nanmin(places[..., 0], initial=0.0) - 0.5
    right = np.nanmax(places[..., 0], initial=SPEED) + 0.5
    top = reach + 0.25
    width, strip, below, margin = 11.0, 0.9, 0.5, 0.6  # [inch]
    height = width * 2 * top / (right - left)
    total = (width + margin, height + strip + below)
    figure = Figure(figsize=total)
    film, force = figure.subplots(2, 1, height_ratios=(height, strip), gridspec_kw={
        'left': margin / total[0], 'right': 1.0, 'bottom': below / total[1], 'top': 1.0,
        'hspace': 0.0})
    film.set(xlim=(left, right), ylim=(-top, top))
    film.set_axis_off()
    force.set(xlim=(left / SPEED, right / SPEED), xlabel='time [s]', ylabel='force [N]')
    return figure, film, force


def _draw_ghosts(film: Axes, places: Array) -> None:
    """Draw every state as hairlines that grow stronger, and the paths of all tips."""
    film.axhline(TRACK, color=FAINT, linewidth=1.0, zorder=1)
    for link, colour in enumerate(LINKS[:places.shape[1] - 1]):
        colours = [to_rgba(colour, strength) for strength in np.linspace(0.06, 0.2, len(places))]
        film.add_collection(LineCollection(list(places[:, link:link + 2]), colors=colours,
                                           linewidths=1.2))
        film.plot(*places[:, link + 1].T, color=colour, linewidth=1.2, alpha=0.8)


def _mark_cut(film: Axes, force: Axes, seconds: float, length: float) -> None:
    """Leave out what comes after some seconds of a run of a length [s] but for its end."""
    middle = seconds + CUT / 2
    film.text(SPEED * middle, TRACK, '⋯', size=18, ha='center', va='center',
              backgroundcolor='white', zorder=2)
    force.axvspan(seconds, seconds + CUT - 0.01, color='white', zorder=3)
    force.text(middle, 0.0, '⋯', size=14, ha='center', va='center', zorder=4)
    ticks = np.arange(0.0, seconds + 1e-9, TICK)
    force.set_xticks([*ticks, seconds + CUT],
                     [*(f'{tick:.1f}' for tick in ticks), f'{length:.1f}'])
