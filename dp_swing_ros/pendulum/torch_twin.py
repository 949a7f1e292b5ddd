# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The same equations in torch: batched, differentiable by autograd, on any device.

This is the paper's way of differentiating (II-C), with the errata of docs/model.md; and unlike
its authors' code it builds D, C and G by operations that autograd follows. Below it stands the
closed form of the kernels, for many samples on a device.
"""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

import torch
from torch import Tensor
from torch.func import jacrev

from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.euler import Euler
from dp_swing_ros.pendulum.rk4 import RK4

Numbers: TypeAlias = tuple[Tensor, ...]   # the six of the state, of many samples each


class Expansion(NamedTuple):
    """
    Derivatives of one step.

    Shapes: A (T, 6, 6), B (T, 6), second (T, 6, 7, 7) over (x, u).
    """

    A: Tensor
    B: Tensor
    second: Tensor


def derivative(p: Pendulum, x: Tensor, u: Tensor) -> Tensor:
    """
    Return ẋ = f(x, u) from D q̈ + C q̇ + G = H u - friction.

    Shapes: x (..., 6), u (...) -> (..., 6). Source: the paper, (3)-(15), corrected.
    """
    th_1, th_2, v, w_1, w_2 = x[..., 1:].unbind(-1)
    c_1, c_2, c_12 = torch.cos(th_1), torch.cos(th_2), torch.cos(th_1 - th_2)
    s_1, s_2, s_12 = torch.sin(th_1), torch.sin(th_2), torch.sin(th_1 - th_2)
    constant = torch.ones_like(th_1)
    D = torch.stack([
        torch.stack([p.d_00 * constant, p.d_01 * c_1, p.d_02 * c_2], -1),
        torch.stack([p.d_01 * c_1, p.d_11 * constant, p.d_12 * c_12], -1),
        torch.stack([p.d_02 * c_2, p.d_12 * c_12, p.d_22 * constant], -1)], -2)
    slip = p.b_2 * (w_1 - w_2)
    r = torch.stack([
        u - p.b_0 * v + p.d_01 * s_1 * w_1 ** 2 + p.d_02 * s_2 * w_2 ** 2,
        p.g * p.d_01 * s_1 - p.d_12 * s_12 * w_2 ** 2 - p.b_1 * w_1 - slip,
        p.g * p.d_02 * s_2 + p.d_12 * s_12 * w_1 ** 2 + slip], -1)
    return torch.cat([x[..., 3:], torch.linalg.solve(D, r)], -1)


def rk4_step(p: Pendulum, h: float, x: Tensor, u: Tensor) -> Tensor:
    """Return the state after one step of h [s] under held forces; shapes as in derivative."""
    k_1 = derivative(p, x, u)
    k_2 = derivative(p, x + h / 2 * k_1, u)
    k_3 = derivative(p, x + h / 2 * k_2, u)
    k_4 = derivative(p, x + h * k_3, u)
    return x + h / 6 * (k_1 + 2 * k_2 + 2 * k_3 + k_4)


def euler_step(p: Pendulum, h: float, x: Tensor, u: Tensor) -> Tensor:
    """Return the state after one forward Euler step of h [s]; shapes as in derivative."""
    return x + h * derivative(p, x, u)


STEPS = {'rk4': rk4_step, 'euler': euler_step}


def expand(model: str, p: Pendulum, h: float, X: Tensor, U: Tensor) -> Expansion:
    """
    Differentiate one step twice at every point of a trajectory, by autograd.

    Shapes: X (T, 6), U (T,). Source: the paper, II-C.1.
    """
    def step(z: Tensor) -> Tensor:
        return STEPS[model](p, h, z[:6], z[6])

    z = torch.cat([X, U[:, None]], -1)
    first = torch.vmap(jacrev(step))(z)
    # not torch.func.hessian: under vmap its forward mode is wrong for linalg.solve (torch 2.13)
    return Expansion(first[..., :6], first[..., 6], torch.vmap(jacrev(jacrev(step)))(z))


def slope(p: Pendulum, x: Numbers, u: Tensor) -> Numbers:
    """Return ẋ = f(x, u), number by number, in closed form as in equations.py: no linear solve."""
    _, th_1, th_2, v, w_1, w_2 = x
    s_1, c_1, s_2, c_2 = th_1.sin(), th_1.cos(), th_2.sin(), th_2.cos()
    s_12, c_12 = s_1 * c_2 - c_1 * s_2, c_1 * c_2 + s_1 * s_2
    m_01, m_02, m_12 = p.d_01 * c_1, p.d_02 * c_2, p.d_12 * c_12
    i_00, i_11 = p.d_11 * p.d_22 - m_12 * m_12, p.d_00 * p.d_22 - m_02 * m_02
    i_22 = p.d_00 * p.d_11 - m_01 * m_01
    i_01, i_02 = m_02 * m_12 - m_01 * p.d_22, m_01 * m_12 - m_02 * p.d_11
    i_12 = m_01 * m_02 - p.d_00 * m_12
    per_det = 1 / (p.d_00 * i_00 + m_01 * i_01 + m_02 * i_02)
    slip = p.b_2 * (w_1 - w_2)
    r_0 = u - p.b_0 * v + p.d_01 * s_1 * w_1 * w_1 + p.d_02 * s_2 * w_2 * w_2
    r_1 = p.g * p.d_01 * s_1 - p.d_12 * s_12 * w_2 * w_2 - p.b_1 * w_1 - slip
    r_2 = p.g * p.d_02 * s_2 + p.d_12 * s_12 * w_1 * w_1 + slip
    return (v, w_1, w_2, (i_00 * r_0 + i_01 * r_1 + i_02 * r_2) * per_det,
            (i_01 * r_0 + i_11 * r_1 + i_12 * r_2) * per_det,
            (i_02 * r_0 + i_12 * r_1 + i_22 * r_2) * per_det)


def moved(x: Numbers, h: Any, k: Numbers) -> Numbers:
    """Return x + h k, number by number."""
    return tuple(x_i + h * k_i for x_i, k_i in zip(x, k))


def rk4_advance(model: RK4, x: Numbers, u: Tensor) -> Numbers:
    """Return the six numbers of the state after one step of the classical Runge-Kutta method."""
    p, h, half, third, sixth = model
    k_1 = slope(p, x, u)
    k_2 = slope(p, moved(x, half, k_1), u)
    k_3 = slope(p, moved(x, half, k_2), u)
    k_4 = slope(p, moved(x, h, k_3), u)
    return tuple(x_i + sixth * (a + d) + third * (b + c)
                 for x_i, a, b, c, d in zip(x, k_1, k_2, k_3, k_4))


def euler_advance(model: Euler, x: Numbers, u: Tensor) -> Numbers:
    """Return the six numbers of the state after one step of forward Euler."""
    return moved(x, model.h, slope(model.pendulum, x, u))


# As pendulum.model.advance, for models whose numbers are tensors.
ADVANCES: dict[type, Callable[..., Numbers]] = {RK4: rk4_advance, Euler: euler_advance}
