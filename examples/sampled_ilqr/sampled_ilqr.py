# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
iLQR from several starts: the warm start, then the cheapest of many samples about the best so far.

Samples find what lies beyond a hill, and descents its bottom. An iteration is one short descent.
"""

from dataclasses import dataclass
import math
import time

import numpy as np

from dp_swing_ros.parameters import parameter
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.plan import NO_TRIES, Plan, SolverStats, Status, Tries
from dp_swing_ros.problem.problem import kernel_arguments, Problem, Rollout
from dp_swing_ros.solvers.descent import descend, DescentParameters
from dp_swing_ros.solvers.samples import samples_of, SamplingParameters, tries_of
from dp_swing_ros.solvers.solver import generator, Policy, policy_of, Seed


@dataclass(frozen=True)
class SampledILQRParameters(SamplingParameters):
    """The samples, and the descents from the cheapest of them."""

    iterations: int = parameter(
        7, 'most descents in one solve, the first from the warm start', minimum=1, maximum=1000)
    scouts: int = parameter(
        3, 'descents from samples that were drawn at once, the cheapest first', minimum=1,
        maximum=100)
    passes: int = parameter(
        10, 'most backward passes in one descent', minimum=1, maximum=1000)
    tolerance: float = parameter(
        1e-4, 'done when the descents from one draw lower the cost by less than this share; ends '
        'a descent that promises less', minimum=0.0)


class SampledILQR:
    """The solver; its random generator is all the state that it holds."""

    Parameters = SampledILQRParameters

    def __init__(self, problem: Problem, parameters: SampledILQRParameters,
                 seed: Seed = 0) -> None:
        """
        Take the problem, and make room for the samples.

        Raises ParameterError where the device is none of this machine, or torch is missing.
        """
        self.problem, self.parameters, self.random = problem, parameters, generator(seed)
        self.samples = samples_of(problem, parameters, 'sampled_ilqr')
        self.chosen = np.empty(0, int)   # which samples of the last draw it descends from
        self.noise_time = self.rollout_time = 0.0   # [s] of a solve

    def solve(self, x_0: Array, warm_start: Plan | None, deadline: float) -> Plan:
        """Return the cheapest plan of all descents; see Solver.solve."""
        began = time.perf_counter()
        parameters = self.parameters
        self.chosen, self.noise_time, self.rollout_time = self.chosen[:0], 0.0, 0.0
        starts, before = [policy_of(self.problem, x_0, warm_start)], math.inf
        best = self.descend(starts[0], 0)
        status, iteration = Status.COMPLETE, 0
        while iteration < parameters.iterations:
            if time.perf_counter() > deadline:
                status = Status.DEADLINE
                break
            if not starts:
                if not before - best.J >= parameters.tolerance * best.J:
                    break
                before, starts = best.J, self.scouts(best)
            iteration += 1
            best = min(best, self.descend(starts.pop(0), parameters.passes),
                       key=lambda found: found.J if np.isfinite(found.J) else math.inf)
        if not np.isfinite(best.J):
            status = Status.FAILED
        solve_time, drawn = time.perf_counter() - began, self.noise_time + self.rollout_time
        return Plan(best.X, best.U, best.K, self.problem.dt, SolverStats(
            status, best.J, iteration, solve_time,
            {'noise': self.noise_time, 'rollouts': self.rollout_time,
             'descents': solve_time - drawn}))

    def tries(self, count: int) -> Tries:
        """Return samples of the last draw, 1 for one that it descended from; see ShowingSolver."""
        if not len(self.chosen):
            return NO_TRIES
        w = np.zeros(self.parameters.samples)
        w[self.chosen] = 1.0
        return tries_of(self.samples, w, count)

    def descend(self, policy: Policy, passes: int) -> Rollout:
        """Follow a policy, and descend from there."""
        # too short for a deadline of its own, so that a solve that was cut short can be repeated
        _, J, _, X, U, K, _ = descend(
            *kernel_arguments(self.problem), self.problem.horizon, *policy, None, passes,
            self.parameters.tolerance, DescentParameters().largest_regularisation, math.inf)
        return Rollout(J, X, U, K)

    def scouts(self, best: Rollout) -> list[Policy]:
        """Draw samples about a rollout; return the cheapest as starts, the cheapest first."""
        began = time.perf_counter()
        J = self.samples.draw(best, self.random)
        self.noise_time += self.samples.noise_time
        self.rollout_time += time.perf_counter() - began - self.samples.noise_time
        self.chosen = np.argsort(J, kind='stable')[:self.parameters.scouts]
        none = np.zeros_like(best.K)
        return [Policy(best.X[0], best.X, self.samples.forces(int(index)), none)
                for index in self.chosen]
