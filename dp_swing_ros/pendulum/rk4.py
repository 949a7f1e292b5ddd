# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The pendulum over one step of the classical Runge-Kutta method under a held force.

    x⁺ = x + h/6 (k1 + 2 k2 + 2 k3 + k4),   kᵢ = f(xᵢ, u),   xᵢ₊₁ = x + cᵢ₊₁ h kᵢ

First derivatives go forward through the stages, along each direction of (x, u). The gradient of
λᵀ x⁺ comes from a backward sweep of costates, κᵢ = hbᵢ λ + cᵢ₊₁ h (∂f/∂x)ᵢ₊₁ᵀ κᵢ₊₁; that sweep,
differentiated along each direction, gives the second derivatives.
"""

from typing import NamedTuple

import numpy as np

from dp_swing_ros.kernels import kernel
from dp_swing_ros.kernels.lanes import blocks, direction, LANES, load, STEPS
from dp_swing_ros.pendulum import equations as pendulum
from dp_swing_ros.pendulum import model as generic
from dp_swing_ros.pendulum.derivatives import (
    against, along, bent, keep, KEPT, kept_curvature, kept_jacobian)
from dp_swing_ros.pendulum.equations import Pendulum


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


@generic.of_coefficients.register(RK4)
@kernel
def of_coefficients(model, numbers):
    """Return the model of the same steps for another Pendulum."""
    return RK4(pendulum.of_numbers(numbers), model.h, model.half, model.third, model.sixth)


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


@generic.expand.register(RK4)
@kernel
def expand(model, X, U):
    """Return the accelerations' derivatives at the four stages of every step."""
    p, h, half, _, _ = model
    points, z = np.empty((blocks(U), 4, KEPT, STEPS)), np.empty((7, STEPS))
    for block in range(len(points)):
        load(X, U, block * STEPS, z)
        at_a, at_b, at_c, at_d = (points[block, 0], points[block, 1], points[block, 2],
                                  points[block, 3])
        for i in range(STEPS):
            th_1, th_2, v, w_1, w_2, u = z[1, i], z[2, i], z[3, i], z[4, i], z[5, i], z[6, i]
            a_0, a_1, a_2 = keep(p, th_1, th_2, v, w_1, w_2, u, at_a, i)
            v_b, w_1b, w_2b = v + half * a_0, w_1 + half * a_1, w_2 + half * a_2
            b_0, b_1, b_2 = keep(p, th_1 + half * w_1, th_2 + half * w_2, v_b, w_1b, w_2b, u,
                                 at_b, i)
            v_c, w_1c, w_2c = v + half * b_0, w_1 + half * b_1, w_2 + half * b_2
            c_0, c_1, c_2 = keep(p, th_1 + half * w_1b, th_2 + half * w_2b, v_c, w_1c, w_2c, u,
                                 at_c, i)
            keep(p, th_1 + h * w_1c, th_2 + h * w_2c, v + h * c_0, w_1 + h * c_1, w_2 + h * c_2,
                 u, at_d, i)
    return points


@kernel
def jacobians(points, t):
    """Return J of the four stages of step t."""
    kept, i = points[t // STEPS], t % STEPS
    return (kept_jacobian(kept[0], i), kept_jacobian(kept[1], i), kept_jacobian(kept[2], i),
            kept_jacobian(kept[3], i))


@kernel
def tangent(model, J, d, F, m):
    """
    Write column m of F: `advance`, differentiated in a direction d of (x, u) by the chain rule.

    Returns what that direction is at each stage, dzᵢ.
    """
    p, h, half, third, sixth = model
    J_a, J_b, J_c, J_d = J
    x, th_1, th_2, v, w_1, w_2, u = d
    z_a = (th_1, th_2, w_1, w_2, u - p.b_0 * v)
    a_0, a_1, a_2 = along(J_a, z_a)
    v_b, w_1b, w_2b = v + half * a_0, w_1 + half * a_1, w_2 + half * a_2
    z_b = (th_1 + half * w_1, th_2 + half * w_2, w_1b, w_2b, u - p.b_0 * v_b)
    b_0, b_1, b_2 = along(J_b, z_b)
    v_c, w_1c, w_2c = v + half * b_0, w_1 + half * b_1, w_2 + half * b_2
    z_c = (th_1 + half * w_1b, th_2 + half * w_2b, w_1c, w_2c, u - p.b_0 * v_c)
    c_0, c_1, c_2 = along(J_c, z_c)
    v_d, w_1d, w_2d = v + h * c_0, w_1 + h * c_1, w_2 + h * c_2
    z_d = (th_1 + h * w_1c, th_2 + h * w_2c, w_1d, w_2d, u - p.b_0 * v_d)
    d_0, d_1, d_2 = along(J_d, z_d)
    F[0, m] = x + sixth * (v + v_d) + third * (v_b + v_c)
    F[1, m] = th_1 + sixth * (w_1 + w_1d) + third * (w_1b + w_1c)
    F[2, m] = th_2 + sixth * (w_2 + w_2d) + third * (w_2b + w_2c)
    F[3, m] = v + sixth * (a_0 + d_0) + third * (b_0 + c_0)
    F[4, m] = w_1 + sixth * (a_1 + d_1) + third * (b_1 + c_1)
    F[5, m] = w_2 + sixth * (a_2 + d_2) + third * (b_2 + c_2)
    return z_a, z_b, z_c, z_d


@generic.linearise.register(RK4)
@kernel
def linearise(model, points, t, F):
    """Write F."""
    J = jacobians(points, t)
    for m in range(LANES):
        tangent(model, J, direction(m), F, m)


@kernel
def weighted(weight, costate, ch, later, g, p):
    """
    Return κᵢ = hbᵢ λ + cᵢ₊₁ h ξᵢ₊₁ of a stage from κ and g = Jᵀ κ[3:] of the one after.

    There ξ, the costate of the stage's state, has no part of the cart's position.
    """
    return (weight * costate[0], weight * costate[1] + ch * g[0],
            weight * costate[2] + ch * g[1],
            weight * costate[3] + ch * (later[0] - p.b_0 * g[4]),
            weight * costate[4] + ch * (later[1] + g[2]),
            weight * costate[5] + ch * (later[2] + g[3]))


@kernel
def earlier(ch, later, g, p):
    """Return dκᵢ = cᵢ₊₁ h dξᵢ₊₁ of a stage, but for its first number, which is zero."""
    return (ch * g[0], ch * g[1], -ch * p.b_0 * g[4], ch * (later[0] + g[2]),
            ch * (later[1] + g[3]))


@kernel
def plus(g, more):
    """Return the sum of two tuples of five."""
    return g[0] + more[0], g[1] + more[1], g[2] + more[2], g[3] + more[3], g[4] + more[4]


@kernel
def curvatures(model, points, t, J, costate):
    """Return M of the four stages of step t, from a sweep of costates."""
    p, h, half, third, sixth = model
    J_a, J_b, J_c, J_d = J
    k_d = (sixth * costate[0], sixth * costate[1], sixth * costate[2], sixth * costate[3],
           sixth * costate[4], sixth * costate[5])
    k_c = weighted(third, costate, h, k_d, against(J_d, k_d[3], k_d[4], k_d[5]), p)
    k_b = weighted(third, costate, half, k_c, against(J_c, k_c[3], k_c[4], k_c[5]), p)
    k_a = weighted(sixth, costate, half, k_b, against(J_b, k_b[3], k_b[4], k_b[5]), p)
    kept, i = points[t // STEPS], t % STEPS
    return (kept_curvature(p, kept[0], i, J_a, k_a[3], k_a[4], k_a[5]),
            kept_curvature(p, kept[1], i, J_b, k_b[3], k_b[4], k_b[5]),
            kept_curvature(p, kept[2], i, J_c, k_c[3], k_c[4], k_c[5]),
            kept_curvature(p, kept[3], i, J_d, k_d[3], k_d[4], k_d[5]))


@generic.curvature.register(RK4)
@kernel
def curvature(model, points, t, costate, F, W):
    """
    Write F, and column by column W: how the gradient Fᵀ λ changes in each direction.

    The costates' sweep, differentiated: gᵢ = Jᵢᵀ κᵢ[3:] changes by Mᵢ dzᵢ + Jᵢᵀ dκᵢ[3:].
    """
    p, h, half = model.pendulum, model.h, model.half
    J = jacobians(points, t)
    M_a, M_b, M_c, M_d = curvatures(model, points, t, J, costate)
    for m in range(LANES):
        z_a, z_b, z_c, z_d = tangent(model, J, direction(m), F, m)
        g_d = bent(M_d, z_d)
        k_c = earlier(h, (0.0, 0.0), g_d, p)
        g_c = plus(bent(M_c, z_c), against(J[2], k_c[2], k_c[3], k_c[4]))
        k_b = earlier(half, k_c, g_c, p)
        g_b = plus(bent(M_b, z_b), against(J[1], k_b[2], k_b[3], k_b[4]))
        k_a = earlier(half, k_b, g_b, p)
        g_a = plus(bent(M_a, z_a), against(J[0], k_a[2], k_a[3], k_a[4]))
        g = plus(plus(g_a, g_b), plus(g_c, g_d))
        W[0, m] = 0.0
        W[1, m], W[2, m], W[3, m] = g[0], g[1], -p.b_0 * g[4]
        W[4, m] = g[2] + k_a[0] + k_b[0] + k_c[0]
        W[5, m] = g[3] + k_a[1] + k_b[1] + k_c[1]
        W[6, m] = g[4]
