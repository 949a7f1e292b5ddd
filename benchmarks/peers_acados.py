# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
acados on the same problems, number for number: its SQP, and an iteration of it alone.

The code is that of examples/acados_rti: our own step, cost and bounds, written in C by CasADi,
with Gauss-Newton's Hessian. What an iteration costs in Python, the copies of a trajectory, is
some microseconds. Settings, each tried for the fastest that ends at the same cost to 1e-12:

* HPIPM, STEPS of the horizon condensed to a stage, in its mode for speed; a real-time iteration in
  the faster one that computes no residuals, which SQP does not converge with.
* tolerances and warm starts of the quadratic programs as acados has them: others save nothing.
* SQP with a merit function, the steps of the multipliers whole and those of the trajectory halved
  to a hundredth at most: acados's examples/acados_python/linear_mass_model/
  linear_mass_test_problem.py.

The DDP and the newer globalisations of acados are not in the wheel that pip has.

Sources: Verschueren et al., "acados: a modular open-source framework for fast embedded optimal
control", Mathematical Programming Computation 14, 2022; Frison and Diehl, "HPIPM: a
high-performance quadratic programming framework for model predictive control", IFAC World
Congress 2020.
"""

import ctypes
import math
from typing import Any

from acados_rti.library import Acados, acados
from peers_casadi import Guess, Make, TOLERANCE
from peers_gradient import first_plan, ITERATIONS
from timing import Work

from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.problem import Problem

STEPS = 6    # that are condensed to a stage
MOST = 500   # iterations, for which it has memory
RTI = {'nlp_solver_type': 'SQP_RTI', 'hpipm_mode': 'SPEED_ABS', 'qp_solver_ric_alg': 0}
SQP = {'nlp_solver_type': 'SQP', 'hpipm_mode': 'SPEED', 'globalization': 'MERIT_BACKTRACKING',
       'alpha_min': 0.01, 'full_step_dual': 1, 'nlp_solver_max_iter': MOST}


def blocks(ours: Problem) -> int:
    """Return how many stages HPIPM has."""
    return ours.horizon // STEPS


class Descent:
    """acados's SQP for a problem."""

    def __init__(self, ours: Problem, tolerance: float) -> None:
        """Take the problem; the first of its structure is compiled."""
        self.acados = Acados(ours, blocks(ours), {**SQP, **{
            f'nlp_solver_tol_{of}': tolerance for of in ('stat', 'eq', 'ineq', 'comp')}})
        self.of_acados = ctypes.CDLL(f'{acados().LIB_DIR}/libacados.so')

    def part(self, name: str) -> Any:
        """Return one of the structures that acados's own functions take."""
        get = getattr(self.acados.code, f'pendulum_acados_get_nlp_{name}')
        get.restype, get.argtypes = ctypes.c_void_p, (ctypes.c_void_p,)
        return ctypes.c_void_p(get(self.acados.memory))

    def limit(self, iterations: int) -> None:
        """Stop after so many iterations."""
        self.of_acados.ocp_nlp_solver_opts_set(
            self.part('config'), self.part('opts'), b'max_iter',
            ctypes.byref(ctypes.c_int(iterations)))

    def solve(self, X: Array, U: Array) -> int:
        """Replace a trajectory, and return the number of iterations."""
        self.acados.code.pendulum_acados_reset(ctypes.c_void_p(self.acados.memory), 1)
        self.acados.iterate(X, U)
        done = ctypes.c_int()
        self.of_acados.ocp_nlp_get(self.part('config'), self.part('solver'), b'sqp_iter',
                                   ctypes.byref(done))
        return done.value

    def trajectory(self, guess: Guess, iterations: int) -> tuple[Array, Array]:
        """Return states and forces of a whole solve."""
        X, U = guess.X.copy(), guess.U.copy()
        self.limit(iterations)
        self.solve(X, U)
        return X, U


def iterations(ours: Problem) -> Work:
    """Return real-time iterations, as many as there are of ours; its units are iterations."""
    one, plan = Acados(ours, blocks(ours), RTI), first_plan(ours)

    def run() -> int:
        X, U = plan.X.copy(), plan.U.copy()
        for _ in range(ITERATIONS):
            one.iterate(X, U)
        return ITERATIONS
    return run


def descent(ours: Problem) -> Work:
    """Return SQP in as many iterations; its units are iterations."""
    sqp, plan = Descent(ours, TOLERANCE), first_plan(ours)
    sqp.limit(ITERATIONS)
    return lambda: sqp.solve(plan.X.copy(), plan.U.copy())


def descents(ours: Problem) -> dict[str, Work]:
    """Return what is timed, with a bound; their units are iterations."""
    if not math.isfinite(ours.u_max):
        return {}
    return {'acados SQP': descent(ours), 'acados RTI': iterations(ours)}


def solves(ours: Problem, tolerance: float) -> Make:
    """Return whole solves of SQP; see `peers_solvers`."""
    sqp = Descent(ours, tolerance)
    return lambda guess, count: lambda: sqp.trajectory(guess, count)


SOLVES = {'acados SQP': solves}
