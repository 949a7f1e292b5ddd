# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
CasADi on the default problem: multiple shooting, solved whole by IPOPT or by Fatrop.

    min Σ ℓ(x_t, u_t) + ℓ_f(x_N)   over x_0 ... x_N, u_0 ... u_{N-1}
    s.t.   x_{t+1} = f(x_t, u_t),   x_0 given,   |u_t| ≤ u_max

The same equations, the same RK4 step, cost, bounds and horizon. Both solvers take exact Hessians;
IPOPT has MUMPS for its linear systems, Fatrop a Riccati recursion, for which variables and
constraints stand stage by stage. None of their options for warm starts saves an iteration here,
without multipliers. Where there is a C compiler, the derivatives are C code that
CasADi writes, with one function a stage: ten times as fast as its own machine.

Sources: Wächter and Biegler, Mathematical Programming 106(1), 2006 (IPOPT); Vanroye et al.,
"FATROP: a fast constrained optimal control problem solver", IROS 2023.
"""

from collections.abc import Callable
import functools
from pathlib import Path
import shutil
import subprocess
import tempfile
from typing import Any, NamedTuple

import numpy as np

from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.problem import Problem

TOLERANCE = 1e-9     # of the solvers themselves, where the number of iterations ends a solve
OPTIONS: dict[str, dict[str, Any]] = {
    'ipopt': {'ipopt.print_level': 0, 'ipopt.sb': 'yes'},
    'fatrop': {'fatrop.print_level': 0, 'structure_detection': 'auto'}}
COMPILER = shutil.which('cc')
FLAGS = '-O2', '-march=native', '-shared', '-fPIC'


def functions(problem: Problem) -> tuple[Any, Any, Any]:
    """Return f(x, u), the running cost and the terminal cost as functions of CasADi."""
    import casadi as ca

    p, h, cost = problem.model.pendulum, problem.dt, problem.cost
    (a_1, a_2), ((b_11, b_12), (b_22,)) = p.a, p.b
    x, u, S = ca.SX.sym('x', 6), ca.SX.sym('u'), ca.DM(cost.S)

    def derivative(x: Any) -> Any:
        s_1, s_2, s_12 = ca.sin(x[1]), ca.sin(x[2]), ca.sin(x[1] - x[2])
        c_1, c_2, c_12 = ca.cos(x[1]), ca.cos(x[2]), ca.cos(x[1] - x[2])
        v, w_1, w_2 = x[3], x[4], x[5]
        D = ca.blockcat([[p.m, a_1 * c_1, a_2 * c_2],
                         [a_1 * c_1, b_11, b_12 * c_12],
                         [a_2 * c_2, b_12 * c_12, b_22]])
        slip = p.friction[2] * (w_1 - w_2)
        r = ca.vertcat(
            u - p.friction[0] * v + a_1 * s_1 * w_1 ** 2 + a_2 * s_2 * w_2 ** 2,
            p.g * a_1 * s_1 - b_12 * s_12 * w_2 ** 2 - p.friction[1] * w_1 - slip,
            p.g * a_2 * s_2 + b_12 * s_12 * w_1 ** 2 + slip)
        return ca.vertcat(x[3:], ca.solve(D, r))
    k_1 = derivative(x)
    k_2 = derivative(x + h / 2 * k_1)
    k_3 = derivative(x + h / 2 * k_2)
    k_4 = derivative(x + h * k_3)
    e = ca.vertcat(x[0], 2 * ca.sin(x[1] / 2), 2 * ca.sin(x[2] / 2), x[3:])
    margin = cost.w * ca.fmax(0, ca.fabs(x[0]) - cost.x_soft) ** 2
    return (ca.Function('f', [x, u], [x + h / 6 * (k_1 + 2 * k_2 + 2 * k_3 + k_4)]),
            ca.Function('l', [x, u], [ca.dot(S, e ** 2) + cost.R * u ** 2 + margin]),
            ca.Function('l_f', [x], [ca.bilin(cost.P, e, e) + margin]))


def compiled(solver: Any, folder: Path) -> str:
    """Let CasADi write a solver's functions as C code, compile it, and return the library."""
    import casadi as ca

    code = ca.CodeGenerator('program.c')
    for function in (solver.oracle(), *map(solver.get_function, solver.get_function())):
        code.add(function)
    code.generate(f'{folder}/')
    source, library = folder / 'program.c', folder / 'program.so'
    assert COMPILER is not None
    subprocess.run([COMPILER, *FLAGS, str(source), '-o', str(library)], check=True)
    return str(library)


class Guess(NamedTuple):
    """The state that a plan starts from, and the trajectory that a solver starts from."""

    x_0: Array   # (6,)
    X: Array     # (N + 1, 6)
    U: Array     # (N,) [N]


Solve = Callable[[], tuple[Array, Array]]      # returns states (N + 1, 6) and forces (N,)
Make = Callable[[Guess, int], Solve]           # from a guess, in so many iterations


class Program:
    """The problem as a nonlinear program for one of the solvers; the goal is upright."""

    def __init__(self, problem: Problem, solver: str, tolerance: float,
                 compiled: bool = True) -> None:
        """Write down variables and constraints, stage by stage, and compile them if possible."""
        import casadi as ca

        f, running, terminal = functions(problem)
        N = self.horizon = problem.horizon
        x_0 = ca.MX.sym('x_0', 6)
        states = [ca.MX.sym(f'x_{t}', 6) for t in range(N + 1)]
        forces = [ca.MX.sym(f'u_{t}') for t in range(N)]
        variables, constraints, J = [], [], terminal(states[N])
        for t in range(N):
            variables += [states[t], forces[t]]
            constraints.append(states[t + 1] - f(states[t], forces[t]))
            if t == 0:
                constraints.append(states[0] - x_0)
            J += running(states[t], forces[t])
        self.name, self.tolerance = solver, tolerance
        self.given: Any = {'x': ca.vertcat(*variables, states[N]), 'f': J,
                           'g': ca.vertcat(*constraints), 'p': x_0}
        # without a compiler, one graph of scalars is the fastest that CasADi's machine runs
        self.options = {'print_time': False, 'error_on_fail': False,
                        'expand': not (compiled and COMPILER)}
        if solver == 'fatrop':
            self.options['equality'] = [True] * (6 * (N + 1))
        self.upper = self.flat(np.full((N + 1, 6), np.inf), np.full(N, problem.u_max))
        if not self.options['expand']:
            self.given = self.compiled()
            del self.options['expand']   # nothing is left to expand

    def compiled(self) -> str:
        """Return the library of its own C code."""
        self.folder = tempfile.TemporaryDirectory()   # which lives as long as the program
        return compiled(self.solver(1), Path(self.folder.name))

    @functools.cache
    def solver(self, iterations: int) -> Any:
        """Return CasADi's solver, which stops after so many iterations at the latest."""
        import casadi as ca

        name = self.name
        return ca.nlpsol('solver', name, self.given, {
            **OPTIONS[name], **self.options,
            f'{name}.tol': self.tolerance, f'{name}.max_iter': iterations})

    def flat(self, X: Array, U: Array) -> Array:
        """Put a trajectory in the order of the variables."""
        return np.concatenate([np.column_stack([X[:-1], U]).ravel(), X[-1]])

    def solve(self, guess: Guess, iterations: int) -> tuple[Array, Array]:
        """Return states (N + 1, 6) and forces (N,)."""
        found = np.array(self.solver(iterations)(
            x0=self.flat(guess.X, guess.U), p=guess.x_0, lbx=-self.upper, ubx=self.upper, lbg=0,
            ubg=0)['x']).ravel()
        steps = found[:-6].reshape(self.horizon, 7)
        return np.vstack([steps[:, :6], found[-6:]]), steps[:, 6].copy()
