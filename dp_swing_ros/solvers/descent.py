# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
iLQR and DDP: expand, step, and regularise where a step does not help.

Source: the paper, II-C, (22)-(37), with the errata of docs/model.md.
"""

from dataclasses import dataclass, field
import time
from typing import Any, ClassVar

import numpy as np

from dp_swing_ros.kernels import kernel, now
from dp_swing_ros.parameters import parameter, Parameters
from dp_swing_ros.pendulum.derivatives import expand
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.plan import NO_TRIES, Plan, SolverStats, Status, Tries
from dp_swing_ros.problem.problem import follow_policy, kernel_arguments, Problem
from dp_swing_ros.solvers.riccati import backward, forward, HALVINGS, line_search
from dp_swing_ros.solvers.solver import Policy, policy_of, Seed

MU_FIRST = 1.0     # regularisation after a first failure
MU_FACTOR = 6.0
# The share of the second-order terms is cut where they made the expansion indefinite, and grows
# with every step that helps: see docs/model.md.
CUT, GROWTH, LEAST = 0.1, 1.5, 1e-3
ENDS = (Status.CONVERGED, Status.ITERATION_LIMIT, Status.DEADLINE, Status.STALLED, Status.FAILED)
CONVERGED, ITERATION_LIMIT, DEADLINE, STALLED, FAILED = range(len(ENDS))
PHASES = ('rollout', 'derivatives', 'backward', 'line_search')   # of a descent
ROLLOUT, DERIVATIVES, BACKWARD, LINE_SEARCH = range(len(PHASES))


@dataclass(frozen=True)
class DescentParameters(Parameters):
    """What ends a descent."""

    iterations: int = parameter(50, 'most backward passes in one tick', minimum=1, maximum=10000)
    tolerance: float = parameter(
        1e-4, 'converged when an iteration promises less than this share of the cost',
        minimum=0.0)
    largest_regularisation: float = parameter(
        1e8, 'give up when μ grows beyond this', minimum=MU_FIRST)


@dataclass
class Descent:
    """Lowers the cost of the warm start; deterministic, so it has no use for a seed."""

    Parameters: ClassVar[type[DescentParameters]] = DescentParameters
    share: ClassVar[float | None]   # of the second-order terms to begin with, None for none

    problem: Problem
    parameters: Any
    seed: Seed = 0
    policy: Policy | None = field(default=None, init=False)   # where the last solve began

    def solve(self, x_0: Array, warm_start: Plan | None, deadline: float) -> Plan:
        """Return a locally optimal plan; see Solver.solve."""
        began = time.perf_counter()
        problem, parameters = self.problem, self.parameters
        self.policy = policy_of(problem, x_0, warm_start)
        end, J, iterations, X, U, K, spent = descend(
            *kernel_arguments(problem), problem.horizon, *self.policy, self.share,
            parameters.iterations, parameters.tolerance, parameters.largest_regularisation,
            deadline - began)
        return Plan(X, U, K, problem.dt,
                    SolverStats(ENDS[end], J, iterations, time.perf_counter() - began,
                                dict(zip(PHASES, spent.tolist()))))

    def tries(self, count: int) -> Tries:
        """Return the steps of the first line search, with α for a weight; see ShowingSolver."""
        if self.policy is None:
            return NO_TRIES
        problem, given = self.problem, kernel_arguments(self.problem)
        model, cost, _, bounds = given
        _, X, U, K = follow_policy(*given, *self.policy, problem.horizon)
        points, k, X_new = expand(model, X, U), np.empty_like(U), np.empty_like(X)
        # where the second-order terms make the expansion indefinite, without them, as `descend`
        without = None if self.share is None else 0.0
        if not any(backward(model, cost, points, X, U, X[:0], bounds, 0.0, share, k, K)[0]
                   for share in (self.share, without)):
            return NO_TRIES
        steps = 0.5 ** np.arange(min(count, HALVINGS))
        tried = np.empty((len(steps), len(U)))
        for alpha, U_new in zip(steps, tried):
            forward(model, cost, X, U, X[:0], k, K, alpha, bounds, X_new, U_new)
        return Tries(tried, steps)


class ILQR(Descent):
    """Expands the dynamics to first order: without the tensor terms of the paper's (28)-(30)."""

    share = None


class DDP(Descent):
    """Expands the dynamics, and the cost, to second order."""

    share = 1.0


@kernel
def descend(model, cost, lqr_gain, bounds, horizon, x_0, X, U, K, first_share, iterations,
            tolerance, largest_mu, seconds):
    """
    Follow a policy from x_0 and lower its cost; one call, for each takes some microseconds.

    An iteration is one backward pass and, where that succeeds, one line search. Where the pass
    fails, a smaller share of the second-order terms is taken, and none in the end, as in iLQR,
    whose expansion is positive; where the search fails, μ is raised. Only a pass without μ shows
    that the descent has converged: μ shortens the step, and so what it promises.
    first_share is that of the second-order terms to begin with, see `backward`.
    Returns how it ended (of ENDS), the cost, the number of iterations, X, U and K, and the time
    that each of the PHASES took [s]; the derivatives of linearising are part of a backward pass.
    Shapes: as in follow_policy.
    """
    began, spent = now(), np.zeros(len(PHASES))
    J, X, U, K = follow_policy(model, cost, lqr_gain, bounds, x_0, X, U, K, horizon)
    spent[ROLLOUT] = now() - began
    points, moved = expand(model, X[:0], U[:0]), True   # and another trajectory than theirs
    X_new, U_new, K_new, k = np.empty_like(X), np.empty_like(U), np.empty_like(K), np.empty_like(U)
    mu, iteration, end, gaps = 0.0, 0, ITERATION_LIMIT, np.empty((0, len(x_0)))
    share = first_share
    while iteration < iterations:
        if now() - began > seconds:
            end = DEADLINE
            break
        iteration += 1
        then = now()
        if moved:
            points, moved = expand(model, X, U), False
        expanded = now()
        positive, slope, bend = backward(
            model, cost, points, X, U, gaps, bounds, mu, share, k, K_new)
        passed = now()
        spent[DERIVATIVES] += expanded - then
        spent[BACKWARD] += passed - expanded
        if first_share is not None:
            if not positive and share > 0:
                share = share * CUT if share > LEAST else 0.0
                continue
        if positive and mu == 0 and -slope <= tolerance * J:
            K, end = K_new, CONVERGED
            break
        J_new = line_search(model, cost, X, U, J, k, K_new, slope, bend, bounds,
                            X_new, U_new) if positive else np.inf
        spent[LINE_SEARCH] += now() - passed
        if J_new < J:
            moved = True
            J, X, X_new, U, U_new, K, K_new = J_new, X_new, X, U_new, U, K_new, K
            mu = mu / MU_FACTOR if mu > MU_FIRST else 0.0
            if first_share is not None:
                share = min(max(share * GROWTH, LEAST), 1.0)
            continue
        mu = max(mu * MU_FACTOR, MU_FIRST)
        if mu > largest_mu:
            end = STALLED
            break
    return end if np.isfinite(J) else FAILED, J, iteration, X, U, K, spent
