# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The free numbers p of learned dynamics from experience.

    min_p  Σ_k |q̇⁺_k - f(x_k, u_k; p)|²_Σ + |p - p_0|²_Λ

f are the speeds after a transition, by the integrator from the measured state. Steps are those of
Levenberg and Marquardt. The variances Σ of the residuals are estimated in turns. Numbers are those
of the default bodies; see priors.py. Source: Bishop, Pattern Recognition and Machine Learning,
2006, 3.3.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import lsq_linear

from dp_swing_ros.dynamics.priors import Prior
from dp_swing_ros.kernels import kernel
from dp_swing_ros.learning.experience import Experience
from dp_swing_ros.pendulum.drive import follow_commands
from dp_swing_ros.pendulum.integrators import INTEGRATORS
from dp_swing_ros.pendulum.model import Model, size
from dp_swing_ros.pendulum.parameters import DIRECT
from dp_swing_ros.pendulum.state import Array

ROUNDS = 60           # steps at most
INSIDE = 1e-12        # of a bound: the solver begins between them
DIFFERENCE = 1e-6     # of a free number, in its deviations before any experience
SETTLED = 1e-3        # change of all numbers, in standard deviations, at which it ends
DAMPING, LARGEST_DAMPING = 1e-2, 1e8   # of a step, at first, and where it ends
FLOOR = 1e-4          # [m/s, rad/s] scaled, standard deviation of a residual at least
WILD = 1e8            # deviations of a residual, per deviation of a number before any experience
LONGEST_STEP = 0.025  # [s] scaled, of the integrator


class Precision(NamedTuple):
    """How sharp dry friction is, and in which steps it is integrated for that."""

    creep: float   # [m/s, rad/s]
    step: float    # [s]


# where things stick and slip, what is smooth would pass for inertia and gravity
FINE = Precision(0.02, 0.005)   # [m/s, rad/s] scaled, [s] likewise


def spread(e: Array) -> Array:
    """Return the standard deviations of residuals; shapes: (K, n + 1) -> (n + 1,)."""
    found: Array = np.sqrt(np.maximum(np.mean(e ** 2, axis=0), FLOOR ** 2))
    return found


@kernel
def follow(model, drive, X, U, h, steps, out):
    """
    Write the states after some transitions on end, from the state before each.

    Shapes: X (K, 2n + 2), U and h (K,), out (K - steps + 1, 2n + 2).
    """
    n = size(model)
    x, for_ever = np.empty(n), np.full(1, np.inf)
    for k in range(len(out)):
        for i in range(n):
            x[i] = X[k, i]
        for m in range(k, k + steps):
            follow_commands(model, drive, for_ever, U[m:m + 1], x, h[m])
        for i in range(n):
            out[k, i] = x[i]


def followed(dynamics: Any, seen: Experience, steps: int = 1,
             step: float = LONGEST_STEP) -> Array:
    """
    Return the states after so many transitions on end as dynamics have them, in steps [s].

    Those are to follow one another. Shapes: -> (K - steps + 1, 2n + 2).
    """
    out = np.empty((max(len(seen.U) - steps + 1, 0), seen.X.shape[1]))
    model = Model(dynamics, INTEGRATORS['rk4'], step)
    follow(model, DIRECT, seen.X, seen.U, seen.h, steps, out)
    return out


def predicted(dynamics: Any, seen: Experience, step: float = LONGEST_STEP) -> Array:
    """Return the speeds after each transition (K, n + 1) as dynamics have them, in steps [s]."""
    speeds: Array = followed(dynamics, seen, step=step)[:, seen.X.shape[1] // 2:]
    return speeds


def fitted(dynamics: Any, seen: Experience, prior: Prior,
           step: float = LONGEST_STEP,
           on_round: Callable[[Any], object] = lambda _: None) -> Array:
    """
    Return the free numbers (P,) of dynamics, sought from those that they have on.

    step is that of the integrator [s]. on_round is called with the dynamics after each step.
    Raises FloatingPointError where nothing finite is found.
    """
    half = seen.X.shape[1] // 2
    after = seen.Y[:, half:]

    def residuals(p: Array) -> Array:
        return after - predicted(dynamics.with_free(p), seen, step)

    def loss(e: Array, p: Array) -> float:
        found = np.sum((e / noise) ** 2) + np.sum(((p - prior.mean) / prior.deviations) ** 2)
        return float(found) if np.isfinite(found) else np.inf
    p, damping = np.maximum(dynamics.free, prior.lowest), DAMPING
    e = residuals(p)
    if not np.all(np.isfinite(e)):   # on new experience they may be wild
        p = prior.mean
        e = residuals(p)
    noise = spread(e)
    for _ in range(ROUNDS):
        A, b = normal_equations(dynamics, seen, prior, noise, p, e, step)
        before = loss(e, p)
        while damping < LARGEST_DAMPING:
            change = bounded_solution(A + damping * np.diag(np.diag(A)), b, prior.lowest - p)
            trial = np.maximum(p + change, prior.lowest)   # which rounding is not to pass
            of_trial = residuals(trial)
            if loss(of_trial, trial) < before:
                break
            damping *= 10
        else:
            break
        settled = change @ A @ change < SETTLED ** 2 * len(p)
        p, e, damping = trial, of_trial, damping / 10
        noise = spread(e)
        on_round(dynamics.with_free(p))
        if settled:
            break
    if not np.all(np.isfinite(e)):
        raise FloatingPointError('the fit of the dynamics is not finite')
    return p


def normal_equations(dynamics: Any, seen: Experience, prior: Prior, noise: Array, p: Array,
                     e: Array, step: float) -> tuple[Array, Array]:
    """
    Return A = Jᵀ Σ⁻¹ J + Λ⁻¹ (P, P) and b (P,) of a step A δ = b at p (P,).

    What a transition says of a number is left out where the slope is WILD: the dynamics are
    nearly singular there.
    """
    J = np.empty((e.size, len(p)))
    base = seen.Y[:, -e.shape[1]:] - e
    for i, deviation in enumerate(prior.deviations):
        moved = p.copy()
        moved[i] += DIFFERENCE * deviation
        J[:, i] = ((predicted(dynamics.with_free(moved), seen, step) - base)
                   / (DIFFERENCE * deviation * noise)).ravel()
    J[~(np.abs(J * prior.deviations) < WILD)] = 0.0   # infinite or not a number, too
    of_prior = prior.deviations ** -2
    return (J.T @ J + np.diag(of_prior),
            J.T @ (e / noise).ravel() + of_prior * (prior.mean - p))


def bounded_solution(A: Array, b: Array, lowest: Array) -> Array:
    """Return the δ ≥ lowest (P,) that minimises δᵀ A δ / 2 - bᵀ δ."""
    L = np.linalg.cholesky(A)
    found: Array = np.linalg.solve(A, b)
    if np.all(found >= lowest):
        return found
    bounded: Array = lsq_linear(L.T, solve_triangular(L, b, lower=True),
                                (np.minimum(lowest, -INSIDE), np.inf)).x
    return bounded
