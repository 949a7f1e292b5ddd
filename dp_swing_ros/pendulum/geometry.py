# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the cart and the ends of the links are."""

from collections.abc import Sequence

import numpy as np

from dp_swing_ros.pendulum.state import angles, Array


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
