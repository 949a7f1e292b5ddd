# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
First and second derivatives of a step of the model.

Those of the accelerations at each stage, J = ∂a/∂z and M = Σ μ_i ∂²a_i/∂z², are in points.py. A
step is linear in all that its stages return, so it is differentiated by taking the same step
with each f replaced by its Jacobian; the costates of the stages are the gradient of that; and

    Σ λ_i ∂²f_i/∂(x, u)² = Σ_stages Z_iᵀ M_i Z_i,    Z_i = ∂z_i/∂(x, u)

What a point needs is computed for STEPS steps side by side in the lanes of a vector (`expand`),
and then, step by step, for all directions of (x, u) side by side (`linearise`, `curvature`).
"""

from collections.abc import Sequence
from itertools import count
from typing import Any

import numpy as np

from dp_swing_ros.kernels import kernel
from dp_swing_ros.kernels.symbols import called, dot, fixed, flat, gradient, total
from dp_swing_ros.kernels.unrolling import unrolled
from dp_swing_ros.pendulum.equations import Matrix, Numbers, Parts
from dp_swing_ros.pendulum.model import Dynamics, Model, size, zeros
from dp_swing_ros.pendulum.points import point_type

STEPS = 16     # side by side
LANES = 8      # of a vector; directions of (x, u) fill one or two


def tangent(model: Model, stages: Sequence[tuple[Matrix, Any]], d: Numbers,
            extra: Sequence[Numbers] = ()) -> tuple[Numbers, list[Numbers]]:
    """
    Return how x⁺ changes in a direction d of (x, u), and how the variables z of each stage do.

    Of each stage there are J and the slope of the cart's friction; extra are changes of its
    accelerations. Shapes: d (2n + 3,).
    """
    p, Z = model.pendulum, list[Numbers]()

    def f(x: Numbers, u: Any) -> Numbers:
        _, th, v, w = Parts.of(p, x)
        stage = len(Z)
        J, drag = stages[stage]
        z = [*th, *w, u - drag * v, v]
        Z.append(z)
        a = [dot(row, z) for row in J]   # a row is shorter where the cart's speed does nothing
        if extra:
            a = [a_i + more for a_i, more in zip(a, extra[stage])]
        return [v, *w, *a]
    return model.integrator.step(f, d[:-1], d[-1], model.h), Z


def kept(p: Dynamics) -> int:
    """Return how many numbers a point has."""
    return len(flat(point_type(p).read(p.links, range(10_000))))


@unrolled
def point_lane(model, x, u, points, stage, i):
    """Write the point of a stage at the state x in lane i, and return the accelerations there."""
    at = point_type(model.pendulum).of(model.pendulum, x, u)
    for row, number in enumerate(flat(at)):
        points[stage, row, i] = number
    return tuple(at.a)


@unrolled
def expand_lane(model, z, points, i):
    """Write the points of all stages of the step in lane i; see `expand`."""
    n, stages = model.pendulum.links, count()

    def f(x, u):
        return [*x[n + 1:], *called(point_lane, n + 1, model, tuple(x), u, points,
                                    next(stages), i)]
    model.integrator.step(f, [z[j, i] for j in range(2 * n + 2)], z[2 * n + 2, i], model.h)


@unrolled
def shapes(model):
    """Return how many stages a step has, and how many numbers a point and M."""
    p = model.pendulum
    return model.integrator.stages, kept(p), len(point_type(p).curved_pairs(p.links))


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


def read_point(model: Model, points: Any, stage: int, i: Any) -> Any:
    """Return the point of a stage of the step in lane i."""
    p = model.pendulum
    return point_type(p).read(p.links, [points[stage, row, i] for row in range(kept(p))])


@unrolled
def jacobians(model, points, i):
    """Return J and the slope of the cart's friction of the stages of the step in lane i."""
    read = [read_point(model, points, stage, i) for stage in range(model.integrator.stages)]
    return tuple((tuple(map(tuple, at.J)), at.drag[0]) for at in read)


@unrolled
def stage_costates(model, J, costate, mu):
    """Write the gradient of λᵀ x⁺ by the accelerations at each stage, a stage a row."""
    n, stages = model.pendulum.links, range(model.integrator.stages)
    costate = [costate[j] for j in range(2 * n + 2)]
    changes = [[costate[0].trace.symbol(f'change {stage} {i}') for i in range(n + 1)]
               for stage in stages]
    x, _ = tangent(model, J, [0.0] * (2 * n + 3), changes)
    for stage in stages:
        for i, slope in enumerate(gradient(dot(costate, x), changes[stage])):
            mu[stage, i] = slope


@unrolled
def curvature_of_stage(model, points, stage, i, mu, M):
    """Write M of a stage of the step in lane i."""
    p = model.pendulum
    at = read_point(model, points, stage, i)
    for place, number in enumerate(at.second_derivatives(
            p, [mu[stage, j] for j in range(p.links + 1)])):
        M[stage, place] = number


@unrolled
def numbers_of(model, M):
    """Return M of all stages as single numbers."""
    p = model.pendulum
    places = range(len(point_type(p).curved_pairs(p.links)))
    return tuple(tuple(M[stage, place] for place in places)
                 for stage in range(model.integrator.stages))


@unrolled
def tangent_lane(model, J, directions, F, m):
    """Write column m of F; see `linearise`."""
    x, _ = tangent(model, J, [directions[j, m] for j in range(2 * model.pendulum.links + 3)])
    for j, x_j in enumerate(x):
        F[j, m] = x_j


@unrolled
def curvature_lane(model, J, M, directions, F, W, m):
    """Write column m of F, and of W: the gradient of Σ z'ᵀ M z by the direction of z'."""
    p = model.pendulum
    d = [directions[j, m] for j in range(2 * p.links + 3)]
    x, Z = tangent(model, J, d)
    for j, x_j in enumerate(x):
        F[j, m] = x_j
    bent = []
    for of_stage, z in zip(M, Z):
        entry = dict(zip(point_type(p).curved_pairs(p.links), of_stage))
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
