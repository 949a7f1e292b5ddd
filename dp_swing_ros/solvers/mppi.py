# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
MPPI: draw force sequences about the best so far, follow each, average them by their costs.

    U ← Σ_k w_k V_k,    w_k ∝ exp(-(S_k - min S) / λ),    S_k = J(V_k) + λ Uᵀ Σ⁻¹ (V_k - U)

Source: the paper, I and III; Williams, Aldrich and Theodorou, "Model predictive path integral
control", Journal of Guidance, Control, and Dynamics 40(2), 2017. That is
config/textbook_mppi.yaml. The defaults go beyond it, each by a parameter: the samples are drawn
about a policy, their noise is correlated in time, and its sizes are spread over them; the cheapest
sample is a candidate beside the average. What would cost more is not taken.
"""

from dataclasses import dataclass
import time

import numpy as np

from dp_swing_ros.kernels import kernel
from dp_swing_ros.parameters import parameter, ParameterError
from dp_swing_ros.pendulum.derivatives import expand
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.plan import NO_TRIES, Plan, SolverStats, Status, Tries
from dp_swing_ros.problem.problem import follow_policy, kernel_arguments, Problem, Rollout
from dp_swing_ros.solvers.riccati import backward
from dp_swing_ros.solvers.samples import samples_of, SamplingParameters, tries_of
from dp_swing_ros.solvers.solver import generator, policy_of, Seed

F = np.float32
NEGLIGIBLE = F(60)   # weights below exp(-60) are none


@dataclass(frozen=True)
class MPPIParameters(SamplingParameters):
    """The samples and how they are weighted."""

    iterations: int = parameter(6, 'most updates in one solve', minimum=1, maximum=1000)
    temperature: float = parameter(
        0.1, 'λ of the weights, in the unit that temperature_scale says', minimum=1e-9)
    temperature_scale: str = parameter(
        'relative', 'relative: λ counts the distance from the best cost to the best tenth; '
        'fixed: λ as it is, as in the paper', choices=lambda: ['relative', 'fixed'])
    tolerance: float = parameter(
        1e-4, 'done when an update lowers the cost by less than this share', minimum=0.0)
    feedback: bool = parameter(
        True, 'draw samples about a policy, u = U + K (x - X) + noise, with the gains of one '
        'Riccati pass; false: about forces alone, as in the paper')
    elite: bool = parameter(
        True, 'the heaviest sample is a candidate beside the average')
    importance_sampling: bool = parameter(
        False, 'add λ Uᵀ Σ⁻¹ (V - U) to the cost of samples V about forces U, which is the '
        'information-theoretic update; needs feedback false')

    def __post_init__(self) -> None:
        """Check them; raises ParameterError."""
        super().__post_init__()
        if self.importance_sampling and self.feedback:
            raise ParameterError(
                'parameters mppi.importance_sampling and mppi.feedback are both true; expected '
                'one of them, for the former is defined for samples about forces')


@kernel
def opened(model, cost, lqr_gain, bounds, horizon, x_0, X, U, K, feedback):
    """Return the rollout of a policy, see follow_policy, with new gains."""
    best = follow_policy(model, cost, lqr_gain, bounds, x_0, X, U, K, horizon)
    set_gains(model, cost, bounds, best[1], best[2], feedback, best[3])
    return best


@kernel
def improved(model, cost, lqr_gain, bounds, J, X, U, K, others, feedback):
    """
    Return the cheapest of a rollout and those of other forces, with new gains.

    With feedback the regulator's rollout is among them; the paper's MPPI knows no regulator.
    Shapes: others (n, N), the rest as in Rollout.
    """
    best, N, none = (J, X, U, K), len(U), np.zeros_like(K)
    if feedback:
        regulator = follow_policy(model, cost, lqr_gain, bounds, X[0], X[:0], U[:0], K[:0], N)
        if regulator[0] < best[0]:
            best = regulator
    for i in range(len(others)):
        found = follow_policy(model, cost, lqr_gain, bounds, X[0], X, others[i], none, N)
        if found[0] < best[0]:
            best = found
    if best[0] < J:
        set_gains(model, cost, bounds, best[1], best[2], feedback, best[3])
    return best


@kernel
def set_gains(model, cost, bounds, X, U, feedback, K):
    """
    Write the gains of one Riccati pass about a trajectory, zeros where there is no such pass.

    A force on its bound does not follow the state; every other does, for MPPI takes no step k that
    could end on the bound.
    Shapes: X (N + 1, 2n + 2), U (N,), K (N, 2n + 2).
    """
    if feedback and backward(model, cost, expand(model, X, U), X, U, X[:0], bounds, 0.0,
                             None, np.empty(0), K)[0]:
        return
    K[:] = 0.0


def spread(J: Array) -> float:
    """Return the distance from the best cost to the best tenth. Shapes: J (K,)."""
    # not a number, where that is what most samples cost
    tenth = np.fmin(np.partition(J, len(J) // 10)[len(J) // 10], np.finfo(F).max)
    return max(float(tenth - np.fmin.reduce(J)), 1e-9)


def weights(J: Array, temperature: float) -> Array:
    """Return the weights exp(-(J - min J) / λ) of samples, which sum to one; J (K,) -> (K,)."""
    lowest = np.fmin.reduce(J)
    if not np.isfinite(lowest):
        return np.full_like(J, 1 / len(J))
    with np.errstate(over='ignore'):
        exponent = (lowest - J) / F(temperature)
    # what weighs nothing must be zero: arithmetic with denormal numbers takes a hundred times
    w = np.exp(np.fmax(exponent, -NEGLIGIBLE)) * (exponent > -NEGLIGIBLE)
    return w / np.sum(w)


def times_precision(U: Array, correlation: float) -> Array:
    """
    Return Σ⁻¹ U of a noise of unit variance and covariance ρ^|s - t|; U (N,) -> (N,).

    Of an AR(1) process the inverse has three diagonals.
    """
    neighbours = np.zeros_like(U)
    neighbours[1:] += U[:-1]
    neighbours[:-1] += U[1:]
    square = correlation ** 2
    found = (1 + square) * U - correlation * neighbours
    found[0] -= square * U[0]
    found[-1] -= square * U[-1]
    return found / (1 - square)


class MPPI:
    """The solver; its random generator is all the state that it holds."""

    Parameters = MPPIParameters

    def __init__(self, problem: Problem, parameters: MPPIParameters, seed: Seed = 0) -> None:
        """
        Take the problem, and make room for the samples.

        Raises ParameterError where the device is none of this machine, or torch is missing.
        """
        self.problem, self.parameters, self.random = problem, parameters, generator(seed)
        self.samples = samples_of(problem, parameters, 'mppi')
        self.w = np.empty(0, F)   # weights of the samples of the last update
        variance = parameters.sigma ** 2
        self.certainty = np.divide(1, variance, out=np.zeros_like(variance), where=variance > 0)

    def solve(self, x_0: Array, warm_start: Plan | None, deadline: float) -> Plan:
        """Return the cheapest of the warm start, averages and samples; see Solver.solve."""
        began = time.perf_counter()
        problem, parameters = self.problem, self.parameters
        given, feedback = kernel_arguments(problem), parameters.feedback
        self.w = np.empty(0, F)
        best = Rollout(*opened(*given, problem.horizon, *policy_of(problem, x_0, warm_start),
                               feedback))
        status, iteration = Status.COMPLETE, 0
        noise = rollouts = 0.0   # [s]
        while iteration < parameters.iterations:
            if time.perf_counter() > deadline:
                status = Status.DEADLINE
                break
            iteration += 1
            before, then = best.J, time.perf_counter()
            S = self.samples.draw(best, self.random)
            noise += self.samples.noise_time
            rollouts += time.perf_counter() - then - self.samples.noise_time
            best = Rollout(*improved(*given, *best, self.update(best, S), feedback))
            if before - best.J < parameters.tolerance * before:
                break
        if not np.isfinite(best.J):
            status = Status.FAILED
        solve_time = time.perf_counter() - began
        return Plan(best.X, best.U, best.K, problem.dt, SolverStats(
            status, best.J, iteration, solve_time,
            {'noise': noise, 'rollouts': rollouts, 'update': solve_time - noise - rollouts}))

    def tries(self, count: int) -> Tries:
        """Return samples of the last update, with their weights; see ShowingSolver."""
        return tries_of(self.samples, self.w, count) if len(self.w) else NO_TRIES

    def update(self, best: Rollout, S: Array) -> Array:
        """Return what samples about a rollout propose (1 or 2, N), by their costs S (K,)."""
        parameters = self.parameters
        temperature = parameters.temperature
        if parameters.temperature_scale == 'relative':
            temperature *= spread(S)
        if parameters.importance_sampling:
            S = S + F(temperature) * self.importance(best.U)
        self.w = weights(S, temperature)
        found: Array = self.samples.proposals(self.w)
        return found if parameters.elite else found[:1]

    def importance(self, U: Array) -> Array:
        """
        Return Uᵀ Σ⁻¹ (V - U) of all samples about forces, zero for one without noise.

        Σ is the covariance of the noise over time. Shapes: U (N,) -> (K,).
        """
        direction = times_precision(U, self.parameters.noise_correlation)
        return self.certainty * (self.samples.along(direction) - U @ direction)
