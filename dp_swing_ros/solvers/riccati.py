# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
One iteration of iLQR and DDP: the Riccati recursion backward, the policy forward.

    V(x_t) = min_u [ℓ(x_t, u) + V(f(x_t, u))],   V(x_N) = ℓ_f(x_N)                    (22)-(24)

The backward pass expands the bracket to second order about a trajectory and minimises it over
|u| ≤ u_max; the forward pass follows the policy that results. Source: the paper, (25)-(37), with
the errata of docs/model.md; the update of V that stays right for a bounded or regularised gain
is Tassa, Erez and Todorov, "Synthesis and stabilization of complex behaviors through online
trajectory optimization", IROS 2012, (11).
"""

import numpy as np

from dp_swing_ros.kernels import kernel
from dp_swing_ros.kernels.lanes import LANES, STEPS
from dp_swing_ros.pendulum.model import curvature, expand, linearise
from dp_swing_ros.pendulum.trajectory import step
from dp_swing_ros.problem.cost import running, running_derivatives, terminal, terminal_derivatives

HALVINGS = 14      # of the step, in a line search
SUFFICIENT = 1e-2  # share of the expected decrease that a step must reach


@kernel
def six(v):
    """Return the first six numbers of v."""
    return v[0], v[1], v[2], v[3], v[4], v[5]


@kernel
def dot(a, b):
    """Return the sum of the products of six numbers; two sums at a time take less long."""
    return (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) + (a[3] * b[3] + a[4] * b[4] + a[5] * b[5])


@kernel
def symmetric(V):
    """Return the rows of a symmetric V (6, 6), as its upper triangle has them."""
    v_00, v_01, v_02, v_03, v_04, v_05 = six(V[0])
    _, v_11, v_12, v_13, v_14, v_15 = six(V[1])
    _, _, v_22, v_23, v_24, v_25 = six(V[2])
    _, _, _, v_33, v_34, v_35 = six(V[3])
    _, _, _, _, v_44, v_45 = six(V[4])
    v_55 = V[5, 5]
    return ((v_00, v_01, v_02, v_03, v_04, v_05), (v_01, v_11, v_12, v_13, v_14, v_15),
            (v_02, v_12, v_22, v_23, v_24, v_25), (v_03, v_13, v_23, v_33, v_34, v_35),
            (v_04, v_14, v_24, v_34, v_44, v_45), (v_05, v_15, v_25, v_35, v_45, v_55))


@kernel
def propagate(F, V_x, V_xx, W, Q_z, Q_zz, BF):
    """
    Write Fᵀ V_x, Fᵀ V_xx F + W and Bᵀ F, column by column.

    Shapes: F (6, 8), V_x (6,), V_xx (6, 6), W and Q_zz (7, 8), Q_z and BF (8,).
    """
    v, columns = six(V_x), F.T
    V_0, V_1, V_2, V_3, V_4, V_5 = symmetric(V_xx)
    F_0, F_1, F_2, F_3 = six(columns[0]), six(columns[1]), six(columns[2]), six(columns[3])
    F_4, F_5, B = six(columns[4]), six(columns[5]), six(columns[6])
    for j in range(LANES):
        f = six(columns[j])
        Q_z[j], BF[j] = dot(v, f), dot(B, f)
        Vf = (dot(V_0, f), dot(V_1, f), dot(V_2, f), dot(V_3, f), dot(V_4, f), dot(V_5, f))
        Q_zz[0, j], Q_zz[1, j] = W[0, j] + dot(F_0, Vf), W[1, j] + dot(F_1, Vf)
        Q_zz[2, j], Q_zz[3, j] = W[2, j] + dot(F_2, Vf), W[3, j] + dot(F_3, Vf)
        Q_zz[4, j], Q_zz[5, j] = W[4, j] + dot(F_4, Vf), W[5, j] + dot(F_5, Vf)
        Q_zz[6, j] = W[6, j] + dot(B, Vf)


@kernel
def close(k, K, Q_u, Q_uu, Q_z, Q_zz, V_x, V_xx):
    """
    Write V_x and V_xx that the policy k + K δx leaves, (31), (32), which hold for any k and K.

    Shapes: K (8,), Q_z (8,), Q_zz (7, 8), V_x (8,), V_xx (6, 8).
    """
    Q_ux = Q_zz[6]
    K_0, K_1, K_2, K_3, K_4, K_5 = six(K)
    Q_0, Q_1, Q_2, Q_3, Q_4, Q_5 = six(Q_ux)
    for j in range(LANES):
        V_x[j] = Q_z[j] + K[j] * (Q_uu * k + Q_u) + Q_ux[j] * k
        g = Q_uu * K[j] + Q_ux[j]
        V_xx[0, j] = Q_zz[0, j] + K_0 * g + Q_0 * K[j]
        V_xx[1, j] = Q_zz[1, j] + K_1 * g + Q_1 * K[j]
        V_xx[2, j] = Q_zz[2, j] + K_2 * g + Q_2 * K[j]
        V_xx[3, j] = Q_zz[3, j] + K_3 * g + Q_3 * K[j]
        V_xx[4, j] = Q_zz[4, j] + K_4 * g + Q_4 * K[j]
        V_xx[5, j] = Q_zz[5, j] + K_5 * g + Q_5 * K[j]


@kernel
def backward(model, cost, X, U, gaps, u_max, mu, tensor, k, K):
    """
    Write the policy δu = k + K δx, and return whether Q_uu stayed positive and two slopes.

    The expected change of the cost under α k is α slope + α² / 2 bend. The expansion holds a share
    `tensor` of the terms Σ V'_x[i] ∂²f_i: with 1 it is DDP, with 0 iLQR. The gaps are
    f(X[t], U[t]) - X[t + 1], which the policy closes; a trajectory of the model has none.
    Shapes: X (T + 1, 6), U (T,), gaps (T, 6), or (0, 6) for none, k (T,), or (0,) where the forces
    stay as they are, K (T, 6).
    """
    # rows of one array, so that the compiler sees what does not overlap; F = [A, B, 0]
    work = np.zeros((31, LANES))
    F, W, Q_zz, V_xx = work[:6], work[6:13], work[13:20], work[20:26]
    V_x, Q_z, BF, gain, weighted = work[26], work[27], work[28], work[29], work[30]
    slope = bend = 0.0
    terminal_derivatives(cost, X[len(U)], V_x, V_xx)
    l_x, l_xx = running_derivatives(cost, X, U)
    points = expand(model, X, U)
    for t in range(len(U) - 1, -1, -1):
        if len(gaps) > 0:                        # V'_x where the model leads to, beyond the gap
            for i in range(6):
                for j in range(6):
                    V_x[i] += V_xx[i, j] * gaps[t, j]
        if tensor > 0:
            for i in range(6):
                weighted[i] = tensor * V_x[i]
            curvature(model, points, t, weighted, F, W)
        else:
            linearise(model, points, t, F)
        propagate(F, V_x, V_xx, W, Q_z, Q_zz, BF)                    # (26)-(30)
        for i in range(6):
            Q_z[i] += l_x[t // STEPS, i, t % STEPS]
            Q_zz[i, i] += l_xx[t // STEPS, i, t % STEPS]
        Q_u, Q_uu = Q_z[6] + 2 * cost.R * U[t], Q_zz[6, 6] + 2 * cost.R

        # (36), (37): V'_xx + μ I in place of V'_xx, for the gains alone
        Q_uu_mu = Q_uu + mu * BF[6]
        if not Q_uu_mu > 0:
            return False, slope, bend
        change, follows = 0.0, abs(U[t]) < u_max
        if len(k) > 0:
            best = -Q_u / Q_uu_mu
            change = k[t] = min(max(best, -u_max - U[t]), u_max - U[t])
            follows = change == best
        share = -1 / Q_uu_mu if follows else 0.0
        for j in range(LANES):   # on the bound the best force does not follow the state
            gain[j] = share * (Q_zz[6, j] + mu * BF[j])
        for i in range(6):
            K[t, i] = gain[i]

        slope += change * Q_u
        bend += change * Q_uu * change
        close(change, gain, Q_u, Q_uu, Q_z, Q_zz, V_x, V_xx)
    return True, slope, bend


@kernel
def forward(model, cost, X, U, gaps, k, K, alpha, u_max, X_new, U_new):
    """
    Write the trajectory of the policy u = U + α k + K (x - X), (33)-(35), and return its cost.

    A share α of the gaps is closed. Shapes: X and X_new (T + 1, 6), U and U_new (T,), gaps
    (T, 6), or (0, 6) for none, k (T,), K (T, 6).
    """
    total = 0.0
    for i in range(6):
        X_new[0, i] = X[0, i]
    for t in range(len(U)):
        u = U[t] + alpha * k[t]
        for i in range(6):
            u += K[t, i] * (X_new[t, i] - X[t, i])
        U_new[t] = min(max(u, -u_max), u_max)
        total += running(cost, X_new[t], U_new[t])
        step(model, X_new[t], U_new[t], X_new[t + 1])
        if len(gaps) > 0:
            for i in range(6):
                X_new[t + 1, i] -= (1 - alpha) * gaps[t, i]
    return total + terminal(cost, X_new[len(U)])


@kernel
def line_search(model, cost, X, U, J, k, K, slope, bend, u_max, X_new, U_new):
    """
    Halve α until the cost falls as expected; return the new cost, infinity if it never does.

    Shapes: as in `forward`; there are no gaps, for a cost with gaps promises nothing.
    """
    alpha, gaps = 1.0, np.empty((0, 6))
    for _ in range(HALVINGS):
        J_new = forward(model, cost, X, U, gaps, k, K, alpha, u_max, X_new, U_new)
        if J - J_new >= -SUFFICIENT * alpha * (slope + 0.5 * alpha * bend) and J_new < J:
            return J_new
        alpha *= 0.5
    return np.inf
