# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The model in torch as the paper has it: D, C and G as they stand, and a linear solve in each stage.

Batched, and differentiable by autograd, which is the paper's way of differentiating (II-C); with
the errata of docs/model.md. Written beside equations.py, not by it, so that each checks the other.
"""

import torch
from torch import Tensor

from dp_swing_ros.pendulum.equations import Pendulum


def derivative(p: Pendulum, x: Tensor, u: Tensor) -> Tensor:
    """
    Return ẋ = f(x, u) from D q̈ + C q̇ + G = H u - friction.

    Shapes: x (..., 2n + 2), u (...) -> (..., 2n + 2). Source: the paper, (3)-(15), corrected.
    """
    n = len(p.a)
    th, v, w = x[..., 1:n + 1].unbind(-1), x[..., n + 1], x[..., n + 2:].unbind(-1)
    s, c = [torch.sin(th_i) for th_i in th], [torch.cos(th_i) for th_i in th]
    constant = torch.ones_like(v)
    pairs = [(i, j) for i in range(n) for j in range(i + 1, n)]
    b_c = {(i, j): p.b[i][j - i] * torch.cos(th[i] - th[j]) for i, j in pairs}
    b_s = {(i, j): p.b[i][j - i] * torch.sin(th[i] - th[j]) for i, j in pairs}
    D = [[p.m * constant, *(p.a[i] * c[i] for i in range(n))]]
    r = [u - p.friction[0] * v + sum(p.a[i] * s[i] * w[i] ** 2 for i in range(n))]
    torques = [p.friction[1] * w[0], *(
        p.friction[i + 1] * (w[i] - w[i - 1]) for i in range(1, n)), 0.0]
    for i in range(n):
        D.append([p.a[i] * c[i], *(p.b[i][0] * constant if j == i else b_c[min(i, j), max(i, j)]
                                   for j in range(n))])
        r.append(p.g * p.a[i] * s[i] - torques[i] + torques[i + 1]
                 - sum(b_s[i, j] * w[j] ** 2 for j in range(i + 1, n))
                 + sum(b_s[j, i] * w[j] ** 2 for j in range(i)))
    solved = torch.linalg.solve(torch.stack([torch.stack(row, -1) for row in D], -2),
                                torch.stack(r, -1))
    return torch.cat([x[..., n + 1:], solved], -1)


def rk4_step(p: Pendulum, h: float, x: Tensor, u: Tensor) -> Tensor:
    """Return the state after one step of h [s] under held forces; shapes as in derivative."""
    k_1 = derivative(p, x, u)
    k_2 = derivative(p, x + h / 2 * k_1, u)
    k_3 = derivative(p, x + h / 2 * k_2, u)
    k_4 = derivative(p, x + h * k_3, u)
    return x + h / 6 * (k_1 + 2 * k_2 + 2 * k_3 + k_4)
