# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
First and second derivatives of the accelerations, at one point.

They solve D a = r. That identity, differentiated at a fixed a by the variables
z = (θ1 … θn, θ̇1 … θ̇n, f) that they depend on, gives with μ = D ν

    J = ∂a/∂z = D⁻¹ ∂(r - D a)/∂z
    M_jk = Σ μ_i ∂²a_i/∂z_j∂z_k = ∂²(νᵀ(r - D a))/∂z_j∂z_k - e_jᵀ J_k - e_kᵀ J_j
    e_j = ∂(D ν)/∂z_j
"""

from collections.abc import Callable, Sequence
from functools import singledispatch
from typing import Any, NamedTuple

from dp_swing_ros.kernels.symbols import cos, dot, fixed, gradient, sin
from dp_swing_ros.pendulum.equations import (
    friction, generalised_force, inverse_inertia, mass_matrix, Matrix, Numbers, Parts, Pendulum,
    solve, spring_torques, with_springs)


@singledispatch
def point_type(dynamics: Any) -> Any:
    """Return what holds the derivatives at a point of a kind of dynamics, as `Point` does."""
    raise TypeError(f'{type(dynamics).__name__} has no derivatives')


class Point(NamedTuple):
    """What the derivatives of the accelerations need at one point."""

    s: list[Any]      # sines and cosines of the angles
    c: list[Any]
    w: list[Any]      # speeds of the links
    a: list[Any]      # accelerations of cart and links
    J: Matrix         # (n + 1, 2n + 1) their derivatives by z, the last column that of D⁻¹
    links: Matrix     # the upper triangle of D⁻¹ but for its first row
    drag: list[Any]   # slope of the cart's friction, and the slope of that

    @classmethod
    def of(cls, p: Pendulum, x: Numbers, u: Any) -> 'Point':
        """Evaluate all at a state x under a force u."""
        n, (_, th, v, w) = p.links, Parts.of(p, x)
        s, c = [sin(th_i) for th_i in th], [cos(th_i) for th_i in th]
        held_back, D = friction(p, 0, v), mass_matrix(p, s, c)
        (slope,), f = gradient(held_back, [v]), u - held_back
        r = with_springs(p, th, generalised_force(p, s, c, w, f))
        a, D_inverse = solve(D, r), inverse_inertia(D)
        residual = residuals(p, s, c, w, f, [fixed(a_i) for a_i in a])
        by_z = [by_variables(each, s, c, w) for each in residual]
        for row, torque in zip(by_z[1:], spring_torques(p, th)):   # linear, so in no M
            row[:n] = [slope + more for slope, more in zip(row, gradient(torque, th))]
        J = [[*(dot(row, column) for column in zip(*by_z)), row[0]] for row in D_inverse]
        return cls(s, c, w, a, J, [D_inverse[i][i:] for i in range(1, len(a))],
                   [slope, *gradient(slope, [v])])

    @classmethod
    def read(cls, n: int, numbers: Sequence[Any]) -> 'Point':
        """Return the point whose numbers these are, in order."""
        some = in_turn(numbers)
        return cls(some(n), some(n), some(n), some(n + 1), [some(2 * n + 1) for _ in range(n + 1)],
                   [some(n - i) for i in range(n)], some(2))

    @staticmethod
    def curved_pairs(n: int) -> list[tuple[int, int]]:
        """
        Return the pairs j ≤ k for which ∂²a/∂z_j∂z_k is not zero.

        They are an angle's, those of the speeds that meet in a joint, and the cart's speed's
        square.
        """
        return [(j, k) for j in range(2 * n + 1) for k in range(j, 2 * n + 1)
                if j < n or j <= k < min(j + 2, 2 * n)] + [(2 * n + 1, 2 * n + 1)]

    def inverse_row(self, i: int) -> list[Any]:
        """Return row i of D⁻¹."""
        first = [row[-1] for row in self.J]
        return first if i == 0 else [
            first[i], *(self.links[min(i, j) - 1][abs(i - j)] for j in range(1, len(first)))]

    def second_derivatives(self, p: Pendulum, mu: Numbers) -> list[Any]:
        """Return the M_jk of curved_pairs."""
        n = len(self.s)
        variables = self.s, self.c, self.w
        nu = [dot(self.inverse_row(i), mu) for i in range(n + 1)]
        # the force adds to it what has no second derivative
        slopes = [*by_variables(dot(nu, residuals(p, *variables, 0.0, self.a)), *variables), 0.0]
        second = [[*by_variables(slope, *variables), 0.0] for slope in slopes]
        momenta = [dot(row, nu) for row in mass_matrix(p, self.s, self.c)]
        e = list(zip(*([*by_variables(each, *variables), 0.0] for each in momenta)))
        J = list(zip(*self.J))   # by columns, as e
        return [*(second[j][k] - (dot(e[j], J[k]) + dot(e[k], J[j]))
                  for j, k in self.curved_pairs(n)[:-1]), -(nu[0] * self.drag[1])]


@point_type.register
def _(dynamics: Pendulum) -> type[Point]:
    return Point


def in_turn(numbers: Sequence[Any]) -> Callable[[int], list[Any]]:
    """Return what returns the next so many of some numbers."""
    rest = iter(numbers)
    return lambda count: [next(rest) for _ in range(count)]


def residuals(p: Pendulum, s: Numbers, c: Numbers, w: Numbers, f: Any, a: Numbers) -> list[Any]:
    """Return r - D a."""
    return [r_i - dot(row, a) for r_i, row in zip(
        generalised_force(p, s, c, w, f), mass_matrix(p, s, c))]


def by_variables(y: Any, s: Numbers, c: Numbers, w: Numbers) -> list[Any]:
    """Return the derivatives of y by the angles, and by the rates w."""
    n, slopes = len(s), gradient(y, [*s, *c, *w])
    return [c[i] * slopes[i] - s[i] * slopes[n + i] for i in range(n)] + slopes[2 * n:]
