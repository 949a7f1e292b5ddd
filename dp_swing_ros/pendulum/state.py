# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Order, units and signs of the state, and arithmetic of its angles.

The state of a cart with n links is x = [x, θ1 … θn, ẋ, θ̇1 … θ̇n] in metres, radians and seconds.
All angles are absolute, from the upward vertical: 0 is upright, π hangs; a positive angle leans
towards +x.
"""

from functools import cache
from itertools import product
from typing import TypeAlias

import numpy as np

from dp_swing_ros.pendulum.units import SAME, scaled_speeds, Units

Array: TypeAlias = np.ndarray

LINKS = (1, 2, 3)   # numbers of links that a pendulum may have
DEFAULT_LINKS = 2
JOINT_COUNTS = {links: links + 1 for links in LINKS}  # the cart is one
UPRIGHT, SLOW = 0.1, 1.0   # [rad], and [m/s, rad/s] scaled: closer to upright is there
SIZES = {links: 2 * (links + 1) for links in LINKS}   # numbers of the state


def links_of(x: Array) -> int:
    """Return the number of links of states (..., 2n + 2)."""
    return np.shape(x)[-1] // 2 - 1


def angles(x: Array) -> slice:
    """Return where the angles are in states (..., 2n + 2)."""
    return slice(1, np.shape(x)[-1] // 2)


@cache
def joints(links: int) -> tuple[str, ...]:
    """Return the names of the joints in order: cart, joint1 …."""
    return ('cart', *(f'joint{i}' for i in range(1, links + 1)))


def symbols(links: int) -> tuple[str, ...]:
    """Return the symbols of the numbers of the state in order."""
    count = range(1, links + 1)
    return ('x', *(f'θ{i}' for i in count), 'ẋ', *(f'θ̇{i}' for i in count))


def columns(links: int) -> tuple[str, ...]:
    """Return the names of the numbers of the state in order, as columns of tables have them."""
    names = ('x', *(f'theta{i}' for i in range(1, links + 1)))
    return (*names, *(f'{name}_dot' for name in names))


def units(links: int) -> tuple[str, ...]:
    """Return the units of the numbers of the state in order."""
    return ('m', *['rad'] * links, 'm/s', *['rad/s'] * links)


def upright(links: int = DEFAULT_LINKS) -> Array:
    """Return the state in which all links stand."""
    return np.zeros(SIZES[links])


def hanging(links: int = DEFAULT_LINKS) -> Array:
    """Return the state in which all links hang, at rest."""
    x = np.zeros(SIZES[links])
    x[angles(x)] = np.pi
    return x


def equilibria(links: int = DEFAULT_LINKS) -> dict[str, Array]:
    """Return the states of rest by their names, link 1 first: of two links down_down … up_up."""
    found = {}
    for words in product(('down', 'up'), repeat=links):
        x = hanging(links)
        x[angles(x)][[word == 'up' for word in words]] = 0.0
        found['_'.join(words)] = x
    return found


def is_at_rest(x: Array) -> bool:
    """Return whether a state (2n + 2,) is an equilibrium; an angle may be rounded as 3.1416 is."""
    tilted, speeds = np.sin(x[angles(x)]), x[len(x) // 2:]
    return bool(np.all(np.abs(tilted) < 1e-3) and not np.any(speeds))


def to_turn_of(x: Array, reference: Array) -> Array:
    """
    Shift the angles of x by whole turns to lie within π of those of the reference.

    Shapes: x and reference (..., 2n + 2), broadcast against each other.
    """
    shifted, of_angles = np.array(x, dtype=float), angles(x)
    turns = np.rint(
        (shifted[..., of_angles] - np.asarray(reference)[..., of_angles]) / (2 * np.pi))
    shifted[..., of_angles] -= 2 * np.pi * turns
    return shifted


def turned(x: Array, by: Array | float) -> Array:
    """Return states (..., 2n + 2) whose angles are larger by others (n,) [rad]."""
    found = x.copy()
    found[..., angles(x)] += by
    return found


def errors(x: Array, x_r: Array) -> Array:
    """
    Return by how much states are off from a reference, on its nearest turn.

    Shapes: x (..., 2n + 2), x_r (2n + 2,).
    """
    return to_turn_of(x, x_r) - x_r


def deviation(x: Array, x_r: Array) -> Array:
    """Return the largest error of an angle [rad]; x (..., 2n + 2), x_r (2n + 2,) -> (...)."""
    return np.abs(errors(x, x_r)[..., angles(x)]).max(axis=-1)


def to_joints(absolute: Array) -> Array:
    """
    Return positions or speeds as joints have them, each link's against the one before.

    Shapes: absolute (n + 1,), of the cart first.
    """
    return np.concatenate((absolute[:2], np.diff(absolute[1:])))


def from_joints(relative: Array) -> Array:
    """Return positions or speeds of the state from those of the joints; shapes: (..., n + 1)."""
    return np.concatenate((relative[..., :1], np.cumsum(relative[..., 1:], axis=-1)), axis=-1)


def between(x: Array, following: Array, share: Array | float, h: Array | float) -> Array:
    """
    Return the states at a share of the way to those a time h [s] later, by Hermite's cubics.

    Shapes: x and following (M, 2n + 2), share and h (M, 1) or numbers.
    """
    s, half = share, x.shape[1] // 2   # and not hsplit, which takes longer than all that follows
    q, v, q_next, v_next = x[:, :half], x[:, half:], following[:, :half], following[:, half:]
    positions = ((1 + 2 * s) * (1 - s) ** 2 * q + s ** 2 * (3 - 2 * s) * q_next
                 + h * s * (1 - s) * ((1 - s) * v - s * v_next))
    speeds = (6 * s * (1 - s) * (q_next - q) / h + (1 - s) * (1 - 3 * s) * v
              + s * (3 * s - 2) * v_next)
    return np.hstack((positions, speeds))


def wrapped(x: Array) -> Array:
    """
    Shift the angles of x by whole turns into (-π, π]: 0 is upright, π hangs.

    Shapes: x (..., 2n + 2).
    """
    shifted = to_turn_of(x, np.zeros(np.shape(x)[-1]))
    within = shifted[..., angles(x)]
    within[within <= -np.pi] += 2 * np.pi
    return shifted


def is_state(x: Array) -> bool:
    """Return whether x (2n + 2,) can be measured: finite, but for velocities that are NaN."""
    return bool(np.isfinite(x[:len(x) // 2]).all() and not np.isinf(x).any())


def is_upright(x: Array, scale: Units = SAME) -> Array:
    """
    Return whether all angles are small, and all speeds, for a pendulum of a scale.

    Shapes: x (..., 2n + 2) -> bool (...). Source: the success criterion of docs/model.md.
    """
    n = links_of(x)
    return np.all(np.abs(to_turn_of(x, upright(n))) <= upright_bounds(n, scale), axis=-1)


def upright_bounds(links: int, scale: Units = SAME) -> Array:
    """Return how far from upright each number of a state (2n + 2,) may be to count as there."""
    return np.array([np.inf, *[UPRIGHT] * links, *scaled_speeds(SLOW, scale, links)])
