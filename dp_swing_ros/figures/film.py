# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pendulum at one moment after another: as the paper's Fig. 2, in one picture, animated."""

from collections.abc import Callable, Iterable, Sequence
import math
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrow
from matplotlib.ticker import MultipleLocator
import numpy as np
from PIL import Image

from dp_swing_ros.evaluation.metrics import settling_time
from dp_swing_ros.figures.pendulum import (
    arrow_size, cart_size, draw_pendulum, draw_scene, draw_trail, FINE, force_at, room_for,
    states_at, times_of, TRACK)
from dp_swing_ros.figures.style import (
    FAINT, FORCE, INK, input_name, limit_lines, LINKS, mark, panels_of, PAPER, solver_name,
    styled, tint, unit_of_input, WARNING)
from dp_swing_ros.pendulum.equations import errors_from_rest, Pendulum, scale_of
from dp_swing_ros.pendulum.geometry import drawn_scale, joint_positions
from dp_swing_ros.pendulum.state import Array, is_upright
from dp_swing_ros.pendulum.units import decimals, rounded, Units
from dp_swing_ros.simulation.episode import Episode

SNAPSHOTS = 24   # at most
# all of the default bodies, and scaled for others as they are drawn
SPEED = 3.4      # [m/s] of the film that runs past the cart
BETWEEN = 0.25   # [s] between two carts on it
TICK = 0.5       # [s] on its axis of time
UP = 1.0         # [s] upright that it shows before its cut, at least
SHORTEST, LONGEST = 4.0, 10.0  # [s] of it before the cut
CUT = 0.5        # [s] on it between what it shows and the last state
GAP = 0.01       # [s] between that and its force
SIDE, TOP = 0.5, 0.25          # [m] of the film beside and above what it shows
METRE = 1.0      # [m] between ticks of axes in space
FRAME = 0.05     # [s] between the pictures of an animation
LONGEST_ANIMATION = 30.0       # [s]
COUNT, SOONEST = 0.01, 0.02    # [s] in which a GIF counts, and the least that browsers show


@styled
def snapshots(episode: Episode) -> Figure:
    """Draw the pendulum as it moved, left to right, then top to bottom (the paper's Fig. 2)."""
    times = episode.t[by_motion(joint_positions(episode.X, episode.physical.lengths), SNAPSHOTS)]
    # the number of columns that leaves the fewest places empty
    columns = len(times) if len(times) <= 8 else min((8, 7, 6), key=lambda n: -len(times) % n)
    half_width = room_for(episode)
    height = 1.65 * 1.1 * sum(episode.physical.lengths) / half_width  # [inch] of a picture
    figure = Figure(figsize=(1.65 * max(columns, 3),
                             0.75 + math.ceil(len(times) / columns) * height),
                    layout='constrained')
    panels = panels_of(figure, len(times), columns, sharex=True, sharey=True)
    for n, (axes, t) in enumerate(zip(panels, times)):
        snapshot(axes, episode, t, half_width)
        # shared axes show no numbers inside, but the layout would measure them
        axes.xaxis.set_visible(n // columns == (len(times) - 1) // columns)
        axes.yaxis.set_visible(n % columns == 0)
    figure.suptitle(f'{solver_name(episode.solver)}: after equal parts of the motion, and at the '
                    'end (bold: upright)')
    figure.supxlabel('x [m]')
    figure.supylabel('z [m]')
    return figure


def by_motion(places: Array, count: int) -> Array:
    """
    Return the numbers of the first and the last state, and of such between that equal ways apart.

    A way is that of all joints together; where a state is not known, none was made. What stands
    still has fewer than `count`. Shapes: places (N, n + 1, 2) [m] -> (at most count,).
    """
    steps = np.nan_to_num(np.linalg.norm(np.diff(places, axis=0), axis=-1)).sum(axis=-1)
    way = np.append(0.0, np.cumsum(steps))
    parts = np.linspace(0.0, way[-1], count)[:-1]
    return np.unique(np.append(np.searchsorted(way, parts), len(way) - 1))


def snapshot(axes: Axes, episode: Episode, t: float, half_width: float) -> None:
    """Draw the pendulum at a time [s], with the path of its tip before that."""
    draw_scene(axes, episode, half_width)
    x, = states_at(episode, np.array([t]))
    draw_trail(axes, episode, t, 0.5, 1.2)
    draw_pendulum(axes, episode.physical, x, size=0.7)
    axes.spines[:].set_visible(False)
    axes.set_facecolor(PAPER)
    axes.tick_params(length=0, labelsize='x-small')
    metre = rounded(drawn_scale(episode.physical).sized(METRE, 'm'))
    axes.xaxis.set_major_locator(MultipleLocator(metre))
    axes.yaxis.set_major_locator(MultipleLocator(metre))
    digits = 1 if abs(t - round(t, 1)) < 1e-6 else 2
    up = is_upright(errors_from_rest(Pendulum.of(episode.physical), x, episode.x_r),
                    scale_of(episode.physical))
    axes.set_title(f'{t:.{digits}f} s', fontsize='small', pad=2,
                   weight='bold' if up else 'normal')


@styled
def hero(episode: Episode) -> Figure:
    """
    Draw the swing-up as on film that runs past the cart: again and again, to the right with time.

    Every cart stands above the force of its moment. Of a run that goes on for long after it has
    settled the film is cut, and ends with the last state.
    """
    scale = _film_scale(episode)
    length = float(episode.t[-1])
    settled = settling_time(episode.t, episode.errors, scale_of(episode.physical))
    between, tick, up, shortest, longest, gap = (
        scale.sized(time, 's') for time in (BETWEEN, TICK, UP, SHORTEST, LONGEST, CUT))
    seconds = shortest if math.isnan(settled) else min(
        max(shortest, tick * math.ceil((settled + up) / tick)), longest)
    cut = length > seconds + gap
    times, fine = (times_of(episode, period, seconds)
                   for period in (between, scale.sized(FINE, 's')))
    keys = _on_film(states_at(episode, times), times, scale)
    ghosts = _on_film(states_at(episode, fine), fine, scale)
    strengths = np.linspace(0.3, 1.0, len(keys))
    if cut:
        keys = np.vstack([keys, _on_film(episode.X[-1:], seconds + gap, scale)])
        strengths = np.append(strengths, 1.0)
    lengths = episode.physical.lengths
    figure, film, force = _hero_axes(joint_positions(np.vstack([ghosts, keys]), lengths),
                                     sum(lengths), scale)
    _draw_ghosts(film, joint_positions(ghosts, lengths), scale)
    for x, strength in zip(keys, strengths):
        draw_pendulum(film, episode.physical, x, strength=strength)
    if len(episode.U):
        shown = int(np.count_nonzero(episode.t[:-1] < seconds - 1e-9))
        force.stairs(episode.U[:shown], episode.t[:shown + 1], baseline=0, fill=True,
                     color=FORCE, alpha=0.85)
    if cut:
        _mark_cut(film, force, seconds, length, scale)
    limit_lines(force, episode.limits.applied_limit(episode.bodies.drive))
    force.set_ylabel(input_name(episode.bodies.drive))
    ending = f'not upright at the end, {length:.1f} s' if math.isnan(settled) \
        else f'upright from {settled:.2f} to {length:.1f} s'
    # long links reach up to it
    readable = {'color': 'white', 'alpha': 0.7, 'linewidth': 0, 'pad': 1}
    figure.text(0.055, 0.94, f'Swing-up by {solver_name(episode.solver)}', size=15, va='top',
                weight='bold', bbox=readable)
    figure.text(0.055, 0.865, f'every {between:g} s, seen from the cart;\n{ending}', size=10,
                va='top', bbox=readable)
    return figure


def _film_scale(episode: Episode) -> Units:
    """Return how many times larger the film is than of the default bodies; its ticks are round."""
    scale = drawn_scale(episode.physical)
    return scale._replace(time=rounded(TICK * scale.time) / TICK)


def _on_film(X: Array, t: Array | float, scale: Units) -> Array:
    """Return states (M, 2n + 2) with the cart where the film is at their times [s]."""
    moved = X.copy()
    # by a sum: a state that is not known stays so, and no cart is drawn of it
    moved[:, 0] += scale.sized(SPEED, 'm/s') * t - X[:, 0]
    return moved


def _hero_axes(places: Array, reach: float, scale: Units) -> tuple[Figure, Axes, Axes]:
    """
    Return axes with room for places (M, n + 1, 2) [m] above an axis of time to its scale.

    They are as high as links of a length [m] in all reach up and down.
    """
    side, top = scale.sized(SIDE, 'm'), reach + scale.sized(TOP, 'm')
    speed = scale.sized(SPEED, 'm/s')
    left = np.nanmin(places[..., 0], initial=0.0) - side
    right = np.nanmax(places[..., 0], initial=speed * scale.time) + side
    width, strip, below, margin = 11.0, 0.9, 0.5, 0.6  # [inch]
    height = width * 2 * top / (right - left)
    total = (width + margin, height + strip + below)
    figure = Figure(figsize=total)
    film, force = figure.subplots(2, 1, height_ratios=(height, strip), gridspec_kw={
        'left': margin / total[0], 'right': 1.0, 'bottom': below / total[1], 'top': 1.0,
        'hspace': 0.0})
    film.set(xlim=(left, right), ylim=(-top, top))
    film.set_axis_off()
    force.set(xlim=(left / speed, right / speed), xlabel='time [s]')
    return figure, film, force


def _draw_ghosts(film: Axes, places: Array, scale: Units) -> None:
    """Draw every state as hairlines that grow stronger, and the paths of all tips."""
    film.axhline(scale.sized(TRACK, 'm'), color=FAINT, linewidth=1.0, zorder=1)
    for link, colour in enumerate(LINKS[:places.shape[1] - 1]):
        colours = [to_rgba(colour, strength) for strength in np.linspace(0.06, 0.2, len(places))]
        film.add_collection(LineCollection(list(places[:, link:link + 2]), colors=colours,
                                           linewidths=1.2))
        film.plot(*places[:, link + 1].T, color=colour, linewidth=1.2, alpha=0.8)


def _mark_cut(film: Axes, force: Axes, seconds: float, length: float, scale: Units) -> None:
    """Leave out what comes after some seconds of a run of a length [s] but for its end."""
    cut, tick = scale.sized(CUT, 's'), scale.sized(TICK, 's')
    middle = seconds + cut / 2
    film.text(scale.sized(SPEED, 'm/s') * middle, scale.sized(TRACK, 'm'), '⋯', size=18,
              ha='center', va='center', backgroundcolor='white', zorder=2)
    force.axvspan(seconds, seconds + cut - scale.sized(GAP, 's'), color='white', zorder=3)
    force.text(middle, 0.0, '⋯', size=14, ha='center', va='center', zorder=4)
    ticks = np.arange(0.0, seconds + 1e-9, tick)
    digits = max(len(f'{tick:g}'.partition('.')[2]), 1)
    force.set_xticks([*ticks, seconds + cut],
                     [f'{each:.{digits}f}' for each in (*ticks, length)])


@styled
def animation(episode: Episode, path: Path,
              progress: Callable[[Sequence[float]], Iterable[float]] = iter) -> None:
    """
    Write a GIF of the run in real time, 20 pictures a second, of a faster pendulum 50 at most.

    `progress` wraps the times of the pictures, as tqdm does.
    """
    width, height, head = 5.6, 4.6, 0.08  # [inch], and the share above the scene
    figure = Figure(figsize=(width, height), dpi=90)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0 - head))
    scale = drawn_scale(episode.physical)
    period = max(COUNT * round(scale.time * FRAME / COUNT), SOONEST)
    # as wide as the picture, or as the run needs
    reach = 1.1 * sum(episode.physical.lengths)
    draw_scene(axes, episode, max(room_for(episode), reach * width / ((1.0 - head) * height)))
    axes.set_axis_off()
    figure.text(0.04, 0.93, solver_name(episode.solver), size=13, weight='bold')
    mark(figure, episode.incomplete)
    canvas, palette = FigureCanvasAgg(figure), _palette()
    first, *others = (
        _picture(canvas, axes, episode, t).quantize(palette=palette, dither=Image.Dither.NONE)
        for t in progress(list(times_of(
            episode, period, scale.sized(LONGEST_ANIMATION, 's')))))
    first.save(path, save_all=True, append_images=others, duration=round(1000 * period), loop=0)


def _palette() -> Image.Image:
    """Return white and the house colours on their way to it: one palette, so nothing flickers."""
    # Pillow looks up colours coarsely: white stays white only if nothing is close to it
    strengths = np.linspace(0.1, 1.0, 36)
    colours = [(1.0, 1.0, 1.0), *(tint(colour, strength) for strength in strengths
                                  for colour in (INK, FAINT, *LINKS, FORCE, WARNING))]
    palette = Image.new('P', (1, 1))
    palette.putpalette(np.round(255 * np.array(colours)).astype(np.uint8).tobytes())
    return palette


def _picture(canvas: FigureCanvasAgg, axes: Axes, episode: Episode, t: float) -> Image.Image:
    """Return the picture at a time [s]: what moves is drawn, and taken away again."""
    (x,), u = states_at(episode, np.array([t])), force_at(episode, t)
    scale = drawn_scale(episode.physical)
    force = '' if math.isnan(u) else (   # of a log without any
        f'{u:+.{decimals(1, scale.factor("N"))}f} {unit_of_input(episode.bodies.drive)}')
    moving = [*draw_pendulum(axes, episode.physical, x, size=1.2),
              draw_trail(axes, episode, t, 1.0, 2.0), axes.add_patch(_arrow(x[0], u, scale)),
              canvas.figure.text(0.46, 0.93, f'{t:.2f} s', size=11),
              canvas.figure.text(0.96, 0.93, force.replace('-', '−'), size=11, ha='right',
                                 color=FORCE)]
    canvas.draw()
    for artist in moving:
        artist.remove()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])


def _arrow(x: float, u: float, scale: Units) -> FancyArrow:
    """Return an arrow beside the cart at x [m] that shows the force u [N]."""
    size = arrow_size(scale)
    length = size['scale'] * u
    head = min(size['head'], abs(length))
    return FancyArrow(x + math.copysign(cart_size(scale)[0] / 2 + size['gap'], u), 0.0, length,
                      0.0, width=0.3 * head, head_width=head, head_length=head, color=FORCE,
                      length_includes_head=True, visible=abs(u) > size['least'], zorder=6)
