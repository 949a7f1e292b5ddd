# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Accelerations of the double pendulum on a cart.

    D(θ) q̈ + C(θ, θ̇) q̇ + G(θ) = H u - friction,    q = [x, θ1, θ2]

Source: the paper, (4)-(15), with the errata of docs/model.md. With r = H u - C q̇ - G - friction,
the accelerations a solve D a = r. They depend on θ1, θ2, θ̇1, θ̇2 and f alone, where f is the
force on the cart less its friction. The kernels take sines and cosines as arguments and hold no
constants that would widen them, so the same lines serve in single precision.
"""

import math
from typing import NamedTuple

import numpy as np

from dp_swing_ros.kernels import kernel
from dp_swing_ros.kernels.trigonometry import sincos
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import Array


class Pendulum(NamedTuple):
    """Coefficients of the equations of motion, from masses, lengths and frictions."""

    d_00: float  # [kg]      m0 + m1 + m2
    d_01: float  # [kg m]    (m1/2 + m2) l1, times cos θ1 in D
    d_02: float  # [kg m]    m2 l2 / 2, times cos θ2 in D
    d_11: float  # [kg m^2]  (m1/3 + m2) l1^2, if link 1 is a uniform rod
    d_12: float  # [kg m^2]  m2 l1 l2 / 2, times cos(θ1 - θ2) in D
    d_22: float  # [kg m^2]  m2 l2^2 / 3, likewise
    g: float     # [m/s^2]
    b_0: float   # [N s/m]      friction of the cart
    b_1: float   # [N m s/rad]  friction of joint 1
    b_2: float   # [N m s/rad]  friction of joint 2

    @classmethod
    def of(cls, bodies: PendulumParameters) -> 'Pendulum':
        """Compute the coefficients of bodies."""
        return cls(*coefficients(
            bodies.cart_mass, bodies.link1_mass, bodies.link2_mass, bodies.link1_length,
            bodies.link2_length, bodies.cart_friction, bodies.joint1_friction,
            bodies.joint2_friction, bodies.link1_inertia_factor, bodies.link2_inertia_factor,
            bodies.gravity))


@kernel
def coefficients(m_0, m_1, m_2, l_1, l_2, b_0, b_1, b_2, factor_1, factor_2, g):
    """Return the fields of a Pendulum. Source: the paper, (8)-(10) and (14), corrected."""
    # beyond a uniform rod's, and exactly zero where it is one
    extra_1 = (factor_1 - 1) * m_1 * l_1 ** 2 / 12
    extra_2 = (factor_2 - 1) * m_2 * l_2 ** 2 / 12
    return (m_0 + m_1 + m_2, (m_1 / 2 + m_2) * l_1, m_2 * l_2 / 2,
            (m_1 / 3 + m_2) * l_1 ** 2 + extra_1, m_2 * l_1 * l_2 / 2,
            m_2 * l_2 ** 2 / 3 + extra_2, g, b_0, b_1, b_2)


@kernel
def of_numbers(c):
    """Return the Pendulum whose fields stand in an array c (10,)."""
    return Pendulum(c[0], c[1], c[2], c[3], c[4], c[5], c[6], c[7], c[8], c[9])


@kernel
def inverse_inertia(p, s_1, c_1, s_2, c_2):
    """Return the six entries (00, 01, 02, 11, 12, 22) of the inverse of D(θ), (7)-(10)."""
    c_12 = c_1 * c_2 + s_1 * s_2
    m_01, m_02, m_12 = p.d_01 * c_1, p.d_02 * c_2, p.d_12 * c_12
    i_00 = p.d_11 * p.d_22 - m_12 * m_12
    i_01 = m_02 * m_12 - m_01 * p.d_22
    i_02 = m_01 * m_12 - m_02 * p.d_11
    i_11 = p.d_00 * p.d_22 - m_02 * m_02
    i_12 = m_01 * m_02 - p.d_00 * m_12
    i_22 = p.d_00 * p.d_11 - m_01 * m_01
    det = p.d_00 * i_00 + m_01 * i_01 + m_02 * i_02
    per_det = np.reciprocal(det)
    return (i_00 * per_det, i_01 * per_det, i_02 * per_det, i_11 * per_det, i_12 * per_det,
            i_22 * per_det)


@kernel
def generalised_force(p, s_1, c_1, s_2, c_2, w_1, w_2, f):
    """Return r = H f - C q̇ - G - joint friction, (11)-(15)."""
    h_1, h_2, h_12 = p.d_01 * s_1, p.d_02 * s_2, p.d_12 * (s_1 * c_2 - c_1 * s_2)
    square_1, square_2 = w_1 * w_1, w_2 * w_2
    slip = p.b_2 * (w_1 - w_2)
    r_0 = f + h_1 * square_1 + h_2 * square_2
    r_1 = p.g * h_1 - h_12 * square_2 - p.b_1 * w_1 - slip
    r_2 = p.g * h_2 + h_12 * square_1 + slip
    return r_0, r_1, r_2


@kernel
def accelerations(p, s_1, c_1, s_2, c_2, w_1, w_2, f):
    """
    Return a = D⁻¹ r [m/s^2, rad/s^2, rad/s^2].

    The first row gives a_0 = r_0 / d_00 - m_1 a_1 - m_2 a_2 with m_i = d_0i cos θi / d_00; put
    into the others, it leaves two equations for a_1 and a_2.
    """
    r_0, r_1, r_2 = generalised_force(p, s_1, c_1, s_2, c_2, w_1, w_2, f)
    m_01, m_02 = p.d_01 * c_1, p.d_02 * c_2
    m_1, m_2 = p.d_01 / p.d_00 * c_1, p.d_02 / p.d_00 * c_2
    d_11 = p.d_11 - m_01 * m_1
    d_12 = p.d_12 * (c_1 * c_2 + s_1 * s_2) - m_01 * m_2
    d_22 = p.d_22 - m_02 * m_2
    r_1, r_2 = r_1 - m_1 * r_0, r_2 - m_2 * r_0
    per_det = np.reciprocal(d_11 * d_22 - d_12 * d_12)   # of all here a division takes longest
    a_1 = (d_22 * r_1 - d_12 * r_2) * per_det
    a_2 = (d_11 * r_2 - d_12 * r_1) * per_det
    return np.reciprocal(p.d_00) * r_0 - m_1 * a_1 - m_2 * a_2, a_1, a_2


@kernel
def derivative(p, th_1, th_2, v, w_1, w_2, u):
    """Return the accelerations of cart and links at a state under the force u [N]."""
    s_1, c_1 = sincos(th_1)
    s_2, c_2 = sincos(th_2)
    return accelerations(p, s_1, c_1, s_2, c_2, w_1, w_2, u - p.b_0 * v)


@kernel
def stop(p, limit, x):
    """
    Bring a cart beyond the end of its track to rest there, by an inelastic impact.

    The impulse on the cart also turns the links: Δq̇ = D⁻¹ H impulse. Shapes: x (6,), changed.
    """
    if abs(x[0]) <= limit:
        return
    side = math.copysign(1.0, x[0])
    x[0] = side * limit
    if side * x[3] > 0:
        i_00, i_01, i_02, _, _, _ = inverse_inertia(
            p, math.sin(x[1]), math.cos(x[1]), math.sin(x[2]), math.cos(x[2]))
        impulse = -x[3] / i_00
        x[3] = 0.0
        x[4] += i_01 * impulse
        x[5] += i_02 * impulse


@kernel
def energy(p, x):
    """Return the kinetic and potential energy [J] of the state x (6,)."""
    v, w_1, w_2 = x[3], x[4], x[5]
    kinetic = (0.5 * (p.d_00 * v * v + p.d_11 * w_1 * w_1 + p.d_22 * w_2 * w_2)
               + p.d_01 * math.cos(x[1]) * v * w_1 + p.d_02 * math.cos(x[2]) * v * w_2
               + p.d_12 * math.cos(x[1] - x[2]) * w_1 * w_2)
    return kinetic + p.g * (p.d_01 * math.cos(x[1]) + p.d_02 * math.cos(x[2]))


def joints(X: Array, bodies: PendulumParameters) -> Array:
    """
    Return the places [m] of the cart, the tip of link 1 and the tip of link 2.

    Shapes: X (..., 6) -> (..., 3, 2), with x to the right and z up.
    """
    X = np.asarray(X)
    tips = np.zeros((*X.shape[:-1], 3, 2))
    tips[..., :, 0] = X[..., :1]
    for link, length in ((1, bodies.link1_length), (2, bodies.link2_length)):
        tips[..., link:, 0] += length * np.sin(X[..., link, None])
        tips[..., link:, 1] += length * np.cos(X[..., link, None])
    return tips
