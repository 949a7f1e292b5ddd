# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The pendulum over one step of the classical Runge-Kutta method under a held force.

    x⁺ = x + h/6 (k1 + 2 k2 + 2 k3 + k4),   kᵢ = f(xᵢ, u),   xᵢ₊₁ = x + cᵢ₊₁ h kᵢ

First derivatives go forward through the stages (Zᵢ = ∂zᵢ/∂(x, u)); the second come from one
backward sweep of costates, κᵢ = hbᵢ λ + cᵢ₊₁ h Fᵢ₊₁ᵀ κᵢ₊₁, as W = Σᵢ Zᵢᵀ (Σ κᵢ ∂²f) Zᵢ.
"""

import math
from typing import NamedTuple

import numpy as np

from dp_swing_ros.dynamics import model as generic
from dp_swing_ros.dynamics import pendulum
from dp_swing_ros.dynamics.pendulum import Pendulum
from dp_swing_ros.kernels import kernel

NODES = (0.0, 0.5, 0.5, 1.0)           # c
WEIGHTS = (1 / 6, 1 / 3, 1 / 3, 1 / 6)  # b
COLUMNS = (1, 2, 3, 4, 5, 6)           # of (x, u) that matter: θ1, θ2, ẋ, θ̇1, θ̇2, u


class RK4(NamedTuple):
    """The pendulum and the duration of a step [s], with its fractions that the stages need."""

    pendulum: Pendulum
    h: float
    half: float
    third: float
    sixth: float

    @classmethod
    def of(cls, pendulum: Pendulum, h: float) -> 'RK4':
        """Build the model of steps of h [s]."""
        return cls(pendulum, h, h / 2, h / 3, h / 6)


@generic.advance.register(RK4)
@kernel
def advance(model, x, th_1, th_2, v, w_1, w_2, u):
    """Return the six numbers of the state after one step, in the precision of the arguments."""
    p, h, half, third, sixth = model
    a_0, a_1, a_2 = pendulum.derivative(p, th_1, th_2, v, w_1, w_2, u)
    v_b, w_1b, w_2b = v + half * a_0, w_1 + half * a_1, w_2 + half * a_2
    b_0, b_1, b_2 = pendulum.derivative(
        p, th_1 + half * w_1, th_2 + half * w_2, v_b, w_1b, w_2b, u)
    v_c, w_1c, w_2c = v + half * b_0, w_1 + half * b_1, w_2 + half * b_2
    c_0, c_1, c_2 = pendulum.derivative(
        p, th_1 + half * w_1b, th_2 + half * w_2b, v_c, w_1c, w_2c, u)
    v_d, w_1d, w_2d = v + h * c_0, w_1 + h * c_1, w_2 + h * c_2
    d_0, d_1, d_2 = pendulum.derivative(
        p, th_1 + h * w_1c, th_2 + h * w_2c, v_d, w_1d, w_2d, u)
    return (x + sixth * (v + v_d) + third * (v_b + v_c),
            th_1 + sixth * (w_1 + w_1d) + third * (w_1b + w_1c),
            th_2 + sixth * (w_2 + w_2d) + third * (w_2b + w_2c),
            v + sixth * (a_0 + d_0) + third * (b_0 + c_0),
            w_1 + sixth * (a_1 + d_1) + third * (b_1 + c_1),
            w_2 + sixth * (a_2 + d_2) + third * (b_2 + c_2))


@kernel
def stages(model, x, u, z, J, Z, A, B):
    """
    Write the stages z, their Jacobians J and sensitivities Z, and with them A and B.

    Shapes: z (4, 5) and J (4, 3, 5) in z = (θ1, θ2, θ̇1, θ̇2, f); Z (4, 5, 6) over COLUMNS.
    """
    p, h = model.pendulum, model.h
    k = np.empty(6)            # k_i = (ẋ, θ̇1, θ̇2, accelerations) of the stage before
    dk = np.empty((6, 6))      # its derivatives by COLUMNS
    dx = np.empty((5, 6))      # of the stage's (θ1, θ2, ẋ, θ̇1, θ̇2)
    A[:, :] = 0.0
    B[:] = 0.0
    for i in range(6):
        A[i, i] = 1.0
    for i in range(4):
        ch = NODES[i] * h
        dx[:, :] = 0.0
        for j in range(5):
            dx[j, j] = 1.0
        th_1, th_2, v, w_1, w_2 = x[1], x[2], x[3], x[4], x[5]
        if i > 0:
            th_1, th_2 = th_1 + ch * k[1], th_2 + ch * k[2]
            v, w_1, w_2 = v + ch * k[3], w_1 + ch * k[4], w_2 + ch * k[5]
            for j in range(5):
                for m in range(6):
                    dx[j, m] += ch * dk[j + 1, m]
        f = u - p.b_0 * v
        z[i, 0], z[i, 1], z[i, 2], z[i, 3], z[i, 4] = th_1, th_2, w_1, w_2, f
        k[0], k[1], k[2] = v, w_1, w_2
        k[3], k[4], k[5] = pendulum.jacobian(
            p, math.sin(th_1), math.cos(th_1), math.sin(th_2), math.cos(th_2), w_1, w_2, f, J[i])
        for m in range(6):
            Z[i, 0, m], Z[i, 1, m] = dx[0, m], dx[1, m]
            Z[i, 2, m], Z[i, 3, m] = dx[3, m], dx[4, m]
            Z[i, 4, m] = -p.b_0 * dx[2, m]
            dk[0, m], dk[1, m], dk[2, m] = dx[2, m], dx[3, m], dx[4, m]
        Z[i, 4, 5] += 1.0
        for j in range(3):
            for m in range(6):
                dk[j + 3, m] = (J[i, j, 0] * Z[i, 0, m] + J[i, j, 1] * Z[i, 1, m]
                                + J[i, j, 2] * Z[i, 2, m] + J[i, j, 3] * Z[i, 3, m]
                                + J[i, j, 4] * Z[i, 4, m])
        hb = h * WEIGHTS[i]
        for j in range(6):
            for m in range(5):
                A[j, m + 1] += hb * dk[j, m]
            B[j] += hb * dk[j, 5]


@generic.linearise.register(RK4)
@kernel
def linearise(model, x, u, A, B):
    """Write A and B."""
    stages(model, x, u, np.empty((4, 5)), np.empty((4, 3, 5)), np.empty((4, 5, 6)), A, B)


@generic.curvature.register(RK4)
@kernel
def curvature(model, x, u, costate, A, B, W):
    """Write A, B and W."""
    p, h = model.pendulum, model.h
    z, J, Z = np.empty((4, 5)), np.empty((4, 3, 5)), np.empty((4, 5, 6))
    stages(model, x, u, z, J, Z, A, B)
    M, MZ = np.empty((5, 5)), np.empty((5, 6))
    kappa = np.empty(6)   # costate of k_i
    xi = np.zeros(6)      # costate of the stage's state
    W[:, :] = 0.0
    for i in range(3, -1, -1):
        later = NODES[i + 1] * h if i < 3 else 0.0
        for j in range(6):
            kappa[j] = h * WEIGHTS[i] * costate[j] + later * xi[j]
        s_1, c_1, s_2, c_2 = (math.sin(z[i, 0]), math.cos(z[i, 0]),
                              math.sin(z[i, 1]), math.cos(z[i, 1]))
        pendulum.curvature(p, s_1, c_1, s_2, c_2, z[i, 2], z[i, 3], z[i, 4], J[i],
                           kappa[3], kappa[4], kappa[5], M)
        for j in range(5):
            for m in range(6):
                MZ[j, m] = (M[j, 0] * Z[i, 0, m] + M[j, 1] * Z[i, 1, m] + M[j, 2] * Z[i, 2, m]
                            + M[j, 3] * Z[i, 3, m] + M[j, 4] * Z[i, 4, m])
        for j in range(6):
            for m in range(j, 6):
                W[j + 1, m + 1] += (
                    Z[i, 0, j] * MZ[0, m] + Z[i, 1, j] * MZ[1, m] + Z[i, 2, j] * MZ[2, m]
                    + Z[i, 3, j] * MZ[3, m] + Z[i, 4, j] * MZ[4, m])
        g = np.empty(5)   # Jᵀ κ on (θ1, θ2, θ̇1, θ̇2, f)
        for m in range(5):
            g[m] = J[i, 0, m] * kappa[3] + J[i, 1, m] * kappa[4] + J[i, 2, m] * kappa[5]
        xi[1], xi[2] = g[0], g[1]
        xi[3], xi[4], xi[5] = kappa[0] - p.b_0 * g[4], kappa[1] + g[2], kappa[2] + g[3]
    for j in range(1, 7):
        for m in range(1, j):
            W[j, m] = W[m, j]
