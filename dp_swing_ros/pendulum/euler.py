# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The pendulum over one step of forward Euler: x⁺ = x + h f(x, u).

This is what the paper's authors ran, as plant and as model. At 50 ms it gains 16 J in 5 s.
"""

from typing import NamedTuple

import numpy as np

from dp_swing_ros.kernels import kernel
from dp_swing_ros.kernels.lanes import blocks, direction, LANES, load, STEPS
from dp_swing_ros.pendulum import equations as pendulum
from dp_swing_ros.pendulum import model as generic
from dp_swing_ros.pendulum.derivatives import (
    along, bent, keep, KEPT, kept_curvature, kept_jacobian)
from dp_swing_ros.pendulum.equations import Pendulum


class Euler(NamedTuple):
    """The pendulum and the duration of a step [s]."""

    pendulum: Pendulum
    h: float

    @classmethod
    def of(cls, pendulum: Pendulum, h: float) -> 'Euler':
        """Build the model of steps of h [s]."""
        return cls(pendulum, h)


@generic.of_coefficients.register(Euler)
@kernel
def of_coefficients(model, numbers):
    """Return the model of the same steps for another Pendulum."""
    return Euler(pendulum.of_numbers(numbers), model.h)


@generic.advance.register(Euler)
@kernel
def advance(model, x, th_1, th_2, v, w_1, w_2, u):
    """Return the six numbers of x + h f(x, u)."""
    p, h = model
    a_0, a_1, a_2 = pendulum.derivative(p, th_1, th_2, v, w_1, w_2, u)
    return (x + h * v, th_1 + h * w_1, th_2 + h * w_2,
            v + h * a_0, w_1 + h * a_1, w_2 + h * a_2)


@generic.expand.register(Euler)
@kernel
def expand(model, X, U):
    """Return the accelerations' derivatives at the beginning of every step."""
    points, z = np.empty((blocks(U), KEPT, STEPS)), np.empty((7, STEPS))
    for block in range(len(points)):
        load(X, U, block * STEPS, z)
        out = points[block]
        for i in range(STEPS):
            keep(model.pendulum, z[1, i], z[2, i], z[3, i], z[4, i], z[5, i], z[6, i], out, i)
    return points


@kernel
def tangent(model, J, d, F, m):
    """Write column m of F, along a direction d of (x, u), and return that direction of z."""
    p, h = model
    x, th_1, th_2, v, w_1, w_2, u = d
    z = (th_1, th_2, w_1, w_2, u - p.b_0 * v)
    a_0, a_1, a_2 = along(J, z)
    F[0, m], F[1, m], F[2, m] = x + h * v, th_1 + h * w_1, th_2 + h * w_2
    F[3, m], F[4, m], F[5, m] = v + h * a_0, w_1 + h * a_1, w_2 + h * a_2
    return z


@generic.linearise.register(Euler)
@kernel
def linearise(model, points, t, F):
    """Write F = [I + h ∂f/∂x, h ∂f/∂u]."""
    J = kept_jacobian(points[t // STEPS], t % STEPS)
    for m in range(LANES):
        tangent(model, J, direction(m), F, m)


@generic.curvature.register(Euler)
@kernel
def curvature(model, points, t, costate, F, W):
    """Write F and W: only the accelerations are curved."""
    p, h = model
    kept, i = points[t // STEPS], t % STEPS
    J = kept_jacobian(kept, i)
    M = kept_curvature(p, kept, i, J, h * costate[3], h * costate[4], h * costate[5])
    for m in range(LANES):
        g = bent(M, tangent(model, J, direction(m), F, m))
        # f = u - b_0 ẋ: the cart's velocity curves as -b_0 times the force does
        W[0, m], W[1, m], W[2, m], W[3, m] = 0.0, g[0], g[1], -p.b_0 * g[4]
        W[4, m], W[5, m], W[6, m] = g[2], g[3], g[4]
