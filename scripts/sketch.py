# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The pendulum with its symbols and signs: `python scripts/sketch.py docs/figures`.

Run by `make docs`.
"""

from pathlib import Path
import sys

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc
import numpy as np

from dp_swing_ros.figures.pendulum import CART_SIZE, draw_pendulum, draw_track, TRACK
from dp_swing_ros.figures.style import CART, FORCE, INK, LINKS, styled
from dp_swing_ros.pendulum.geometry import joint_positions
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import angles, Array, upright

POSITION, ANGLES = 0.55, (0.45, 1.05, 0.75)  # [m], [rad] that are shown: all are above zero
ARROW = {'arrowstyle': '-|>', 'shrinkA': 0, 'shrinkB': 0, 'linewidth': 1.6}
WIDTH, SCALE = 7.6, 1.29  # [inch], [inch/m] of the picture


@styled
def sketch(physical: PendulumParameters = PendulumParameters(),
           limits: LimitParameters = LimitParameters()) -> Figure:
    """Draw a state of the pendulum, and what each of its coordinates counts from where."""
    x = upright(physical.links)
    x[0], x[angles(x)] = POSITION, ANGLES[:physical.links]
    places = joint_positions(x, physical.lengths)
    bottom, top = -0.82, max(2.05, places[-1, 1] + 0.2)
    figure = Figure(figsize=(WIDTH, SCALE * (top - bottom)))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(-2.95, 2.95), ylim=(bottom, top), aspect='equal')
    axes.set_axis_off()
    _draw_track(axes, physical, limits)
    draw_pendulum(axes, physical, x, size=1.6)
    for link, colour in enumerate(LINKS[:physical.links]):
        _draw_angle(axes, places[link:link + 2], link + 1, colour)
    _draw_position(axes, places[0])
    _draw_force(axes, places[0])
    _write(axes, top - 0.13, physical, limits)
    return figure


def _write(axes: Axes, top: float, physical: PendulumParameters,
           limits: LimitParameters) -> None:
    """Say in words what angles count, and which parameters there are."""
    all_angles = ' = '.join(rf'\theta_{i}' for i in range(1, physical.links + 1))
    axes.text(-2.85, top, 'angles from the upward vertical, clockwise positive\n'
              f'${all_angles} = 0$: upright    ${all_angles} = \\pi$: hanging',
              va='top', size='large')
    masses = ', '.join(f'$m_{i}$ = {mass:g} kg' for i, mass in enumerate(physical.masses))
    lengths = ', '.join(f'$l_{i}$ = {length:g} m'
                        for i, length in enumerate(physical.lengths, start=1))
    axes.text(-2.85, top - 0.47, f'{masses},\n{lengths}, |$u$| ≤ {limits.force_limit:g} N',
              va='top')


def _draw_track(axes: Axes, physical: PendulumParameters, limits: LimitParameters) -> None:
    draw_track(axes, physical, limits, size=1.65)
    for side in (-limits.track_limit, limits.track_limit):
        axes.text(side, TRACK - 0.1, f'end stop\n$x$ = {side:+g} m'.replace('-', '−'),
                  ha='center', va='top')


def _draw_angle(axes: Axes, ends: Array, number: int, colour: str) -> None:
    """Draw the vertical through a joint, the angle from there, and the link's length and mass."""
    (x, z), tip = ends
    axes.plot([x, x], [z, z + 0.75], color=INK, linewidth=0.9, linestyle=(0, (4, 3)), zorder=2)
    angle, radius = ANGLES[number - 1], 0.52
    axes.add_patch(Arc((x, z), 2 * radius, 2 * radius, theta1=90 - np.degrees(angle) + 6,
                       theta2=90, color=colour, linewidth=1.6))
    end, before = (np.array([np.sin(a), np.cos(a)]) * radius + ends[0]
                   for a in (angle, angle - 0.14))
    axes.annotate('', end, before, arrowprops={**ARROW, 'color': colour})
    right, up = np.array([np.sin(angle / 2), np.cos(angle / 2)]) * (radius + 0.17) + ends[0]
    axes.text(right, up, rf'$\theta_{number}$', color=colour, ha='center', va='center',
              size='x-large')
    right, up = ends.mean(axis=0) + 0.12 * np.array([np.cos(angle), -np.sin(angle)])
    axes.text(right, up, f'$l_{number}$, $m_{number}$', color=colour,
              ha='left', va='top', size='large')


def _draw_position(axes: Axes, cart: Array) -> None:
    """Draw the centre of the track and the position from there."""
    axes.plot([0, 0], [TRACK - 0.45, TRACK + 0.1], color=INK, linewidth=0.9)
    axes.plot([cart[0]] * 2, [TRACK - 0.45, TRACK], color=INK, linewidth=0.9,
              linestyle=(0, (4, 3)))
    axes.annotate('', (cart[0], TRACK - 0.36), (0.0, TRACK - 0.36),
                  arrowprops={**ARROW, 'color': CART})
    axes.text(cart[0] / 2, TRACK - 0.4, '$x$', ha='center', va='top', size='x-large')


def _draw_force(axes: Axes, cart: Array) -> None:
    edge = cart[0] - CART_SIZE[0] / 2
    axes.annotate('', (edge, 0.0), (edge - 0.6, 0.0),
                  arrowprops={**ARROW, 'linewidth': 3, 'color': FORCE})
    axes.text(edge - 0.65, 0.0, '$u$', ha='right', va='center', size='x-large', color=FORCE)
    axes.text(cart[0] + CART_SIZE[0] / 2 + 0.08, 0.0, '$m_0$', va='center', size='large')


if __name__ == '__main__':
    sketch().savefig(Path(sys.argv[1]) / 'pendulum.png')
