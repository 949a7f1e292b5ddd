# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a solver is, and where each of them starts."""

from typing import NamedTuple, Protocol, TypeAlias

import numpy as np

from dp_swing_ros.cost import trajectory_cost
from dp_swing_ros.dynamics.trajectory import rollout
from dp_swing_ros.plan import Plan
from dp_swing_ros.problem import policy_rollout, Problem, regulator_rollout
from dp_swing_ros.state import ANGLES, Array

Seed: TypeAlias = int | np.random.Generator   # of a solver: a number, or one that goes on


class Solver(Protocol):
    """
    Solves a problem from a state; holds no state of its own but a random generator.

    Built as SOLVERS[name](problem, parameters, seed), where parameters are a
    SOLVERS[name].Parameters with a field `iterations`, the most of them in one solve, and the
    same seed gives the same plans.
    """

    def solve(self, x_0: Array, warm_start: Plan | None, deadline: float) -> Plan:
        """
        Return the best plan found from x_0 until the deadline, never worse than the warm start.

        warm_start is followed as a policy from x_0; None stands for zero forces. The deadline is
        in seconds of time.perf_counter() and may be infinite; lateness is a status, no error.
        Shapes: x_0 (6,). Raises ValueError where x_0 is not finite.
        """


class Start(NamedTuple):
    """Where a solver starts: cost, states (N + 1, 6), forces (N,), gains (N, 6)."""

    J: float
    X: Array
    U: Array
    K: Array


def start(problem: Problem, x_0: Array, warm_start: Plan | None) -> Start:
    """
    Follow the warm start's policy from x_0, and the regulator where it ends; None is zero force.

    Raises ValueError where x_0 is not finite.
    """
    x_0 = np.asarray(x_0, dtype=float)
    if x_0.shape != (6,) or not np.all(np.isfinite(x_0)):
        raise ValueError(f'the state is {x_0}; expected six finite numbers')
    N = problem.horizon
    if warm_start is None:
        U = np.zeros(N)
        return started(problem, rollout(problem.model, x_0, U), U, np.zeros((N, 6)))
    turns = np.round((x_0[ANGLES] - warm_start.X[0, ANGLES]) / (2 * np.pi))
    X_old = warm_start.X + 2 * np.pi * np.concatenate(([0.0], turns, np.zeros(3)))
    K_old = warm_start.K[:N]
    X, U = policy_rollout(problem, x_0, X_old, warm_start.U[:N], K_old)
    K = np.tile(-problem.lqr.K, (N, 1))
    K[:len(K_old)] = K_old
    return started(problem, X, U, K)


def regulator_start(problem: Problem, x_0: Array) -> Start:
    """Follow the regulator from x_0."""
    K = np.tile(-problem.lqr.K, (problem.horizon, 1))
    U = regulator_rollout(problem, x_0)
    return started(problem, rollout(problem.model, x_0, U), U, K)


def started(problem: Problem, X: Array, U: Array, K: Array) -> Start:
    """Add the cost; infinite where the trajectory leaves the numbers."""
    J = trajectory_cost(problem.cost, X, U)
    return Start(J if np.isfinite(J) else np.inf, X, U, K)
