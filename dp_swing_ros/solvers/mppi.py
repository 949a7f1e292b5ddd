# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
MPPI: draw force sequences about the best so far, follow each, average them by their costs.

    U ← Σ_k w_k V_k,    w_k ∝ exp(-(J(V_k) - min J) / λ)

Source: the paper, I and III; Williams, Aldrich and Theodorou, "Model predictive path integral
control", Journal of Guidance, Control, and Dynamics 40(2), 2017. Beyond the paper: the samples are
drawn about a policy, their noise is correlated in time, and its sizes are spread over them.
"""

from dataclasses import dataclass
import time
from typing import Any

import numpy as np

from dp_swing_ros.kernels import kernel
from dp_swing_ros.parameters import parameter, ParameterError, Parameters
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.plan import Plan, SolverStats, Status
from dp_swing_ros.problem.problem import follow_policy, kernel_arguments, Problem, Rollout
from dp_swing_ros.solvers.riccati import backward
from dp_swing_ros.solvers.samples import Samples
from dp_swing_ros.solvers.solver import generator, policy_of, Seed

F = np.float32
NEGLIGIBLE = F(60)   # weights below exp(-60) are none


@dataclass(frozen=True)
class MPPIParameters(Parameters):
    """The samples and how they are weighted."""

    samples: int = parameter(512, 'force sequences drawn in an update, K', minimum=2,
                             maximum=1_000_000)
    iterations: int = parameter(6, 'most updates in one solve', minimum=1, maximum=1000)
    temperature: float = parameter(
        0.1, 'λ of the weights, in the unit that temperature_scale says', minimum=1e-9)
    temperature_scale: str = parameter(
        'relative', 'relative: λ counts the distance from the best cost to the best tenth; '
        'fixed: λ as it is, as in the paper', choices=lambda: ['relative', 'fixed'])
    tolerance: float = parameter(
        1e-4, 'converged when an update lowers the cost by less than this share', minimum=0.0)
    smallest_noise: float = parameter(
        0.5, 'standard deviation of the quietest samples', unit='N', minimum=1e-3)
    largest_noise: float = parameter(
        40.0, 'standard deviation of the loudest samples', unit='N', minimum=1e-3)
    noise_correlation: float = parameter(
        0.8, 'correlation of the noise from step to step; 0 is white, as in the paper',
        minimum=0.0, maximum=0.999)
    feedback: bool = parameter(
        True, 'draw samples about a policy, u = U + K (x - X) + noise, with the gains of one '
        'Riccati pass; false: about forces alone, as in the paper')
    threads: int = parameter(
        1, 'threads that follow the samples; a second one pays from some 2,000 samples on, where '
        'there is a core for it. Another number draws other samples', minimum=1, maximum=256)
    device: str = parameter(
        'cpu', 'where samples are followed. cpu: here, by Numba; cuda: an NVIDIA GPU, by '
        "torch; torch: the GPU's program on the CPU, to test it",
        choices=lambda: ['cpu', 'cuda', 'torch'])


def sizes(parameters: MPPIParameters) -> Array:
    """Return the sizes of the noise (samples,), none for the policy itself."""
    spread = np.geomspace(parameters.smallest_noise, parameters.largest_noise,
                          parameters.samples - 1)
    return np.append(0.0, spread).astype(F)


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
        if regulator[0] < J:
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
    if feedback and backward(model, cost, X, U, X[:0], bounds, 0.0, None,
                             np.empty(0), K)[0]:
        return
    K[:] = 0.0


def weights(J: Array, temperature: float, relative: bool) -> Array:
    """
    Return the weights exp(-(J - min J) / λ) of samples, which sum to one.

    A relative λ counts the distance from the best cost to the best tenth. Shapes: J (K,) -> (K,).
    """
    lowest = np.fmin.reduce(J)
    if not np.isfinite(lowest):
        return np.full_like(J, 1 / len(J))
    if relative:
        # not a number, where that is what most samples cost
        tenth = np.fmin(np.partition(J, len(J) // 10)[len(J) // 10], np.finfo(F).max)
        temperature *= max(float(tenth - lowest), 1e-9)
    with np.errstate(over='ignore'):
        exponent = (lowest - J) / F(temperature)
    # what weighs nothing must be zero: arithmetic with denormal numbers takes a hundred times
    w = np.exp(np.fmax(exponent, -NEGLIGIBLE)) * (exponent > -NEGLIGIBLE)
    return w / np.sum(w)


class MPPI:
    """The solver; its random generator is all the state that it holds."""

    Parameters = MPPIParameters

    def __init__(self, problem: Problem, parameters: MPPIParameters, seed: Seed = 0) -> None:
        """
        Take the problem, and spread the sizes of the noise.

        Raises ParameterError where the device is none of this machine, or torch is missing.
        """
        self.problem, self.parameters, self.random = problem, parameters, generator(seed)
        given = problem, sizes(parameters), parameters.noise_correlation
        if parameters.device == 'cpu':
            self.samples: Any = Samples(*given, parameters.threads)
            return
        try:   # torch takes seconds to import, and only this needs it
            from dp_swing_ros.solvers.device import DeviceSamples
        except ModuleNotFoundError:
            raise ParameterError(
                f'parameter mppi.device is {parameters.device!r}, but torch is not installed; pip '
                'install torch, for cuda a CUDA build of it, or choose mppi.device cpu') from None
        self.samples = DeviceSamples(*given, parameters.device)

    def solve(self, x_0: Array, warm_start: Plan | None, deadline: float) -> Plan:
        """Return the cheapest of the warm start, averages and samples; see Solver.solve."""
        began = time.perf_counter()
        problem, parameters = self.problem, self.parameters
        given, feedback = kernel_arguments(problem), parameters.feedback
        best = Rollout(*opened(*given, problem.horizon, *policy_of(problem, x_0, warm_start),
                               feedback))
        status, iteration = Status.COMPLETE, 0
        while iteration < parameters.iterations:
            if time.perf_counter() > deadline:
                status = Status.DEADLINE
                break
            iteration += 1
            before = best.J
            w = weights(self.samples.draw(best, self.random), parameters.temperature,
                        parameters.temperature_scale == 'relative')
            best = Rollout(*improved(*given, *best, self.samples.proposals(w), feedback))
            if before - best.J < parameters.tolerance * before:
                status = Status.CONVERGED
                break
        if not np.isfinite(best.J):
            status = Status.FAILED
        return Plan(best.X, best.U, best.K, problem.dt,
                    SolverStats(status, best.J, iteration, time.perf_counter() - began))
