# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the cart and the ends of the links are, and how large all of it is drawn."""

from collections.abc import Sequence
import math

import numpy as np

from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import angles, Array
from dp_swing_ros.pendulum.units import Units

HALF = 1e-6   # of a share, by which rounding leaves one half


def joint_positions(X: Array, lengths: Sequence[float]) -> Array:
    """
    Return the positions [m] of the cart and the ends of the links, x to the right and z up.

    Shapes: X (..., 2n + 2), lengths (n,) [m] -> (..., n + 1, 2).
    """
    X = np.asarray(X)
    turned = X[..., angles(X)]
    links = np.stack([np.sin(turned), np.cos(turned)], axis=-1) * np.reshape(lengths, (-1, 1))
    cart = np.stack([X[..., 0], np.zeros_like(X[..., 0])], axis=-1)
    return np.cumsum(np.concatenate([cart[..., None, :], links], axis=-2), axis=-2)


def drawn_centres(physical: PendulumParameters) -> list[float | None]:
    """Return how far along each link its centre of mass is, as a share; None for one half."""
    return [None if math.isclose(share, 0.5, rel_tol=HALF) else share
            for share in physical.centres]


def drawn_scale(physical: PendulumParameters) -> Units:
    """
    Return how many times larger a pendulum looks than one of the default bodies.

    The unit of length is the mean length l of the links, which are what is seen, that of time
    goes with √l, that of mass is all of it. So the cart is drawn as large whatever the masses, as
    it would not be by `scale_of`, whose unit of force, the weight, is this one's on Earth. Who
    looks and pulls stays there, also where there is no gravity.
    """
    usual = PendulumParameters(links=physical.links)
    length = float(np.mean(physical.lengths) / np.mean(usual.lengths))
    return Units(length, math.sqrt(length), *(
        sum(physical.masses[first:]) / sum(usual.masses[first:]) for first in (0, 1)))
