# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Many force sequences drawn and followed at once, in single precision, and what each costs.

The samples go through the model in blocks of LANES side by side: their noise and states stay in
the first-level cache, and the compiler turns every loop over a block into vector instructions.
Hence no branch, no call and no double-precision constant in there.
"""

from typing import Any

import numpy as np

from dp_swing_ros.kernels import kernel
from dp_swing_ros.kernels.trigonometry import sincos
from dp_swing_ros.pendulum.model import advance
from dp_swing_ros.problem.cost import squared_error
from dp_swing_ros.solvers.noise import fill, LANES

ZERO, ONE, TWO = np.float32(0.0), np.float32(1.0), np.float32(2.0)


def single(numbers: Any) -> Any:
    """Return a model or a cost with all its numbers in single precision."""
    def convert(number: Any) -> Any:
        if isinstance(number, tuple):
            return single(number)
        if isinstance(number, bool):
            return number
        return np.asarray(number, dtype=np.float32)[()]
    return type(numbers)(*map(convert, numbers))


@kernel
def angle_error(difference, chord):
    """Return the error of an angle; see cost.py."""
    if chord:
        s, _ = sincos(difference / TWO)
        return TWO * s
    return difference


@kernel
def beyond(x, x_soft):
    """Return the squared distance into the soft margin of the track."""
    inside = max(abs(x) - x_soft, ZERO)
    return inside * inside


@kernel
def draw(model, cost, X, U, K, random, sigma, correlation, u_max, V, J):
    """
    Draw samples about the policy u = U[t] + K[t] (x - X[t]), and follow them from X[0].

    random is the state of `noise.fill`. Shapes: X (N + 1, 6), U (N,), K (N, 6), random (4, LANES),
    and in float32 sigma and J (blocks, LANES), V (blocks, N, LANES).
    """
    N = len(U)
    x_0, gains, offsets = X[0].astype(np.float32), K.astype(np.float32), np.empty(N, np.float32)
    for t in range(N):   # u = offset + K x
        u_t = U[t]
        for j in range(6):
            u_t -= K[t, j] * X[t, j]
        offsets[t] = u_t
    noise, scratch = np.empty((N, LANES), np.float32), np.empty((8, LANES), np.float32)
    for block in range(len(V)):
        fill(random, noise.reshape(-1))
        follow(model, cost, x_0, offsets, gains, noise, sigma[block], correlation, u_max, scratch,
               V[block], J[block])


@kernel
def follow(model, cost, x_0, offsets, gains, noise, sigma, correlation, u_max, scratch, V, J):
    """
    Follow the policy u = offset + gain x from x_0 with noise added to its forces.

    Writes the bounded forces V that came of it, and their costs J. The noise of a sample is an
    AR(1) process of unit variance, times its sigma [N].
    Shapes, all float32: x_0 (6,), offsets (N,), gains (N, 6), noise and V (N, LANES), sigma and J
    (LANES,), scratch (8, LANES).
    """
    x, th_1, th_2, v, w_1, w_2 = (scratch[0], scratch[1], scratch[2], scratch[3], scratch[4],
                                  scratch[5])
    coloured, total = scratch[6], scratch[7]
    S, R, x_r, s_r, c_r = cost.S, cost.R, cost.x_r, cost.s_r, cost.c_r
    renewal = np.sqrt(np.float32(1) - correlation * correlation)
    for j in range(6):
        scratch[j, :] = x_0[j]
    scratch[6:, :] = ZERO
    old, fresh = ZERO, ONE
    for t in range(len(V)):
        k_0, k_1, k_2, k_3, k_4, k_5 = (gains[t, 0], gains[t, 1], gains[t, 2], gains[t, 3],
                                        gains[t, 4], gains[t, 5])
        offset, white, u = offsets[t], noise[t], V[t]
        for i in range(LANES):
            x_i, th_1i, th_2i, v_i, w_1i, w_2i = x[i], th_1[i], th_2[i], v[i], w_1[i], w_2[i]
            coloured[i] = old * coloured[i] + fresh * white[i]
            force = (offset + k_0 * x_i + k_1 * th_1i + k_2 * th_2i + k_3 * v_i
                     + k_4 * w_1i + k_5 * w_2i + sigma[i] * coloured[i])
            u_i = min(max(force, -u_max), u_max)
            u[i] = u_i
            e_0, e_3, e_4, e_5 = x_i - x_r[0], v_i - x_r[3], w_1i - x_r[4], w_2i - x_r[5]
            total[i] += (S[0] * e_0 * e_0
                         + S[1] * squared_error(cost.chord, th_1i, x_r[1], s_r[1], c_r[1])
                         + S[2] * squared_error(cost.chord, th_2i, x_r[2], s_r[2], c_r[2])
                         + S[3] * e_3 * e_3 + S[4] * e_4 * e_4 + S[5] * e_5 * e_5
                         + R * u_i * u_i + cost.w * beyond(x_i, cost.x_soft))
            x[i], th_1[i], th_2[i], v[i], w_1[i], w_2[i] = advance(
                model, x_i, th_1i, th_2i, v_i, w_1i, w_2i, u_i)
        old, fresh = correlation, renewal
    for i in range(LANES):
        J[i] = total[i] + cost.w * beyond(x[i], cost.x_soft)
    for j in range(6):
        for i in range(LANES):
            scratch[j, i] = angle_error(scratch[j, i] - x_r[j],
                                        cost.chord and (j == 1 or j == 2))
    for j in range(6):
        for m in range(6):
            for i in range(LANES):
                J[i] += scratch[j, i] * cost.P[j, m] * scratch[m, i]


@kernel
def average(V, w):
    """
    Return the weighted sum of the samples, in double precision.

    Shapes: V (blocks, N, LANES), w (blocks, LANES), both float32 -> (N,).
    """
    N = V.shape[1]
    sums, U = np.zeros((N, LANES), np.float32), np.zeros(N)
    for block in range(len(V)):
        for t in range(N):
            for i in range(LANES):
                sums[t, i] += w[block, i] * V[block, t, i]
    for t in range(N):
        for i in range(LANES):
            U[t] += sums[t, i]
    return U
