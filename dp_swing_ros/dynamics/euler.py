# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The pendulum over one step of forward Euler: x⁺ = x + h f(x, u).

This is what the paper's authors ran, as plant and as model. At 50 ms it gains 16 J in 5 s.
"""

import math
from typing import NamedTuple

import numpy as np

from dp_swing_ros.dynamics import model as generic
from dp_swing_ros.dynamics import pendulum
from dp_swing_ros.dynamics.pendulum import Pendulum
from dp_swing_ros.kernels import kernel


class Euler(NamedTuple):
    """The pendulum and the duration of a step [s]."""

    pendulum: Pendulum
    h: float

    @classmethod
    def of(cls, pendulum: Pendulum, h: float) -> 'Euler':
        """Build the model of steps of h [s]."""
        return cls(pendulum, h)


@generic.advance.register(Euler)
@kernel
def advance(model, x, th_1, th_2, v, w_1, w_2, u):
    """Return the six numbers of x + h f(x, u)."""
    p, h = model
    a_0, a_1, a_2 = pendulum.derivative(p, th_1, th_2, v, w_1, w_2, u)
    return (x + h * v, th_1 + h * w_1, th_2 + h * w_2,
            v + h * a_0, w_1 + h * a_1, w_2 + h * a_2)


@generic.linearise.register(Euler)
@kernel
def linearise(model, x, u, A, B):
    """Write A = I + h F and B = h ∂f/∂u."""
    p, h = model.pendulum, model.h
    J = np.empty((3, 5))
    pendulum.jacobian(p, math.sin(x[1]), math.cos(x[1]), math.sin(x[2]), math.cos(x[2]),
                      x[4], x[5], u - p.b_0 * x[3], J)
    A[:, :] = 0.0
    B[:3] = 0.0
    for i in range(3):
        A[i, i] = 1.0
        A[i, i + 3] = h
        row = A[i + 3]
        row[1], row[2], row[3] = h * J[i, 0], h * J[i, 1], -h * p.b_0 * J[i, 4]
        row[4], row[5] = h * J[i, 2], h * J[i, 3]
        row[i + 3] += 1.0
        B[i + 3] = h * J[i, 4]


@generic.curvature.register(Euler)
@kernel
def curvature(model, x, u, costate, A, B, W):
    """Write A, B and W: only the accelerations are curved."""
    p, h = model.pendulum, model.h
    J, M = np.empty((3, 5)), np.empty((5, 5))
    linearise(model, x, u, A, B)
    s_1, c_1, s_2, c_2 = math.sin(x[1]), math.cos(x[1]), math.sin(x[2]), math.cos(x[2])
    f = u - p.b_0 * x[3]
    pendulum.jacobian(p, s_1, c_1, s_2, c_2, x[4], x[5], f, J)
    pendulum.curvature(p, s_1, c_1, s_2, c_2, x[4], x[5], f, J,
                       h * costate[3], h * costate[4], h * costate[5], M)
    W[:, :] = 0.0
    places = (1, 2, 4, 5, 6)  # of θ1, θ2, θ̇1, θ̇2 and f in (x, u)
    for j in range(5):
        for k in range(5):
            W[places[j], places[k]] = M[j, k]
    # f = u - b_0 ẋ: the cart's velocity curves as -b_0 times the force does
    for k in range(7):
        W[3, k] = W[k, 3] = -p.b_0 * W[6, k]
    W[3, 3] = p.b_0 * p.b_0 * W[6, 6]
