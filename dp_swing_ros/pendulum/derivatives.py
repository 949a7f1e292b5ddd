# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
First and second derivatives of a step of the model.

The accelerations solve D a = r. That identity, differentiated at a fixed a by the variables
z = (θ1 … θn, θ̇1 … θ̇n, f) that they depend on, gives with μ = D ν

    J = ∂a/∂z = D⁻¹ ∂(r - D a)/∂z
    M_jk = Σ μ_i ∂²a_i/∂z_j∂z_k = ∂²(νᵀ(r - D a))/∂z_j∂z_k - e_jᵀ J_k - e_kᵀ J_j
    e_j = ∂(D ν)/∂z_j

A step is linear in all that its stages return, so it is differentiated by taking the same step
with each f replaced by its Jacobian; the costates of the stages are the gradient of that; and

    Σ λ_i ∂²f_i/∂(x, u)² = Σ_stages Z_iᵀ M_i Z_i,    Z_i = ∂z_i/∂(x, u)

What a point needs is computed for STEPS steps side by side in the lanes of a vector (`expand`),
and then, step by step, for all directions of (x, u) side by side (`linearise`, `curvature`).
"""

from collections.abc import Sequence
from itertools import count
from typing import Any, NamedTuple

import numpy as np

from dp_swing_ros.kernels import kernel
from dp_swing_ros.kernels.symbols import called, cos, dot, fixed, flat, gradient, sin, total
from dp_swing_ros.kernels.unrolling import unrolled
from dp_swing_ros.pendulum.equations import (
    friction, generalised_force, inverse_inertia, mass_matrix, Matrix, Numbers, Parts, Pendulum,
    solve)
from dp_swing_ros.pendulum.model import Model, size, zeros

STEPS = 16     # side by side
LANES = 8      # of a vector; directions of (x, u) fill one or two


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
        _, th, v, w = Parts.of(p, x)
        s, c = [sin(th_i) for th_i in th], [cos(th_i) for th_i in th]
        held_back, D = friction(p, 0, v), mass_matrix(p, s, c)
        (slope,), f = gradient(held_back, [v]), u - held_back
        a, D_inverse = solve(D, generalised_force(p, s, c, w, f)), inverse_inertia(D)
        residual = residuals(p, s, c, w, f, [fixed(a_i) for a_i in a])
        by_z = [by_variables(each, s, c, w) for each in residual]
        J = [[*(dot(row, column) for column in zip(*by_z)), row[0]] for row in D_inverse]
        return cls(s, c, w, a, J, [D_inverse[i][i:] for i in range(1, len(a))],
                   [slope, *gradient(slope, [v])])

    @classmethod
    def read(cls, n: int, numbers: Sequence[Any]) -> 'Point':
        """Return the point whose numbers these are, in order."""
        rest = iter(numbers)

        def some(count: int) -> list[Any]:
            return [next(rest) for _ in range(count)]
        return cls(some(n), some(n), some(n), some(n + 1), [some(2 * n + 1) for _ in range(n + 1)],
                   [some(n - i) for i in range(n)], some(2))

    def inverse_row(self, i: int) -> list[Any]:
        """Return row i of D⁻¹."""
        first = [row[-1] for row in self.J]
        return first if i == 0 else [
            first[i], *(self.links[min(i, j) - 1][abs(i - j)] for j in range(1, len(first)))]


def residuals(p: Pendulum, s: Numbers, c: Numbers, w: Numbers, f: Any, a: Numbers) -> list[Any]:
    """Return r - D a."""
    return [r_i - dot(row, a) for r_i, row in zip(
        generalised_force(p, s, c, w, f), mass_matrix(p, s, c))]


def by_variables(y: Any, s: Numbers, c: Numbers, w: Numbers) -> list[Any]:
    """Return the derivatives of y by the angles and the speeds of the links."""
    n, slopes = len(s), gradient(y, [*s, *c, *w])
    return [c[i] * slopes[i] - s[i] * slopes[n + i] for i in range(n)] + slopes[2 * n:]


def curved_pairs(n: int) -> list[tuple[int, int]]:
    """
    Return the pairs j ≤ k for which ∂²a/∂z_j∂z_k is not zero.

    They are an angle's, those of the speeds that meet in a joint, and the cart's speed's square.
    """
    return [(j, k) for j in range(2 * n + 1) for k in range(j, 2 * n + 1)
            if j < n or j <= k < min(j + 2, 2 * n)] + [(2 * n + 1, 2 * n + 1)]


def second_derivatives(p: Pendulum, at: Point, mu: Numbers) -> list[Any]:
    """Return the M_jk of curved_pairs."""
    n = len(at.s)
    variables = at.s, at.c, at.w
    nu = [dot(at.inverse_row(i), mu) for i in range(n + 1)]
    # the force adds to it what has no second derivative
    slopes = [*by_variables(dot(nu, residuals(p, *variables, 0.0, at.a)), *variables), 0.0]
    second = [[*by_variables(slope, *variables), 0.0] for slope in slopes]
    momenta = [dot(row, nu) for row in mass_matrix(p, at.s, at.c)]
    e = list(zip(*([*by_variables(each, *variables), 0.0] for each in momenta)))
    J = list(zip(*at.J))   # by columns, as e
    return [*(second[j][k] - (dot(e[j], J[k]) + dot(e[k], J[j]))
              for j, k in curved_pairs(n)[:-1]), -(nu[0] * at.drag[1])]


def tangent(model: Model, stages: Sequence[tuple[Matrix, Any]], d: Numbers,
            extra: Sequence[Numbers] = ()) -> tuple[Numbers, list[Numbers]]:
    """
    Return how x⁺ changes in a direction d of (x, u), and how the variables z of each stage do.

    Of each stage there are J and the slope of the cart's friction; extra are changes of its
    accelerations. After z stands the cart's speed. Shapes: d (2n + 3,).
    """
    p, Z = model.pendulum, list[Numbers]()

    def f(x: Numbers, u: Any) -> Numbers:
        _, th, v, w = Parts.of(p, x)
        stage = len(Z)
        J, drag = stages[stage]
        z = [*th, *w, u - drag * v]
        Z.append([*z, v])
        a = [dot(row, z) for row in J]
        if extra:
            a = [a_i + more for a_i, more in zip(a, extra[stage])]
        return [v, *w, *a]
    return model.integrator.step(f, d[:-1], d[-1], model.h), Z


def kept(n: int) -> int:
    """Return how many numbers a point has."""
    return len(flat(Point.read(n, range(10_000))))


@unrolled
def point_lane(model, x, u, points, stage, i):
    """Write the point of a stage at the state x in lane i, and return the accelerations there."""
    at = Point.of(model.pendulum, x, u)
    for row, number in enumerate(flat(at)):
        points[stage, row, i] = number
    return tuple(at.a)


@unrolled
def expand_lane(model, z, points, i):
    """Write the points of all stages of the step in lane i; see `expand`."""
    n, stages = len(model.pendulum.a), count()

    def f(x, u):
        return [*x[n + 1:], *called(point_lane, n + 1, model, tuple(x), u, points,
                                    next(stages), i)]
    model.integrator.step(f, [z[j, i] for j in range(2 * n + 2)], z[2 * n + 2, i], model.h)


@unrolled
def shapes(model):
    """Return how many stages a step has, and how many numbers a point and M."""
    n = len(model.pendulum.a)
    return model.integrator.stages, kept(n), len(curved_pairs(n))


@kernel
def lanes(model):
    """Return how many lanes the directions of (x, u) fill, the last ones with nothing."""
    return (size(model) + LANES) // LANES * LANES


@kernel
def blocks(U):
    """Return how many blocks the steps of U (T,) fill."""
    return (len(U) + STEPS - 1) // STEPS


@unrolled
def load_lane(like, X, U, t, z, i):
    """Copy the (x, u) of step t into lane i; `like` is a tuple as long as the state."""
    for j in range(len(like)):
        z[j, i] = X[t, j]
    z[len(like), i] = U[t]


@kernel
def load(like, X, U, first, z):
    """
    Copy the (x, u) of the STEPS steps from first on into lanes; past the end, the last ones again.

    A loop over all lanes is one of vectors alone. Shapes: like, a tuple (2n + 2,), X (T or more,
    2n + 2), U (T,), z (2n + 3, STEPS).
    """
    for i in range(STEPS):
        load_lane(like, X, U, min(first + i, len(U) - 1), z, i)


@kernel
def expand(model, X, U):
    """
    Return what the derivatives need at each step of a trajectory.

    Shapes: X (T or more, 2n + 2), U (T,) -> (blocks, stages, numbers of a point, STEPS).
    """
    stages, numbers, _ = shapes(model)
    points = np.empty((blocks(U), stages, numbers, STEPS))
    z = np.empty((size(model) + 1, STEPS))
    for block in range(len(points)):
        load(zeros(model), X, U, block * STEPS, z)
        of_block = points[block]
        for i in range(STEPS):
            expand_lane(model, z, of_block, i)
    return points


@unrolled
def jacobians(model, points, i):
    """Return J and the slope of the cart's friction of the stages of the step in lane i."""
    n = len(model.pendulum.a)
    read = [Point.read(n, [points[stage, row, i] for row in range(kept(n))])
            for stage in range(model.integrator.stages)]
    return tuple((tuple(map(tuple, at.J)), at.drag[0]) for at in read)


@unrolled
def stage_costates(model, J, costate, mu):
    """Write the gradient of λᵀ x⁺ by the accelerations at each stage, a stage a row."""
    n, stages = len(model.pendulum.a), range(model.integrator.stages)
    costate = [costate[j] for j in range(2 * n + 2)]
    changes = [[costate[0].trace.symbol(f'change {stage} {i}') for i in range(n + 1)]
               for stage in stages]
    x, _ = tangent(model, J, [0.0] * (2 * n + 3), changes)
    for stage in stages:
        for i, slope in enumerate(gradient(dot(costate, x), changes[stage])):
            mu[stage, i] = slope


@unrolled
def curvature_of_stage(model, points, stage, i, mu, M):
    """Write M of a stage of the step in lane i; see second_derivatives."""
    n = len(model.pendulum.a)
    at = Point.read(n, [points[stage, row, i] for row in range(kept(n))])
    for place, number in enumerate(second_derivatives(
            model.pendulum, at, [mu[stage, j] for j in range(n + 1)])):
        M[stage, place] = number


@unrolled
def numbers_of(model, M):
    """Return M of all stages as single numbers."""
    places = range(len(curved_pairs(len(model.pendulum.a))))
    return tuple(tuple(M[stage, place] for place in places)
                 for stage in range(model.integrator.stages))


@unrolled
def tangent_lane(model, J, directions, F, m):
    """Write column m of F; see `linearise`."""
    x, _ = tangent(model, J, [directions[j, m] for j in range(2 * len(model.pendulum.a) + 3)])
    for j, x_j in enumerate(x):
        F[j, m] = x_j


@unrolled
def curvature_lane(model, J, M, directions, F, W, m):
    """Write column m of F, and of W: the gradient of Σ z'ᵀ M z by the direction of z'."""
    n, d = len(model.pendulum.a), [directions[j, m] for j in range(2 * len(model.pendulum.a) + 3)]
    x, Z = tangent(model, J, d)
    for j, x_j in enumerate(x):
        F[j, m] = x_j
    bent = []
    for of_stage, z in zip(M, Z):
        entry = dict(zip(curved_pairs(n), of_stage))
        for j, z_j in enumerate(z):
            slope = dot(*zip(*((entry[min(j, k), max(j, k)], z_k) for k, z_k in enumerate(z)
                               if (min(j, k), max(j, k)) in entry)))
            bent.append(fixed(slope) * z_j)
    for j, slope in enumerate(gradient(total(bent), d)):
        W[j, m] = slope


@kernel
def linearise(model, points, t, directions, F):
    """
    Write F = ∂f/∂(x, u) at step t of those that `expand` returned, column by column.

    Shapes: directions (2n + 3, lanes), the identity and zeros; F (2n + 2, lanes).
    """
    J = jacobians(model, points[t // STEPS], t % STEPS)
    for m in range(lanes(model)):
        tangent_lane(model, J, directions, F, m)


@kernel
def curvature(model, points, t, costate, directions, F, W):
    """
    Write F as `linearise` does, and W = Σ λᵢ ∂²fᵢ/∂(x, u)² for the costate λ.

    Shapes: costate (2n + 2,), W (2n + 3, lanes).
    """
    stages, _, curved = shapes(model)
    of_step, i = points[t // STEPS], t % STEPS
    mu, M = np.empty((stages, size(model) // 2)), np.empty((stages, curved))
    J = jacobians(model, of_step, i)
    stage_costates(model, J, costate, mu)
    for stage in range(stages):
        curvature_of_stage(model, of_step, stage, i, mu, M)
    numbers = numbers_of(model, M)
    for m in range(lanes(model)):
        curvature_lane(model, J, numbers, directions, F, W, m)


@kernel
def identity(directions):
    """Write the identity into zeros, as far as it goes: the directions of (x, u)."""
    for j in range(len(directions)):
        directions[j, j] = 1.0


@kernel
def linearisation(model, x, u):
    """Return A = ∂f/∂x (2n + 2, 2n + 2) and B = ∂f/∂u (2n + 2,)."""
    n = size(model)
    F, directions = np.empty((n, lanes(model))), np.zeros((n + 1, lanes(model)))
    identity(directions)
    linearise(model, expand(model, np.expand_dims(x, 0), np.array([u])), 0, directions, F)
    return F[:, :n].copy(), F[:, n].copy()
