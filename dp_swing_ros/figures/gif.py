# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The animation."""

from collections.abc import Callable, Iterable, Sequence
import math
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrow
import numpy as np
from PIL import Image

from dp_swing_ros.figures.pendulum import Arrow, CART_SIZE, Drawing, room_for, scene, trail_of
from dp_swing_ros.figures.sampling import force_at, states_at, times_of
from dp_swing_ros.figures.style import (
    FAINT, FORCE, INK, LINKS, mark, solver_name, styled, tint, WARNING)
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.simulation.episode import Episode

FRAME = 0.05              # [s] between the pictures of an animation
LONGEST_ANIMATION = 30.0  # [s]


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


class _Film:
    """The axes of an animation, redrawn for one time after another."""

    def __init__(self, episode: Episode) -> None:
        self._episode = episode
        self._figure = Figure(figsize=(5.6, 4.6), dpi=90)
        self._canvas = FigureCanvasAgg(self._figure)
        self._axes = self._figure.add_axes((0.0, 0.0, 1.0, 0.92))
        # as wide as the picture, or as the run needs
        reach = 1.1 * sum(episode.physical.lengths)
        scene(self._axes, episode, max(room_for(episode), reach * 5.6 / (0.92 * 4.6)))
        self._axes.set_axis_off()
        self._figure.text(0.04, 0.93, solver_name(episode.solver), size=13, weight='bold')
        self._clock = self._figure.text(0.46, 0.93, '', size=11)
        self._force = self._figure.text(0.96, 0.93, '', size=11, ha='right', color=FORCE)
        mark(self._figure, episode.incomplete)
        self._drawing = Drawing(self._axes, episode.physical, size=1.2)

    def picture(self, t: float) -> Array:
        """Return the pixels (height, width, 3) at a time [s]."""
        episode = self._episode
        x, u = states_at(episode, np.array([t]))[0], force_at(episode, t)
        self._drawing.show(x)
        self._clock.set_text(f'{t - episode.t[0]:.2f} s')
        self._force.set_text(f'{u:+.1f} N'.replace('-', '−'))
        trail = self._axes.add_collection(trail_of(episode, t, 1.0, 2.0))
        arrow = self._axes.add_patch(_arrow(x[0], u))
        self._canvas.draw()
        trail.remove()
        arrow.remove()
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()


def _arrow(x: float, u: float) -> FancyArrow:
    """Return an arrow beside the cart at x [m] that shows the force u [N]."""
    look = Arrow()
    length = look.scale * u
    head = min(look.head, abs(length))
    return FancyArrow(x + math.copysign(CART_SIZE[0] / 2 + look.gap, u), 0.0, length, 0.0,
                      width=0.3 * head, head_width=head, head_length=head, color=FORCE,
                      length_includes_head=True, visible=abs(u) > look.least, zorder=6)
