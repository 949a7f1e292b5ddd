# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The real-time iteration: one quadratic program a tick, about the plan of the tick before.

    min Σ ½ δzᵀ H δz + gᵀ δz   s.t.   δx⁺ = A δx + B δu,   u_min ≤ u + δu ≤ u_max

acados expands the problem about a trajectory, and HPIPM solves that. The solution is a step, which
is halved until the cost falls. As nothing unstable can be predicted from forces alone, they are
followed with feedback, the gains of the linear-quadratic regulator about the trajectory.
Source: Diehl, Bock and Schlöder, "A real-time iteration scheme for nonlinear optimization in
optimal feedback control", SIAM Journal on Control and Optimization 43, 2005.
"""

from dataclasses import dataclass
import math
import time

from acados_rti.library import Acados
import numpy as np

from dp_swing_ros.parameters import parameter, Parameters
from dp_swing_ros.pendulum.derivatives import expand
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.plan import Plan, SolverStats, Status
from dp_swing_ros.problem.problem import policy_rollout, Problem, Rollout
from dp_swing_ros.solvers.riccati import backward
from dp_swing_ros.solvers.solver import policy_of, Seed


@dataclass(frozen=True)
class AcadosRTIParameters(Parameters):
    """How many quadratic programs, and how a step is taken."""

    iterations: int = parameter(
        1, 'most quadratic programs in one solve; one is the real-time iteration, more are SQP',
        minimum=1, maximum=10000)
    tolerance: float = parameter(
        1e-4, 'converged when a whole step changes the cost by less than this share', minimum=0.0)
    halvings: int = parameter(
        6, 'most halvings of a step that does not lower the cost', minimum=0, maximum=50)
    blocks: int = parameter(
        5, 'stages to which the horizon is condensed, if it has more', minimum=1, maximum=1000)


class AcadosRTI:
    """Holds a solver of acados, which starts anew in each solve; it has no use for a seed."""

    Parameters = AcadosRTIParameters

    def __init__(self, problem: Problem, parameters: AcadosRTIParameters, seed: Seed = 0) -> None:
        """
        Take the problem; the first of its structure is compiled.

        Raises ParameterError where acados or a C compiler is missing.
        """
        self.problem, self.parameters = problem, parameters
        self.acados = Acados(problem, parameters.blocks)

    def solve(self, x_0: Array, warm_start: Plan | None, deadline: float) -> Plan:
        """Return the warm start, or what iterations make of it; see Solver.solve."""
        began = time.perf_counter()
        problem = self.problem
        best = policy_rollout(problem, *policy_of(problem, x_0, warm_start))
        status = Status.ITERATION_LIMIT if math.isfinite(best.J) else Status.FAILED
        iteration = 0
        while status is Status.ITERATION_LIMIT and iteration < self.parameters.iterations:
            if time.perf_counter() > deadline:
                status = Status.DEADLINE
                break
            iteration += 1
            best, status = self.iterate(best)
        return Plan(best.X, best.U, best.K, problem.dt,
                    SolverStats(status, best.J, iteration, time.perf_counter() - began))

    def iterate(self, best: Rollout) -> tuple[Rollout, Status]:
        """Return a cheaper trajectory if a step leads to one, and the status after it."""
        problem, parameters = self.problem, self.parameters
        X, U = best.X.copy(), best.U.copy()
        self.acados.iterate(X, U)
        dX, dU, K = X - best.X, U - best.U, gains(problem, best)
        for halving in range(parameters.halvings + 1):
            alpha = 0.5 ** halving
            found = policy_rollout(problem, best.X[0], best.X + alpha * dX, best.U + alpha * dU, K)
            cheaper = found.J < best.J
            if alpha == 1 and abs(found.J - best.J) <= parameters.tolerance * best.J:
                return found if cheaper else best, Status.CONVERGED
            if cheaper:
                return found, Status.ITERATION_LIMIT
        return best, Status.STALLED


def gains(problem: Problem, about: Rollout) -> Array:
    """Return the gains (N, 2n + 2) of the regulator about a trajectory; acados hands out none."""
    X, U, K = about.X, about.U, np.empty_like(about.K)
    backward(problem.model, problem.cost, expand(problem.model, X, U), X, U, X[:0], problem.bounds,
             0.0, None, U[:0].copy(), K)
    return K
