# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The cost of a trajectory, and its derivatives.

    J(X, U) = Σ ℓ(x, u) + ℓ_f(x_N)
    ℓ(x, u) = e(x)ᵀ S e(x) + R u² + w max(0, |x| - x_soft)²,    ℓ_f(x) = e(x)ᵀ P e(x) + the same w

Source: the paper, (16)-(21); it has no ½. There e(x) = x - x_r, P = 1000 S and w = 0. The tuned
default measures the error δ of an angle by the chord e = 2 sin(δ/2): e² = 2 (1 - cos δ) is δ² near
the goal, has no jump at a whole turn, and its Gauss-Newton Hessian stays positive semi-definite.
The chord itself changes its sign from turn to turn, and with it P's products of an angle and a
velocity: P is right on the goal's own turn, which is for the receding horizon to choose.
"""

import math
from typing import NamedTuple

import numpy as np

from dp_swing_ros.kernels import kernel
from dp_swing_ros.kernels.lanes import blocks, load, STEPS
from dp_swing_ros.kernels.trigonometry import sincos
from dp_swing_ros.pendulum.state import Array


class Cost(NamedTuple):
    """The numbers of the cost."""

    S: Array        # (6,) diagonal of the state weights
    R: float        # [1/N^2]
    P: Array        # (6, 6) terminal weights
    x_r: Array      # (6,) reference state
    s_r: Array      # (6,) its sines
    c_r: Array      # (6,) and cosines
    chord: bool     # angle errors are chords
    x_soft: float   # [m] where the soft margin of the track begins
    w: float        # [1/m^2] weight of the squared distance into the margin


@kernel
def error(cost, x, i):
    """Return the error e_i of component i of the state, which is x, and its slope ∂e_i/∂x_i."""
    difference = x - cost.x_r[i]
    if cost.chord and (i == 1 or i == 2):
        sine, cosine = sincos(difference / 2)
        return 2 * sine, cosine
    return difference, 1.0


@kernel
def squared_error(chord, x, x_r, s_r, c_r):
    """
    Return e² of a component x in any precision; s_r and c_r are sine and cosine of x_r.

    The chord is the distance of two points on the circle, and the sine and cosine of the angle
    itself, which the model needs too, are computed once for both.
    """
    if chord:
        sine, cosine = sincos(x)
        return (sine - s_r) * (sine - s_r) + (cosine - c_r) * (cosine - c_r)
    return (x - x_r) * (x - x_r)


@kernel
def intrusion(cost, x):
    """Return how far [m] the cart at x is inside the soft margin, with the sign of its side."""
    return math.copysign(max(0.0, abs(x) - cost.x_soft), x)


@kernel
def running(cost, x, u):
    """Return ℓ(x, u)."""
    total = cost.R * u * u + cost.w * intrusion(cost, x[0]) ** 2
    for i in range(6):
        total += cost.S[i] * squared_error(cost.chord and (i == 1 or i == 2), x[i], cost.x_r[i],
                                           cost.s_r[i], cost.c_r[i])
    return total


@kernel
def terminal(cost, x):
    """Return ℓ_f(x)."""
    total = cost.w * intrusion(cost, x[0]) ** 2
    e = np.empty(6)
    for i in range(6):
        e[i], _ = error(cost, x[i], i)
    for i in range(6):
        for j in range(6):
            total += e[i] * cost.P[i, j] * e[j]
    return total


@kernel
def trajectory_cost(cost, X, U):
    """
    Return J(X, U).

    Shapes: X (T + 1, 6), U (T,).
    """
    total = terminal(cost, X[len(U)])
    for t in range(len(U)):
        total += running(cost, X[t], U[t])
    return total


@kernel
def running_derivatives(cost, X, U):
    """
    Return ℓ_x and the diagonal of ℓ_xx (Gauss-Newton) of all steps; ℓ_u = 2 R u, ℓ_uu = 2 R.

    Those of step t are [t // STEPS, :, t % STEPS]. Shapes: X (T or more, 6), U (T,) ->
    (blocks, 6, STEPS) both.
    """
    l_x, l_xx = np.empty((2, blocks(U), 6, STEPS))
    z = np.empty((7, STEPS))
    for block in range(len(l_x)):
        load(X, U, block * STEPS, z)
        of_block, second = l_x[block], l_xx[block]
        for i in range(6):
            twice = 2 * cost.S[i]
            for t in range(STEPS):
                e, slope = error(cost, z[i, t], i)
                of_block[i, t], second[i, t] = twice * e * slope, twice * slope * slope
        for t in range(STEPS):
            inside = intrusion(cost, z[0, t])
            of_block[0, t] += 2 * cost.w * inside
            second[0, t] += 2 * cost.w * (inside != 0)
    return l_x, l_xx


@kernel
def terminal_derivatives(cost, x, l_x, l_xx):
    """
    Write the gradient and the Gauss-Newton Hessian of ℓ_f.

    Shapes: l_x (6,), l_xx (6, 6).
    """
    e, slope = np.empty(6), np.empty(6)
    for i in range(6):
        e[i], slope[i] = error(cost, x[i], i)
    for i in range(6):
        l_x[i] = 0.0
        for j in range(6):
            l_x[i] += 2 * slope[i] * cost.P[i, j] * e[j]
            l_xx[i, j] = 2 * slope[i] * cost.P[i, j] * slope[j]
    inside = intrusion(cost, x[0])
    l_x[0] += 2 * cost.w * inside
    l_xx[0, 0] += 2 * cost.w * (inside != 0)
