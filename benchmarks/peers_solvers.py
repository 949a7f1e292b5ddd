# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
CasADi on the default problem: multiple shooting, solved whole by IPOPT or by Fatrop.

The same equations, the same RK4 step, cost, bounds and horizon; the variables are the states and
the forces. IPOPT takes exact Hessians of the expanded graph, and MUMPS; Fatrop knows the structure
in time, so the variables and constraints stand stage by stage.

From one guess they end in different optima, so what is timed is the way to the same cost: each
contender stops after the fewest iterations that bring it within 1 % of the cost that all reach,
the largest of those they end at. Of a peer's iterate the forces count, followed by the model.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from timing import Work

from dp_swing_ros import configuration
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.pendulum.state import Array, hanging
from dp_swing_ros.problem.cost import trajectory_cost
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.problem.problem import plan_of, Problem
from dp_swing_ros.solvers import SOLVERS

TOLERANCE = 1e-4     # of our solvers' default, and of theirs
ITERATIONS = 500
CLOSE = 1.01          # times the cost that all reach
DISTURBANCE = (0.001, 0.001, -0.001, 0.01, 0.01, 0.01)   # of the warm-started solve's state
OPTIONS = {
    'ipopt': {'ipopt.print_level': 0, 'ipopt.sb': 'yes', 'ipopt.tol': TOLERANCE},
    'fatrop': {'fatrop.print_level': 0, 'fatrop.tol': TOLERANCE, 'structure_detection': 'auto'}}
WARM = {'ipopt': {'ipopt.warm_start_init_point': 'yes', 'ipopt.mu_init': 1e-4,
                  'ipopt.warm_start_bound_push': 1e-6, 'ipopt.warm_start_mult_bound_push': 1e-6},
        'fatrop': {}}


class Guess(NamedTuple):
    """The state that a plan starts from, and the trajectory that a solver starts from."""

    x_0: Array
    X: Array
    U: Array


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


class Transcription:
    """The problem as a nonlinear program, and one solver of it; the goal is upright."""

    def __init__(self, problem: Problem, solver: str, warm: bool, iterations: int) -> None:
        """Write down variables and constraints, stage by stage."""
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
        g = ca.vertcat(*constraints)
        options = {**OPTIONS[solver], **(WARM[solver] if warm else {}), 'expand': True,
                   'print_time': False, 'error_on_fail': False,
                   f'{solver}.max_iter': iterations}
        if solver == 'fatrop':
            options['equality'] = [True] * g.numel()
        self.solver = ca.nlpsol('solver', solver, {
            'x': ca.vertcat(*variables, states[N]), 'f': J, 'g': g, 'p': x_0}, options)
        free = np.full((N + 1, 6), np.inf)
        self.upper = self.flat(free, np.full(N, problem.u_max))

    def flat(self, X: Array, U: Array) -> Array:
        """Put a trajectory in the order of the variables."""
        return np.concatenate([np.column_stack([X[:-1], U]).ravel(), X[-1]])

    def solve(self, guess: Guess) -> tuple[Array, Array]:
        """Return states and forces."""
        found = np.array(self.solver(
            x0=self.flat(guess.X, guess.U), p=guess.x_0, lbx=-self.upper, ubx=self.upper, lbg=0,
            ubg=0)['x']).ravel()
        pairs = found[:-6].reshape(self.horizon, 7)
        return np.vstack([pairs[:, :6], found[-6:]]), pairs[:, 6]


def guesses(problem: Problem) -> dict[str, Guess]:
    """Return a first solve from hanging, and a later one: a plan shifted, the state disturbed."""
    x_0, random = hanging(), np.random.default_rng(0).uniform(-10, 10, problem.horizon)
    first = Guess(x_0, rollout(problem.model, x_0, random), random)
    X, U = ours(problem, 'ilqr', first, ITERATIONS)()
    U = np.append(U[1:], 0.0)
    x_1 = X[1] + DISTURBANCE
    return {'first': first, 'warm': Guess(x_1, rollout(problem.model, X[1], U), U)}


Solve = Callable[[], tuple[Array, Array]]   # states and forces


def ours(problem: Problem, name: str, guess: Guess, iterations: int) -> Solve:
    """Return a solve of ours of so many iterations at most."""
    solver = SOLVERS[name](problem, SOLVERS[name].Parameters(
        iterations=iterations, tolerance=TOLERANCE))
    plan = plan_of(problem, guess.X, guess.U, Status.COMPLETE)

    def solve() -> tuple[Array, Array]:
        found = solver.solve(guess.x_0, plan, np.inf)
        return found.X, found.U
    return solve


def theirs(problem: Problem, name: str, guess: Guess, warm: bool, iterations: int) -> Solve:
    """Return a solve of CasADi of so many iterations at most."""
    transcription = Transcription(problem, name, warm, iterations)
    return lambda: transcription.solve(guess)


def contenders(problem: Problem, guess: Guess, warm: bool) -> dict[str, Callable[[int], Solve]]:
    """Return all contenders from a guess, each by the number of its iterations."""
    return {**{name: partial(ours, problem, name, guess) for name in ('ilqr', 'ddp')},
            **{f'casadi {name}': partial(theirs, problem, name, guess, warm)
               for name in OPTIONS}}


def solves() -> tuple[dict[str, Work], dict[str, dict[str, float]]]:
    """Return the solves of all contenders to the same cost, and their costs and iterations."""
    problem = configuration.problem({})
    works: dict[str, Work] = {}
    reached: dict[str, dict[str, float]] = {}
    for kind, guess in guesses(problem).items():
        makes = contenders(problem, guess, kind == 'warm')
        costs = {name: cost_of(problem, make(ITERATIONS)) for name, make in makes.items()}
        goal = CLOSE * max(costs.values())
        for name, make in makes.items():
            number = fewest(lambda count, by=make: cost_of(problem, by(count)) <= goal)
            works[f'{name}, {kind}'] = work(make(number))
            reached[f'{name}, {kind}'] = {'goal': goal, 'iterations': number,
                                          'end': costs[name]}
    return works, reached


def cost_of(problem: Problem, solve: Solve) -> float:
    """Return the cost of what is found; theirs are within the tolerance, so it is followed."""
    X, U = solve()
    return trajectory_cost(problem.cost, rollout(problem.model, X[0], U), U)


def fewest(reaches: Callable[[int], bool], most: int = ITERATIONS) -> int:
    """Return the fewest iterations that reach a goal, by bisection: more never undo it."""
    low, high = 0, most
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if reaches(middle) else (middle, high)
    return high


def work(solve: Solve) -> Work:
    """Return a solve as what is timed."""
    def run() -> int:
        solve()
        return 1
    return run
