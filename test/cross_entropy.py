# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A solver that none of ours resembles: it does what the protocol says, and little more."""

from dataclasses import dataclass
import math
import time

import numpy as np

from dp_swing_ros.parameters import parameter, Parameters
from dp_swing_ros.problem.plan import Plan, SolverStats, Status
from dp_swing_ros.problem.problem import policy_rollout
from dp_swing_ros.solvers.solver import policy_of

SAMPLES, ELITE = 40, 8


@dataclass(frozen=True)
class CrossEntropyParameters(Parameters):
    """How often the distribution is fitted anew."""

    iterations: int = parameter(5, 'fits in one solve', minimum=1)


class CrossEntropy:
    """
    Fit a normal distribution of the forces to the cheapest of its samples, again and again.

    Source: Rubinstein and Kroese, The Cross-Entropy Method, 2004.
    """

    Parameters = CrossEntropyParameters

    def __init__(self, problem, parameters, seed=0):
        """Take the problem, and what ends a solve."""
        self.problem, self.parameters = problem, parameters
        self.random = np.random.default_rng(seed)

    def solve(self, x_0, warm_start, deadline):
        """Return the best plan found; see Solver.solve."""
        began, N, iteration = time.perf_counter(), self.problem.horizon, 0
        best = policy_rollout(self.problem, *policy_of(self.problem, x_0, warm_start))
        mean, deviation, no_gains = best.U, np.full(N, 5.0), np.zeros_like(best.K)
        status = Status.ITERATION_LIMIT
        while iteration < self.parameters.iterations and status is not Status.DEADLINE:
            if time.perf_counter() > deadline:
                status = Status.DEADLINE
                continue
            iteration += 1
            forces = self.random.normal(mean, deviation, (SAMPLES, N))
            found = sorted((policy_rollout(self.problem, best.X[0], best.X, U, no_gains)
                            for U in forces), key=lambda rollout: rollout.J)
            best = min(best, found[0], key=lambda rollout: rollout.J)
            elite = np.array([rollout.U for rollout in found[:ELITE]])
            mean, deviation = elite.mean(axis=0), elite.std(axis=0) + 0.1
        if not math.isfinite(best.J):
            status = Status.FAILED
        return Plan(best.X, best.U, best.K, self.problem.dt,
                    SolverStats(status, best.J, iteration, time.perf_counter() - began))
