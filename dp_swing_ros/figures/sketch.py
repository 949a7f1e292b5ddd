# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The pendulum with its symbols and signs: `python -m dp_swing_ros.figures.sketch FILE`.

Run by `make docs`, which keeps it in docs/figures.
"""

from pathlib import Path
import sys

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc
import numpy as np

from dp_swing_ros.figures.pendulum import CART_SIZE, Drawing, TRACK
from dp_swing_ros.figures.style import CART, FAINT, FORCE, INK, LINK1, LINK2, styled
from dp_swing_ros.pendulum.equations import joints
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import Array

SHOWN = (0.55, 0.45, 1.05, 0.0, 0.0, 0.0)   # a state with all its coordinates above zero
ARROW = {'arrowstyle': '-|>', 'shrinkA': 0, 'shrinkB': 0, 'linewidth': 1.6}


@styled
def sketch(bodies: PendulumParameters = PendulumParameters(),
           limits: LimitParameters = LimitParameters()) -> Figure:
    """Draw a state of the pendulum, and what each of its coordinates counts from where."""
    figure = Figure(figsize=(7.6, 3.7))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(-2.95, 2.95), ylim=(-0.82, 2.05), aspect='equal')
    axes.set_axis_off()
    _draw_track(axes, limits)
    Drawing(axes, bodies, size=1.6).show(np.array(SHOWN))
    places = joints(np.array(SHOWN), bodies)
    for link, colour in enumerate((LINK1, LINK2)):
        _draw_angle(axes, places[link:link + 2], link + 1, colour)
    _draw_position(axes, places[0])
    _draw_force(axes, places[0])
    axes.text(-2.85, 1.92, 'both angles from the upward vertical, clockwise positive\n'
              '$\\theta_1 = \\theta_2 = 0$: upright    '
              '$\\theta_1 = \\theta_2 = \\pi$: hanging', va='top', size='large')
    axes.text(-2.85, 1.45, f'$m_0$ = {bodies.cart_mass:g} kg, $m_1$ = {bodies.link1_mass:g} kg, '
              f'$m_2$ = {bodies.link2_mass:g} kg,\n$l_1$ = {bodies.link1_length:g} m, '
              f'$l_2$ = {bodies.link2_length:g} m, |$u$| ≤ {limits.force_limit:g} N', va='top')
    return figure


def _draw_track(axes: Axes, limits: LimitParameters) -> None:
    end = limits.track_limit + CART_SIZE[0] / 2
    axes.plot([-end, end], [TRACK, TRACK], color=FAINT, linewidth=2, zorder=1)
    for side in (-1, 1):
        axes.plot([side * end] * 2, [TRACK, TRACK + 0.3], color=FAINT, linewidth=4, zorder=1)
        axes.text(side * limits.track_limit, TRACK - 0.1,
                  f'end stop\n$x$ = {side * limits.track_limit:+g} m'.replace('-', '−'),
                  ha='center', va='top')


def _draw_angle(axes: Axes, ends: Array, number: int, colour: str) -> None:
    """Draw the vertical through a joint, the angle from there, and the link's length and mass."""
    (x, z), tip = ends
    axes.plot([x, x], [z, z + 0.75], color=INK, linewidth=0.9, linestyle=(0, (4, 3)), zorder=2)
    angle, radius = SHOWN[number], 0.52
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
    sketch().savefig(Path(sys.argv[1]))
