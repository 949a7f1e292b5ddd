# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
One iteration of iLQR and DDP: the Riccati recursion backward, the policy forward.

    V(x_t) = min_u [ℓ(x_t, u) + V(f(x_t, u))],   V(x_N) = ℓ_f(x_N)                    (22)-(24)

The backward pass expands the bracket to second order about a trajectory and minimises it over
u_min ≤ u ≤ u_max; the forward pass follows the policy that results. Source: the paper, (25)-(37),
with the errata of docs/model.md; the update of V that stays right for a bounded or regularised
gain is Tassa, Erez and Todorov, "Synthesis and stabilization of complex behaviors through online
trajectory optimization", IROS 2012, (11).
"""

import numpy as np

from dp_swing_ros.kernels import kernel
from dp_swing_ros.kernels.symbols import dot
from dp_swing_ros.kernels.unrolling import unrolled
from dp_swing_ros.pendulum.derivatives import curvature, identity, lanes, linearise, STEPS
from dp_swing_ros.pendulum.model import numbers, size, step
from dp_swing_ros.problem.cost import running, running_derivatives, terminal, terminal_derivatives

HALVINGS = 14      # of the step, in a line search
SUFFICIENT = 1e-2  # share of the expected decrease that a step must reach


@unrolled
def columns_of(model, V_x, V_xx, F):
    """
    Return V_x, V_xx as its upper triangle has it, and the columns of F, as single numbers.

    Loaded before a loop over lanes, they are in nobody's way: no store can change them.
    """
    states = range(2 * model.pendulum.links + 2)
    return (tuple(V_x[i] for i in states),
            tuple(tuple(V_xx[min(i, j), max(i, j)] for j in states) for i in states),
            tuple(tuple(F[i, k] for i in states) for k in range(len(states) + 1)))


@unrolled
def propagate_lane(given, F, W, Q_z, Q_zz, BF, j):
    """
    Write column j of Fᵀ V_x, Fᵀ V_xx F + W and Bᵀ F, (26)-(30) but for the cost.

    Shapes: F (2n + 2, lanes), W and Q_zz (2n + 3, lanes), Q_z and BF (lanes,).
    """
    V_x, V_xx, columns = given
    f = [F[i, j] for i in range(len(V_x))]
    V_f = [dot(row, f) for row in V_xx]
    Q_z[j], BF[j] = dot(V_x, f), dot(columns[-1], f)
    for k, column in enumerate(columns):
        Q_zz[k, j] = W[k, j] + dot(column, V_f)


@unrolled
def value_lane(given, k, K, Q_u, Q_uu, Q_z, Q_zz, V_x, V_xx, j):
    """
    Write column j of V_x and V_xx that the policy k + K δx leaves, (31), (32), for any k and K.

    Shapes: K, Q_z and V_x (lanes,), Q_zz (2n + 3, lanes), V_xx (2n + 2, lanes).
    """
    gains, Q_ux = given
    K_j, Q_uj = K[j], Q_zz[len(gains), j]
    V_x[j] = Q_z[j] + K_j * (Q_uu * k + Q_u) + Q_uj * k
    g = Q_uu * K_j + Q_uj
    for i in range(len(gains)):
        V_xx[i, j] = Q_zz[i, j] + gains[i] * g + Q_ux[i] * K_j


@kernel
def backward(model, cost, points, X, U, gaps, bounds, mu, share, k, K):
    """
    Write the policy δu = k + K δx, and return whether Q_uu stayed positive and two slopes.

    The expected change of the cost under α k is α slope + α² / 2 bend. The expansion holds a share
    of the second-order terms, Σ V'_x[i] ∂²f_i and what Gauss-Newton leaves out of the cost's
    Hessian: with 1 it is DDP, with None iLQR. The points are what `expand` returns of X and U. The
    gaps are f(X[t], U[t]) - X[t + 1], which the policy closes; a trajectory of the model has none.
    Shapes: X (T + 1, 2n + 2), U (T,), gaps (T, 2n + 2), or (0, 2n + 2) for none, k (T,), or (0,)
    where the forces stay as they are, K (T, 2n + 2).
    """
    n = size(model)
    # rows of one array, so that the compiler sees what does not overlap; F = [A, B, 0]
    work = np.zeros((5 * n + 8, lanes(model)))
    F, W, Q_zz = work[:n], work[n:2 * n + 1], work[2 * n + 1:3 * n + 2]
    V_xx, directions = work[3 * n + 2:4 * n + 2], work[4 * n + 2:5 * n + 3]
    V_x, Q_z, BF = work[5 * n + 3], work[5 * n + 4], work[5 * n + 5]
    gain, weighted = work[5 * n + 6], work[5 * n + 7]
    identity(directions)
    slope = bend = 0.0
    terminal_derivatives(cost, X[len(U)], share, V_x, V_xx)
    of_cost = running_derivatives(cost, X, U, share)
    for t in range(len(U) - 1, -1, -1):
        if len(gaps) > 0:                        # V'_x where the model leads to, beyond the gap
            for i in range(n):
                for j in range(n):
                    V_x[i] += V_xx[i, j] * gaps[t, j]
        if share is None:
            linearise(model, points, t, directions, F)
        else:
            for i in range(n):
                weighted[i] = share * V_x[i]
            curvature(model, points, t, weighted, directions, F, W)
        given = columns_of(model, V_x, V_xx, F)
        for j in range(lanes(model)):
            propagate_lane(given, F, W, Q_z, Q_zz, BF, j)
        for i in range(n):
            Q_z[i] += of_cost[t // STEPS, i, t % STEPS]
            Q_zz[i, i] += of_cost[t // STEPS, n + i, t % STEPS]
        Q_u, Q_uu = Q_z[n] + 2 * cost.R * U[t], Q_zz[n, n] + 2 * cost.R

        # (36), (37): V'_xx + μ I in place of V'_xx, for the gains alone
        Q_uu_mu = Q_uu + mu * BF[n]
        if not Q_uu_mu > 0:
            return False, slope, bend
        change, follows = 0.0, bounds.low < U[t] < bounds.high
        if len(k) > 0:
            best = -Q_u / Q_uu_mu
            change = k[t] = min(max(best, bounds.low - U[t]), bounds.high - U[t])
            follows = change == best
        factor = -1 / Q_uu_mu if follows else 0.0
        for j in range(lanes(model)):   # on the bound the best force does not follow the state
            gain[j] = factor * (Q_zz[n, j] + mu * BF[j])
        for i in range(n):
            K[t, i] = gain[i]

        slope += change * Q_u
        bend += change * Q_uu * change
        policy = numbers(model, gain), numbers(model, Q_zz[n])
        for j in range(lanes(model)):
            value_lane(policy, change, gain, Q_u, Q_uu, Q_z, Q_zz, V_x, V_xx, j)
    return True, slope, bend


@kernel
def forward(model, cost, X, U, gaps, k, K, alpha, bounds, X_new, U_new):
    """
    Write the trajectory of the policy u = U + α k + K (x - X), (33)-(35), and return its cost.

    A share α of the gaps is closed. Shapes: X and X_new (T + 1, 2n + 2), U and U_new (T,), gaps
    (T, 2n + 2), or (0, 2n + 2) for none, k (T,), K (T, 2n + 2).
    """
    n, total = size(model), 0.0
    for i in range(n):
        X_new[0, i] = X[0, i]
    for t in range(len(U)):
        u = U[t] + alpha * k[t]
        for i in range(n):
            u += K[t, i] * (X_new[t, i] - X[t, i])
        U_new[t] = min(max(u, bounds.low), bounds.high)
        total += running(cost, X_new[t], U_new[t])
        step(model, X_new[t], U_new[t], X_new[t + 1])
        if len(gaps) > 0:
            for i in range(n):
                X_new[t + 1, i] -= (1 - alpha) * gaps[t, i]
    return total + terminal(cost, X_new[len(U)])


@kernel
def line_search(model, cost, X, U, J, k, K, slope, bend, bounds, X_new, U_new):
    """
    Halve α until the cost falls as expected; return the new cost, infinity if it never does.

    Shapes: as in `forward`; there are no gaps, for a cost with gaps promises nothing.
    """
    alpha, gaps = 1.0, np.empty((0, size(model)))
    for _ in range(HALVINGS):
        J_new = forward(model, cost, X, U, gaps, k, K, alpha, bounds, X_new, U_new)
        if J - J_new >= -SUFFICIENT * alpha * (slope + 0.5 * alpha * bend) and J_new < J:
            return J_new
        alpha *= 0.5
    return np.inf
