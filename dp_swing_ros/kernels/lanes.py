# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Steps, and directions of (x, u), side by side in the lanes of a vector.

Derivatives are taken over blocks of up to STEPS steps, and along LANES directions: the seven
numbers of (x, u) and one of zeros. A loop over lanes, all else in scalars, is what the compiler
turns into vectors; where it can prove that nothing written is read.
"""

from dp_swing_ros.kernels.compilation import kernel

STEPS = 16
LANES = 8


@kernel
def blocks(U):
    """Return how many blocks the steps of U (T,) fill."""
    return (len(U) + STEPS - 1) // STEPS


@kernel
def load(X, U, first, z):
    """
    Copy the (x, u) of the STEPS steps from first on into lanes; past the end, the last ones again.

    A loop over all lanes is one of vectors alone. Shapes: X (T or more, 6), U (T,), z (7, STEPS).
    """
    for i in range(STEPS):
        t = min(first + i, len(U) - 1)
        for j in range(6):
            z[j, i] = X[t, j]
        z[6, i] = U[t]


@kernel
def direction(m):
    """Return the direction m of (x, u)."""
    return (1.0 if m == 0 else 0.0, 1.0 if m == 1 else 0.0, 1.0 if m == 2 else 0.0,
            1.0 if m == 3 else 0.0, 1.0 if m == 4 else 0.0, 1.0 if m == 5 else 0.0,
            1.0 if m == 6 else 0.0)
