# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pendulum at one moment after another: still, as in the paper's Fig. 2, and animated."""

from collections.abc import Callable, Iterable, Sequence
import math
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrow
from matplotlib.ticker import MultipleLocator
import numpy as np
from PIL import Image

from dp_swing_ros.figures.pendulum import (
    Arrow, CART_SIZE, draw_pendulum, draw_scene, draw_trail, force_at, room_for, states_at,
    times_of)
from dp_swing_ros.figures.style import (
    FAINT, FORCE, INK, LINKS, mark, panels_of, PAPER, solver_name, styled, tint, WARNING)
from dp_swing_ros.pendulum.state import is_upright
from dp_swing_ros.simulation.episode import Episode

MOST = 48                 # pictures on a sheet
FRAME = 0.05              # [s] between the pictures of an animation
LONGEST_ANIMATION = 30.0  # [s]


@styled
def snapshots(episode: Episode) -> Figure:
    """Draw the pendulum every 0.5 s, left to right, then top to bottom (the paper's Fig. 2)."""
    period = 0.5 * max(1, math.ceil(episode.t[-1] / 0.5 / MOST))
    times = times_of(episode, period)
    # the number of columns that leaves the fewest places empty
    columns = len(times) if len(times) <= 8 else min((8, 7, 6), key=lambda n: -len(times) % n)
    half_width = room_for(episode)
    height = 1.65 * 1.1 * sum(episode.physical.lengths) / half_width  # [inch] of a picture
    figure = Figure(figsize=(1.65 * max(columns, 3),
                             0.75 + math.ceil(len(times) / columns) * height),
                    layout='constrained')
    panels = panels_of(figure, len(times), columns, sharex=True, sharey=True)
    for axes, t in zip(panels, times):
        snapshot(axes, episode, t, half_width)
    figure.suptitle(f'{solver_name(episode.solver)}: the pendulum every {period:g} s '
                    '(bold: upright)')
    figure.supxlabel('x [m]')
    figure.supylabel('z [m]')
    return figure


def snapshot(axes: Axes, episode: Episode, t: float, half_width: float) -> None:
    """Draw the pendulum at a time [s], with the path of its tip before that."""
    draw_scene(axes, episode, half_width)
    x, = states_at(episode, np.array([t]))
    draw_trail(axes, episode, t, 0.5, 1.2)
    draw_pendulum(axes, episode.physical, x, size=0.7)
    axes.spines[:].set_visible(False)
    axes.set_facecolor(PAPER)
    axes.tick_params(length=0, labelsize='x-small')
    axes.xaxis.set_major_locator(MultipleLocator(1.0))
    axes.yaxis.set_major_locator(MultipleLocator(1.0))
    digits = 1 if abs(t - round(t, 1)) < 1e-6 else 2
    axes.set_title(f'{t:.{digits}f} s', fontsize='small', pad=2,
                   weight='bold' if is_upright(x) else 'normal')


@styled
def animation(episode: Episode, path: Path,
              progress: Callable[[Sequence[float]], Iterable[float]] = iter) -> None:
    """
    Write a GIF of the run in real time, 20 pictures a second.

    `progress` wraps the times of the pictures, as tqdm does.
    """
    width, height, head = 5.6, 4.6, 0.08  # [inch], and the share above the scene
    figure = Figure(figsize=(width, height), dpi=90)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0 - head))
    # as wide as the picture, or as the run needs
    reach = 1.1 * sum(episode.physical.lengths)
    draw_scene(axes, episode, max(room_for(episode), reach * width / ((1.0 - head) * height)))
    axes.set_axis_off()
    figure.text(0.04, 0.93, solver_name(episode.solver), size=13, weight='bold')
    mark(figure, episode.incomplete)
    canvas, palette = FigureCanvasAgg(figure), _palette()
    first, *others = (
        _picture(canvas, axes, episode, t).quantize(palette=palette, dither=Image.Dither.NONE)
        for t in progress(list(times_of(episode, FRAME, LONGEST_ANIMATION))))
    first.save(path, save_all=True, append_images=others, duration=round(1000 * FRAME), loop=0)


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
    moving = [*draw_pendulum(axes, episode.physical, x, size=1.2),
              draw_trail(axes, episode, t, 1.0, 2.0), axes.add_patch(_arrow(x[0], u)),
              canvas.figure.text(0.46, 0.93, f'{t:.2f} s', size=11),
              canvas.figure.text(0.96, 0.93, f'{u:+.1f} N'.replace('-', '−'), size=11,
                                 ha='right', color=FORCE)]
    canvas.draw()
    for artist in moving:
        artist.remove()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3])


def _arrow(x: float, u: float) -> FancyArrow:
    """Return an arrow beside the cart at x [m] that shows the force u [N]."""
    look = Arrow()
    length = look.scale * u
    head = min(look.head, abs(length))
    return FancyArrow(x + math.copysign(CART_SIZE[0] / 2 + look.gap, u), 0.0, length, 0.0,
                      width=0.3 * head, head_width=head, head_length=head, color=FORCE,
                      length_includes_head=True, visible=abs(u) > look.least, zorder=6)
