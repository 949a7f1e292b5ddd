# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The loop that iLQR and DDP share: expand, step, and regularise where a step does not help."""

from dataclasses import dataclass
import time

import numpy as np

from dp_swing_ros.parameters import parameter, Parameters
from dp_swing_ros.plan import Plan, SolverStats, Status
from dp_swing_ros.problem import Problem
from dp_swing_ros.solvers.riccati import backward, line_search
from dp_swing_ros.solvers.solver import start
from dp_swing_ros.state import Array

MU_FIRST = 1e-3   # regularisation after a first failure
MU_FACTOR = 6.0


@dataclass(frozen=True)
class DescentParameters(Parameters):
    """What ends a descent."""

    iterations: int = parameter(50, 'most backward passes in one tick', minimum=1, maximum=10000)
    tolerance: float = parameter(
        1e-4, 'converged when an iteration promises less than this share of the cost',
        minimum=0.0)
    largest_regularisation: float = parameter(
        1e8, 'give up when μ grows beyond this', minimum=MU_FIRST)


def descend(problem: Problem, parameters: DescentParameters, second_order: bool, x_0: Array,
            warm_start: Plan | None, deadline: float) -> Plan:
    """
    Lower the cost of the warm start by iLQR, or with second_order by DDP.

    An iteration is one backward pass and, where that succeeds, one line search. A failure of
    either raises μ, so the loop always ends; and as long as μ is up, the tensor terms, which made
    the expansion indefinite, are left out. Shapes and errors: as Solver.solve.
    """
    began = time.perf_counter()
    model, cost, u_max = problem.model, problem.cost, problem.u_max
    J, X, U, K = start(problem, x_0, warm_start)
    X_new, U_new, K_new, k = np.empty_like(X), np.empty_like(U), np.empty_like(K), np.empty_like(U)
    gaps = np.zeros((len(U), 6))
    mu, iteration, status = 0.0, 0, Status.ITERATION_LIMIT
    while iteration < parameters.iterations:
        if time.perf_counter() > deadline:
            status = Status.DEADLINE
            break
        iteration += 1
        positive, slope, bend = backward(model, cost, X, U, gaps, u_max, mu,
                                         second_order and mu == 0, k, K_new)
        if positive and -slope <= parameters.tolerance * J:
            K, status = K_new, Status.CONVERGED
            break
        J_new = line_search(model, cost, X, U, J, gaps, k, K_new, slope, bend, u_max,
                            X_new, U_new) if positive else np.inf
        if J_new < J:
            J, X, X_new, U, U_new, K, K_new = J_new, X_new, X, U_new, U, K_new, K
            mu = mu / MU_FACTOR if mu > MU_FIRST else 0.0
            continue
        mu = max(mu * MU_FACTOR, MU_FIRST)
        if mu > parameters.largest_regularisation:
            status = Status.STALLED
            break
    if not np.isfinite(J):
        status = Status.FAILED
    return Plan(X, U, K, problem.dt,
                SolverStats(status, J, iteration, time.perf_counter() - began))
