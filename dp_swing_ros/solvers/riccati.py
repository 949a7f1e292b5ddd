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

from dp_swing_ros.cost import running, running_derivatives, terminal, terminal_derivatives
from dp_swing_ros.dynamics.model import curvature, linearise
from dp_swing_ros.dynamics.trajectory import step
from dp_swing_ros.kernels import kernel

HALVINGS = 9       # of the step, in a line search
SUFFICIENT = 1e-2  # share of the expected decrease that a step must reach


@kernel
def congruence(A, V, out):
    """Write Aᵀ V A for a symmetric V, all (6, 6)."""
    VA = np.empty((6, 6))
    for i in range(6):
        for j in range(6):
            VA[i, j] = (V[i, 0] * A[0, j] + V[i, 1] * A[1, j] + V[i, 2] * A[2, j]
                        + V[i, 3] * A[3, j] + V[i, 4] * A[4, j] + V[i, 5] * A[5, j])
    for i in range(6):
        for j in range(i, 6):
            out[i, j] = (A[0, i] * VA[0, j] + A[1, i] * VA[1, j] + A[2, i] * VA[2, j]
                         + A[3, i] * VA[3, j] + A[4, i] * VA[4, j] + A[5, i] * VA[5, j])
            out[j, i] = out[i, j]


@kernel
def transposed_times(A, v, out):
    """Write Aᵀ v."""
    for i in range(6):
        out[i] = (A[0, i] * v[0] + A[1, i] * v[1] + A[2, i] * v[2]
                  + A[3, i] * v[3] + A[4, i] * v[4] + A[5, i] * v[5])


@kernel
def backward(model, cost, X, U, gaps, u_max, mu, second_order, k, K):
    """
    Write the policy δu = k + K δx, and return whether Q_uu stayed positive and two slopes.

    The expected change of the cost under α k is α slope + α² / 2 bend. With second_order the
    expansion holds the tensor terms Σ V'_x[i] ∂²f_i of DDP; without, it is iLQR. The gaps are
    f(X[t], U[t]) - X[t + 1], zero for a trajectory of the model; the policy closes them.
    Shapes: X (T + 1, 6), U (T,), gaps (T, 6), k (T,), K (T, 6).
    """
    A, B, W = np.empty((6, 6)), np.empty(6), np.zeros((7, 7))
    V_x, V_xx = np.empty(6), np.empty((6, 6))
    Q_x, Q_ux, Q_xx = np.empty(6), np.empty(6), np.empty((6, 6))
    l_x, l_xx, VB, AB = np.empty(6), np.empty(6), np.empty(6), np.empty(6)
    slope = bend = 0.0
    terminal_derivatives(cost, X[len(U)], V_x, V_xx)
    for t in range(len(U) - 1, -1, -1):
        for i in range(6):                       # V'_x where the model leads to, beyond the gap
            for j in range(6):
                V_x[i] += V_xx[i, j] * gaps[t, j]
        if second_order:
            curvature(model, X[t], U[t], V_x, A, B, W)
        else:
            linearise(model, X[t], U[t], A, B)
        running_derivatives(cost, X[t], l_x, l_xx)

        transposed_times(V_xx, B, VB)
        Q_u = 2 * cost.R * U[t] + np.sum(B * V_x)                    # (27)
        Q_uu = 2 * cost.R + np.sum(B * VB) + W[6, 6]                 # (29)
        transposed_times(A, V_x, Q_x)                                # (26)
        transposed_times(A, VB, Q_ux)                                # (30)
        congruence(A, V_xx, Q_xx)                                    # (28)
        for i in range(6):
            Q_x[i] += l_x[i]
            Q_ux[i] += W[6, i]
            Q_xx[i, i] += l_xx[i]
            for j in range(6):
                Q_xx[i, j] += W[i, j]

        # (36), (37): V'_xx + μ I in place of V'_xx, for the gains alone
        Q_uu_mu = Q_uu + mu * np.sum(B * B)
        if not Q_uu_mu > 0:
            return False, slope, bend
        k[t] = min(max(-Q_u / Q_uu_mu, -u_max - U[t]), u_max - U[t])
        if k[t] == -Q_u / Q_uu_mu:
            transposed_times(A, B, AB)
            for i in range(6):
                K[t, i] = -(Q_ux[i] + mu * AB[i]) / Q_uu_mu
        else:
            K[t] = 0.0   # on the bound the best force does not follow the state

        slope += k[t] * Q_u
        bend += k[t] * Q_uu * k[t]
        for i in range(6):                                           # (31), (32), for any k, K
            V_x[i] = Q_x[i] + K[t, i] * (Q_uu * k[t] + Q_u) + Q_ux[i] * k[t]
            for j in range(6):
                V_xx[i, j] = (Q_xx[i, j] + K[t, i] * Q_uu * K[t, j]
                              + K[t, i] * Q_ux[j] + Q_ux[i] * K[t, j])
    return True, slope, bend


@kernel
def forward(model, cost, X, U, gaps, k, K, alpha, u_max, X_new, U_new):
    """
    Write the trajectory of the policy u = U + α k + K (x - X), (33)-(35), and return its cost.

    A share α of the gaps is closed. Shapes: X and X_new (T + 1, 6), U and U_new (T,), gaps
    (T, 6), k (T,), K (T, 6).
    """
    total = 0.0
    X_new[0] = X[0]
    for t in range(len(U)):
        u = U[t] + alpha * k[t]
        for i in range(6):
            u += K[t, i] * (X_new[t, i] - X[t, i])
        U_new[t] = min(max(u, -u_max), u_max)
        total += running(cost, X_new[t], U_new[t])
        step(model, X_new[t], U_new[t], X_new[t + 1])
        for i in range(6):
            X_new[t + 1, i] -= (1 - alpha) * gaps[t, i]
    return total + terminal(cost, X_new[len(U)])


@kernel
def line_search(model, cost, X, U, J, gaps, k, K, slope, bend, u_max, X_new, U_new):
    """
    Halve α until the cost falls as expected; return the new cost, infinity if it never does.

    Shapes: as in `forward`; the gaps must be zero, for a cost with gaps promises nothing.
    """
    alpha = 1.0
    for _ in range(HALVINGS):
        J_new = forward(model, cost, X, U, gaps, k, K, alpha, u_max, X_new, U_new)
        if J - J_new >= -SUFFICIENT * alpha * (slope + 0.5 * alpha * bend) and J_new < J:
            return J_new
        alpha *= 0.5
    return np.inf
