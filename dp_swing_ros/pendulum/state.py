# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Order, units and signs of the state, and arithmetic of its angles.

The state is x = [x, θ1, θ2, ẋ, θ̇1, θ̇2] in metres, radians and seconds. Both angles are absolute,
from the upward vertical: 0 is upright, π hangs; a positive angle leans towards +x.
"""

from typing import TypeAlias

import numpy as np

Array: TypeAlias = np.ndarray

SIZE = 6
JOINTS = ('cart', 'joint1', 'joint2')
NAMES = ('x', 'θ1', 'θ2', 'ẋ', 'θ̇1', 'θ̇2')
UNITS = ('m', 'rad', 'rad', 'm/s', 'rad/s', 'rad/s')
ANGLES = slice(1, 3)
UPRIGHT = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
HANGING = (0.0, np.pi, np.pi, 0.0, 0.0, 0.0)
LEANING = (0.0, 0.2, 0.0, 0.0, 0.0, 0.0)   # so far that the regulator would drop it


def to_turn_of(x: Array, reference: Array) -> Array:
    """
    Shift the angles of x by whole turns to lie within π of those of the reference.

    Shapes: x and reference (..., 6), broadcast against each other.
    """
    shifted = np.array(x, dtype=float)
    turns = np.round((shifted[..., ANGLES] - np.asarray(reference)[..., ANGLES]) / (2 * np.pi))
    shifted[..., ANGLES] -= 2 * np.pi * turns
    return shifted


def wrapped(x: Array) -> Array:
    """
    Shift the angles of x by whole turns into (-π, π]: 0 is upright, π hangs.

    Shapes: x (..., 6).
    """
    shifted = to_turn_of(x, np.zeros(SIZE))
    angles = shifted[..., ANGLES]
    angles[angles <= -np.pi] += 2 * np.pi
    return shifted


def is_upright(x: Array, angle: float = 0.1, speed: float = 1.0) -> Array:
    """
    Tell whether both angles [rad] and all three speeds [m/s, rad/s] are within the bounds.

    Shapes: x (..., 6) -> bool (...). Source: the success criterion of docs/model.md.
    """
    bounds = (np.inf, angle, angle, speed, speed, speed)
    return np.all(np.abs(to_turn_of(x, np.zeros(SIZE))) <= bounds, axis=-1)
