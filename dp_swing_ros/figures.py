# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Pictures of an episode, drawn from the episode alone.

`snapshots` and `squared_error` redraw the paper's two kinds of figure (its Figs. 2 and 3).
"""

from collections.abc import Callable, Iterable, Sequence
import functools
import math
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import matplotlib
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrow, FancyBboxPatch
from matplotlib.ticker import FuncFormatter, MultipleLocator, NullFormatter
import numpy as np
from PIL import Image

from dp_swing_ros.dynamics.pendulum import joints
from dp_swing_ros.episode import Episode
from dp_swing_ros.parameters import PendulumParameters
from dp_swing_ros.state import ANGLES, Array, is_upright, SIZE, to_turn_of, UPRIGHT

# Okabe and Ito's palette: told apart by colour-blind readers, on white and in grey
INK, FAINT, PAPER = '#26323e', '#9aa5b1', '#f4f6f8'
LINK1, LINK2, CART, FORCE, ALARM = '#0072B2', '#D55E00', '#26323e', '#009E73', '#CC79A7'
COLOURS = (CART, LINK1, LINK2) * 2  # of the six states
SYMBOLS = ('$x$', r'$\theta_1$', r'$\theta_2$',
           r'$\dot x$', r'$\dot\theta_1$', r'$\dot\theta_2$')
SQUARES = ('m²', 'rad²', 'rad²', 'm²/s²', 'rad²/s²', 'rad²/s²')  # units of their squared errors
SOLVERS = {'ilqr': 'iLQR', 'ddp': 'DDP', 'mppi': 'MPPI'}
STYLE: dict[Any, Any] = {
    'axes.axisbelow': True, 'axes.edgecolor': FAINT, 'axes.labelcolor': INK,
    'axes.spines.right': False, 'axes.spines.top': False, 'axes.titlesize': 'medium',
    'figure.dpi': 120, 'figure.labelsize': 'medium', 'figure.titlesize': 'large',
    'font.size': 9.0, 'grid.color': '#e3e7eb', 'grid.linewidth': 0.8, 'legend.frameon': False,
    'lines.linewidth': 1.6, 'text.color': INK, 'xtick.color': INK, 'ytick.color': INK}

CART_SIZE = (0.44, 0.22)  # [m]
TRACK = -0.15             # [m] height of the track under the joint of the cart
ERROR_FLOOR = 1e-8        # squared errors below are drawn here: a log axis has no zero
FRAME = 0.05              # [s] between the pictures of an animation
LONGEST_ANIMATION = 30.0  # [s]
FINE = 0.0125             # [s] between the points of a trail

P = ParamSpec('P')
R = TypeVar('R')


def styled(draw: Callable[P, R]) -> Callable[P, R]:
    """Draw in the house style without touching the settings of the caller."""
    @functools.wraps(draw)
    def inside(*args: P.args, **kwargs: P.kwargs) -> R:
        with matplotlib.rc_context(STYLE):
            return draw(*args, **kwargs)
    return inside


def states_at(episode: Episode, times: Array) -> Array:
    """
    Return the states between the recorded ones, positions as cubics with the recorded speeds.

    Shapes: times (M,) [s] -> (M, 6); before the first and after the last state these hold.
    """
    t, X = np.asarray(episode.t, dtype=float), episode.X
    if len(t) < 2:
        return np.repeat(X[:1], len(times), axis=0)
    n = np.clip(np.searchsorted(t, times, side='right') - 1, 0, len(t) - 2)
    h = np.maximum(t[n + 1] - t[n], 1e-9)[:, None]
    s = np.clip((times - t[n])[:, None] / h, 0.0, 1.0)
    before, after = X[n], X[n + 1]
    positions = ((1 + 2 * s) * (1 - s) ** 2 * before[:, :3] + s ** 2 * (3 - 2 * s) * after[:, :3]
                 + h * s * (1 - s) * ((1 - s) * before[:, 3:] - s * after[:, 3:]))
    speeds = (1 - s) * before[:, 3:] + s * after[:, 3:]
    return np.concatenate([positions, speeds], axis=1)


def force_at(episode: Episode, t: float) -> float:
    """Return the force [N] that acts from a time [s] on."""
    n = int(np.searchsorted(episode.t, t + 1e-9)) - 1
    return float(episode.U[n]) if 0 <= n < len(episode.U) else 0.0


def _title(episode: Episode) -> str:
    return SOLVERS.get(episode.solver, episode.solver or 'no controller')


def _times(episode: Episode, period: float, until: float = math.inf) -> Array:
    """Return times from the first state to the last, or until a time, a period [s] apart."""
    if not len(episode.t):
        return np.zeros(0)
    length = min(episode.t[-1] - episode.t[0], until)
    return episode.t[0] + period * np.arange(math.floor(length / period + 0.02) + 1)


# The pendulum


class Drawing:
    """A cart with its two links on some axes, moved to one state after another."""

    def __init__(self, axes: Axes, bodies: PendulumParameters, size: float = 1.0,
                 strength: float = 1.0) -> None:
        self._bodies = bodies
        width, height = CART_SIZE
        self._cart = FancyBboxPatch(
            (0, -height / 2), width, height, boxstyle='round,pad=0,rounding_size=0.05',
            facecolor=_tint(CART, strength), edgecolor='none', zorder=3)
        axes.add_patch(self._cart)
        self._links = [
            axes.plot([], [], color=_tint(colour, strength), linewidth=4 * size,
                      solid_capstyle='round', zorder=4)[0] for colour in (LINK1, LINK2)]
        self._joints = axes.plot(
            [], [], 'o', color='white', markeredgecolor=_tint(INK, strength),
            markeredgewidth=size, markersize=3.6 * size, zorder=5)[0]

    def show(self, x: Array, shift: float = 0.0) -> None:
        """Move to the state x (6,), drawn a distance [m] to the right."""
        places = joints(x, self._bodies) + (shift, 0.0)
        self._cart.set_x(places[0, 0] - CART_SIZE[0] / 2)
        for link, line in enumerate(self._links):
            line.set_data(*places[link:link + 2].T)
        self._joints.set_data(*places[:2].T)


def _tint(colour: str, strength: float) -> tuple[float, ...]:
    """Return a colour mixed with white: 0 is white, and nothing shines through."""
    return tuple(1 - strength * (1 - part) for part in to_rgba(colour)[:3])


def _fading(points: Array, colour: str, width: float) -> LineCollection:
    """Return a line through points (M, 2) that is clear at its end and fades to its start."""
    pieces = np.stack([points[:-1], points[1:]], axis=1)
    colours = np.tile(to_rgba(colour), (len(pieces), 1))
    colours[:, 3] = 0.8 * np.linspace(0.0, 1.0, len(pieces)) ** 1.5
    return LineCollection(list(pieces), colors=colours, linewidths=width, capstyle='butt',
                          zorder=2)


def _trail(episode: Episode, t: float, length: float) -> Array:
    """Return the way (M, 2) [m] of the second tip over the time [s] before t."""
    times = np.linspace(max(t - length, episode.t[0]), t, max(2, round(length / FINE)))
    return joints(states_at(episode, times), episode.bodies)[:, 2]


def _scene(axes: Axes, episode: Episode, half_width: float) -> None:
    """Set the view and lay the track."""
    reach = episode.bodies.link1_length + episode.bodies.link2_length
    limit = episode.limits.track_limit + CART_SIZE[0] / 2
    end = min(limit, 2 * half_width)
    axes.plot([-end, end], [TRACK, TRACK], color=FAINT, linewidth=1.2, zorder=1)
    if limit <= half_width:
        for stop in (-limit, limit):
            axes.plot([stop, stop], [TRACK, TRACK + 0.25], color=FAINT, linewidth=2.5, zorder=1)
    axes.set(xlim=(-half_width, half_width), ylim=(-1.1 * reach, 1.1 * reach), aspect='equal')


def _half_width(episode: Episode) -> float:
    """Return how far [m] from the centre anything of the run gets, with a margin."""
    places = joints(episode.X, episode.bodies)[..., 0]
    reached = np.abs(places[np.isfinite(places)])
    reach = episode.bodies.link1_length + episode.bodies.link2_length
    return max(float(reached.max(initial=0.0)) + 0.2, 0.6 * reach)


@styled
def snapshots(episode: Episode) -> Figure:
    """Draw the pendulum every 0.5 s, left to right, then top to bottom (the paper's Fig. 2)."""
    most = 48
    length = episode.t[-1] - episode.t[0] if len(episode.t) else 0.0
    period = 0.5 * max(1, math.ceil(length / 0.5 / most))
    times = _times(episode, period)
    columns = _columns(len(times))
    rows = max(1, math.ceil(len(times) / columns))
    half_width = _half_width(episode)
    figure = Figure(figsize=(1.65 * max(columns, 3), 0.75 + rows * 1.65 * 2.2 / half_width),
                    layout='constrained')
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axes, t in zip(panels.flat, times):
        _snapshot(axes, episode, t, half_width)
    for axes in panels.flat[len(times):]:
        axes.set_axis_off()
    figure.suptitle(f'{_title(episode)}: the pendulum every {period:g} s (green: upright)')
    figure.supxlabel('x [m]')
    figure.supylabel('z [m]')
    return figure


def _columns(pictures: int) -> int:
    """Return the number of columns that leaves the fewest places empty."""
    if pictures <= 8:
        return max(pictures, 1)
    return min((8, 7, 6), key=lambda columns: -pictures % columns)


def _snapshot(axes: Axes, episode: Episode, t: float, half_width: float) -> None:
    _scene(axes, episode, half_width)
    x = states_at(episode, np.array([t]))[0]
    axes.add_collection(_fading(_trail(episode, t, 0.5), LINK2, 1.2))
    Drawing(axes, episode.bodies, size=0.7).show(x)
    axes.spines[:].set_visible(False)
    axes.set_facecolor(PAPER)
    axes.tick_params(length=0, labelsize='x-small')
    axes.xaxis.set_major_locator(MultipleLocator(1.0))
    axes.yaxis.set_major_locator(MultipleLocator(1.0))
    upright = bool(is_upright(x))
    axes.set_title(f'{t - episode.t[0]:.1f} s', fontsize='small', pad=2,
                   color=FORCE if upright else INK, weight='bold' if upright else 'normal')


# Curves over time


@styled
def squared_error(episode: Episode) -> Figure:
    """Draw the squared distance of the six states from upright at rest (the paper's Fig. 3)."""
    figure = Figure(figsize=(9.6, 5.0), layout='constrained')
    panels = figure.subplots(2, 3, sharex=True)
    error = to_turn_of(episode.X, np.array(UPRIGHT)) ** 2
    for i, axes in enumerate(panels.flat):
        curve = np.maximum(error[:, i], ERROR_FLOOR)
        axes.semilogy(episode.t, curve, color=COLOURS[i])
        axes.fill_between(episode.t, ERROR_FLOOR, curve, color=COLOURS[i], alpha=0.08,
                          linewidth=0)
        if i > 0:
            bound = 0.1 if i in range(SIZE)[ANGLES] else 1.0
            axes.axhline(bound ** 2, color=FAINT, linestyle='--', linewidth=1)
        axes.set(ylim=(ERROR_FLOOR, None), ylabel=f'error of {SYMBOLS[i]} [{SQUARES[i]}]')
        axes.grid(True)
    for axes in panels[1]:
        axes.set_xlabel('time [s]')
    figure.suptitle(f'{_title(episode)}: squared error of the states over time '
                    '(dashed: what counts as upright)')
    return figure


@styled
def timeline(episode: Episode) -> Figure:
    """Draw angles, position, force and the controller's times over time, one below another."""
    figure = Figure(figsize=(9.6, 8.4), layout='constrained')
    angles, position, force, times = figure.subplots(
        4, 1, sharex=True, height_ratios=(1.2, 0.8, 1.0, 1.2))
    _draw_angles(angles, episode)
    _draw_position(position, episode)
    _draw_force(force, episode)
    _draw_times(times, episode)
    for axes in (angles, position, force, times):
        axes.grid(True)
        axes.margins(x=0.01)
    times.set_xlabel('time [s]')
    figure.align_ylabels()
    figure.suptitle(f'{_title(episode)}: the run over time')
    return figure


def _draw_angles(axes: Axes, episode: Episode) -> None:
    # whole turns that bring the end of the run next to upright
    turns = np.zeros(2) if not len(episode.t) else np.round(episode.X[-1, ANGLES] / (2 * np.pi))
    for i, colour in ((1, LINK1), (2, LINK2)):
        axes.plot(episode.t, episode.X[:, i] - 2 * np.pi * np.nan_to_num(turns[i - 1]),
                  color=colour, label=SYMBOLS[i])
    axes.yaxis.set_major_locator(MultipleLocator(np.pi))
    axes.yaxis.set_major_formatter(FuncFormatter(_in_turns))
    axes.set_ylabel('angle [rad]\n0 is upright')
    _legend(axes)


def _in_turns(angle: float, _: int | None = None) -> str:
    halves = round(angle / np.pi)
    return {0: '0', 1: 'π', -1: '−π'}.get(halves, f'{halves}π'.replace('-', '−'))


def _draw_position(axes: Axes, episode: Episode) -> None:
    axes.plot(episode.t, episode.X[:, 0], color=CART, label='cart')
    _limits(axes, episode.limits.track_limit, 'end stops')
    axes.set_ylabel('position $x$ [m]')
    _legend(axes)


def _draw_force(axes: Axes, episode: Episode) -> None:
    if len(episode.U):
        axes.stairs(episode.U, episode.t, baseline=None, color=FORCE, linewidth=1.4,
                    label='applied')
    _limits(axes, episode.limits.force_limit, 'limits')
    axes.set_ylabel('force $u$ [N]')
    _legend(axes)


def _limits(axes: Axes, limit: float, label: str) -> None:
    if math.isfinite(limit):
        axes.axhline(limit, color=FAINT, linestyle='--', linewidth=1, label=label)
        axes.axhline(-limit, color=FAINT, linestyle='--', linewidth=1)


def _draw_times(axes: Axes, episode: Episode) -> None:
    ticks = episode.ticks
    late = np.asarray(ticks.late, dtype=bool)
    axes.plot(ticks.t, 1e3 * ticks.solve_time, '.', color=LINK1, markersize=4,
              label='solve time')
    axes.plot(ticks.t, 1e3 * ticks.latency, '.', color=LINK2, markersize=4,
              label='latency, state to force')
    if late.any():
        axes.plot(ticks.t[late], 1e3 * ticks.solve_time[late], 'o', color='none', markersize=8,
                  markeredgecolor=ALARM, markeredgewidth=1.6,
                  label=f'late ({np.count_nonzero(late)})')
    if len(episode.t) > 1:
        axes.axhline(1e3 * float(np.median(np.diff(episode.t))), color=FAINT, linestyle='--',
                     linewidth=1, label='period')
    axes.set_yscale('log')
    low, high = np.log10(axes.get_ylim())
    axes.set_ylim(10 ** math.floor(low), 10 ** math.ceil(high))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f'{value:g}'))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_ylabel('time [ms]')
    _legend(axes)


def _legend(axes: Axes) -> None:
    axes.legend(loc='lower left', bbox_to_anchor=(0.0, 0.98), ncols=4, borderaxespad=0.0,
                fontsize='small', handlelength=1.4)


# The picture for a first look


@styled
def hero(episode: Episode, seconds: float = 4.0, speed: float = 3.4) -> Figure:
    """
    Draw the swing-up as on film that runs past the cart: again and again, to the right with time.

    The film runs at `speed` [m/s], so that every cart stands above the force of its moment.
    """
    times = _times(episode, FINE, seconds)
    places = _places_on_film(episode, times, speed)
    figure, film, force = _hero_axes(places, speed)
    _draw_ghosts(film, places)
    keys = _times(episode, 0.25, seconds)
    for t, strength in zip(keys, np.linspace(0.3, 1.0, len(keys))):
        x = states_at(episode, np.array([t]))[0]
        Drawing(film, episode.bodies, strength=strength).show(x, speed * (t - keys[0]) - x[0])
    if len(episode.U):
        force.stairs(episode.U, episode.t - episode.t[0], baseline=0, fill=True, color=FORCE,
                     alpha=0.85)
    _limits(force, episode.limits.force_limit, '')
    figure.text(0.055, 0.94, f'Swing-up by {_title(episode)}', size=15, va='top',
                weight='bold')
    figure.text(0.055, 0.865, 'every 0.25 s, seen from the cart', size=10, va='top')
    return figure


def _places_on_film(episode: Episode, times: Array, speed: float) -> Array:
    """Return the places (M, 3, 2) [m] of cart and tips, the cart moving at the film's speed."""
    X = states_at(episode, times)
    X[:, 0] = speed * (times - times[:1])
    return joints(X, episode.bodies)


def _hero_axes(places: Array, speed: float) -> tuple[Figure, Axes, Axes]:
    """Return a figure with room for places (M, 3, 2) [m] above an axis of time to its scale."""
    finite = places[np.isfinite(places).all(axis=(1, 2))].reshape(-1, 2)
    corners = np.vstack([finite, [(0.0, -1.0), (speed, 1.0)]])
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
    """Draw every state as hairlines that grow stronger, and the ways of both tips."""
    film.axhline(TRACK, color=FAINT, linewidth=1.0, zorder=1)
    for link, colour in enumerate((LINK1, LINK2)):
        colours = np.tile(to_rgba(colour), (len(places), 1))
        colours[:, 3] = np.linspace(0.06, 0.2, len(places))
        film.add_collection(LineCollection(list(places[:, link:link + 2]), colors=colours,
                                           linewidths=1.2))
        film.plot(*places[:, link + 1].T, color=colour, linewidth=1.2, alpha=0.8)


# The animation


@styled
def animation(episode: Episode, path: Path,
              progress: Callable[[Sequence[float]], Iterable[float]] = iter) -> None:
    """
    Write a GIF of the run in real time, 20 pictures a second.

    `progress` wraps the times of the pictures, as tqdm does. Raises ValueError without states.
    """
    if not len(episode.t):
        raise ValueError('an episode without states cannot be animated')
    film, palette = _Film(episode), _palette()
    first, *others = (
        Image.fromarray(film.picture(t)).quantize(palette=palette, dither=Image.Dither.NONE)
        for t in progress(list(_times(episode, FRAME, LONGEST_ANIMATION))))
    first.save(path, save_all=True, append_images=others, duration=round(1000 * FRAME), loop=0)


def _palette() -> Image.Image:
    """Return white and the house colours on their way to it: one palette, so nothing flickers."""
    # Pillow looks up colours coarsely: white stays white only if nothing is close to it
    strengths = np.linspace(0.1, 1.0, 40)
    colours = [(1.0, 1.0, 1.0), *(_tint(colour, strength) for strength in strengths
                                  for colour in (INK, FAINT, LINK1, LINK2, FORCE))]
    palette = Image.new('P', (1, 1))
    palette.putpalette(np.round(255 * np.array(colours)).astype(np.uint8).tobytes())
    return palette


class _Film:
    """The axes of an animation, redrawn for one time after another."""

    def __init__(self, episode: Episode) -> None:
        self._episode = episode
        self._figure = Figure(figsize=(5.6, 4.6), dpi=90)
        self._canvas = FigureCanvasAgg(self._figure)
        self._axes = self._figure.add_axes((0.0, 0.0, 1.0, 0.92))
        # as wide as the picture, or as the run needs
        reach = episode.bodies.link1_length + episode.bodies.link2_length
        _scene(self._axes, episode, max(_half_width(episode), 1.1 * reach * 5.6 / (0.92 * 4.6)))
        self._axes.set_axis_off()
        self._figure.text(0.04, 0.93, _title(episode), size=13, weight='bold')
        self._clock = self._figure.text(0.46, 0.93, '', size=11)
        self._force = self._figure.text(0.96, 0.93, '', size=11, ha='right', color=FORCE)
        self._drawing = Drawing(self._axes, episode.bodies, size=1.2)

    def picture(self, t: float) -> Array:
        """Return the pixels (height, width, 3) at a time [s]."""
        episode = self._episode
        x, u = states_at(episode, np.array([t]))[0], force_at(episode, t)
        self._drawing.show(x)
        self._clock.set_text(f'{t - episode.t[0]:.2f} s')
        self._force.set_text(f'{u:+.1f} N'.replace('-', '−'))
        trail = self._axes.add_collection(_fading(_trail(episode, t, 1.0), LINK2, 2.0))
        arrow = self._axes.add_patch(_arrow(x[0], u))
        self._canvas.draw()
        trail.remove()
        arrow.remove()
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()


def _arrow(x: float, u: float) -> FancyArrow:
    """Return an arrow beside the cart at x [m] that shows the force u [N]."""
    length = 0.05 * u
    head = min(0.18, abs(length))
    return FancyArrow(x + math.copysign(CART_SIZE[0] / 2 + 0.04, u), 0.0, length, 0.0,
                      width=0.3 * head, head_width=head, head_length=head, color=FORCE,
                      length_includes_head=True, visible=abs(u) > 0.5, zorder=6)
