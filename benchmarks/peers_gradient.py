# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Crocoddyl on the same problem: the same pendulum in Pinocchio, force on the cart, quadratic cost.

    min Σ eᵀ S e + R u² + e_Nᵀ P e_N,   e = x - x_r,   over (x, θ1, θ2 - θ1) and their speeds

Pinocchio's second angle is relative to the first link. S weighs nothing of link 2, so that it is
diagonal in both coordinates; P is diagonal in Pinocchio's, and transformed for us. Crocoddyl has
no actuation of the first joint alone: `python` is one written in Python, as in its own example;
`C++` actuates all joints and forbids the torques, by their bounds or by a weight of 1e8. Its Euler
step is semi-implicit, and with RK4 it integrates the cost by the same rule, so that there the cost
differs a little from ours, which is a sum; dynamics and the cost of Euler's method agree. With
`same_problem` we take that step too, and all of the problem is the same.

mim-solvers takes crocoddyl's models, with its own settings: SQP without bounds, CSQP with the
bound as a constraint. CSQP is in no swing-up and no whole solve: where one of its steps diverges,
as from one cold start in five, an exception that it does not catch ends the process.
"""

from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
from timing import has, Work

from dp_swing_ros.control import controllers
from dp_swing_ros.pendulum.integrators import Integrator, Numbers
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.plan import Plan, Status
from dp_swing_ros.problem.problem import plan_of, Problem
from dp_swing_ros.solvers import SOLVERS

RUNNING = (10.0, 100.0, 0.0, 2.0, 6.0, 0.0)              # S
TERMINAL = (1e4, 1e5, 1e5, 2e3, 6e3, 1e2)                # P, in Pinocchio's coordinates
FORBIDDEN = 1e8                                          # weight of a torque that may not be
RELATIVE = np.eye(6)                                     # from our coordinates to Pinocchio's
RELATIVE[2, 1] = RELATIVE[5, 4] = -1.0
BOUND = 20.0                                             # [N]
AGREED = 1e-9                                            # [m, rad, m/s, rad/s]

# from where, and in how many iterations of one descent, the time of an iteration is
# measured; near the goal every contender takes every step whole, so that its iteration is one
# expansion, one Riccati pass and one rollout, while a swing-up also has line searches
STARTS = {'near the goal': ((0.2, 0.05, -0.03, 0.0, 0.0, 0.0), 3),
          'swing-up': ((0.0, np.pi, np.pi, 0.0, 0.0, 0.0), 10)}
SOLVED = {'crocoddyl': {'DDP': False, 'FDDP': False, 'BoxDDP': True, 'BoxFDDP': True},
          'mim_solvers': {'SQP': False, 'CSQP': True}}   # with bounds?
STOPS = {'crocoddyl': 'th_stop', 'mim_solvers': 'termination_tolerance'}


def semi_implicit(f: Callable[[Numbers, Any], Numbers], x: Numbers, u: Any, h: Any) -> Numbers:
    """Take a step of semi-implicit Euler: speeds first, then places by the new speeds."""
    k = f(x, u)
    n = len(k) // 2
    v = [x[i] + h * k[i] for i in range(n, len(k))]
    return [x[i] + h * v[i] for i in range(n)] + v


def problem(model: str, bounded: bool, horizon: int = 30) -> Problem:
    """Return the problem, for us."""
    ours = controllers.problem({
        'model': model, 'horizon': horizon, 'angle_error': 'angle', 'track_weight': 0.0,
        'force_limit': BOUND if bounded else float('inf')})
    P = RELATIVE.T @ np.diag(TERMINAL) @ RELATIVE
    return replace(ours, cost=ours.cost._replace(S=RUNNING, P=P))


def same_problem(horizon: int = 30) -> Problem:
    """Return the problem that crocoddyl solves with 'euler' and a bound, number for number."""
    ours = problem('euler', True, horizon)
    return replace(ours, model=ours.model._replace(
        integrator=Integrator('semi_implicit', semi_implicit)))


def first_forces(ours: Problem, start: str, step: Callable[[Array, float], Array]) -> Array:
    """
    Return the forces that a descent begins with: random, or those of a disturbed regulator.

    step is that of the contender's own model, for forces do not hold another one upright.
    """
    random = np.random.default_rng(0).uniform(-1, 1, ours.horizon)
    x = np.array(STARTS[start][0])
    if start == 'swing-up':
        return 10 * random
    U = np.empty(ours.horizon)
    for t in range(ours.horizon):
        U[t] = np.clip(-ours.lqr.K @ x + random[t], -BOUND, BOUND)
        x = step(x, U[t])
    return U


def first_plan(ours: Problem, start: str) -> Plan:
    """Follow those forces."""
    U = first_forces(ours, start, lambda x, u: rollout(ours.model, x, np.array([u]))[1])
    return plan_of(ours, rollout(ours.model, np.array(STARTS[start][0]), U), U, Status.COMPLETE)


def our_descent(name: str, ours: Problem, start: str) -> Work:
    """Return a descent of ours; its units are iterations."""
    solver = SOLVERS[name](ours, SOLVERS[name].Parameters(
        iterations=STARTS[start][1], tolerance=0.0))
    plan = first_plan(ours, start)
    return lambda: int(solver.solve(plan.X[0], plan, np.inf).stats.iterations)


def pinocchio_model(physical: PendulumParameters) -> Any:
    """Build the pendulum, joint by joint: a slide along x and two hinges about y."""
    import pinocchio

    model = pinocchio.Model()
    model.gravity.linear = np.array([0.0, 0.0, -physical.gravity])
    at, here = np.zeros(3), pinocchio.SE3.Identity()
    joint = model.addJoint(0, pinocchio.JointModelPX(), here, 'cart')
    model.appendBodyToJoint(joint, pinocchio.Inertia(physical.cart_mass, at, np.eye(3)), here)
    for link in (1, 2):
        mass, length, factor = (getattr(physical, f'link{link}_{name}')
                                for name in ('mass', 'length', 'inertia_factor'))
        joint = model.addJoint(joint, pinocchio.JointModelRY(), pinocchio.SE3(np.eye(3), at),
                               f'joint{link}')
        about_centre = factor * mass * length ** 2 / 12 * np.eye(3)
        model.appendBodyToJoint(joint, pinocchio.Inertia(
            mass, np.array([0.0, 0.0, length / 2]), about_centre), here)
        at = np.array([0.0, 0.0, length])
    return model


def on_the_cart(state: Any) -> Any:
    """Return the actuation by one force on the cart, written in Python."""
    import crocoddyl

    class Cart(crocoddyl.ActuationModelAbstract):

        def calc(self, data: Any, x: Array, u: Array) -> None:
            data.tau[0] = u[0]

        def calcDiff(self, data: Any, x: Array, u: Array) -> None:
            pass   # constant, and set once

        def createData(self) -> Any:
            data = crocoddyl.ActuationDataAbstract(self)
            data.dtau_du[0] = 1.0
            return data
    return Cart(state, 1)


class Crocoddyl:
    """The problem in crocoddyl, by one of its integrators and one way to actuate the cart."""

    def __init__(self, integrator: str, actuation: str, bounded: bool, start: str,
                 horizon: int = 30, constrained: bool = False) -> None:
        """
        Build the shooting problem; its cost is the same number as ours for Euler's method.

        Where it is `constrained` the bounds are constraints, too, which crocoddyl itself ignores.
        """
        import crocoddyl

        ours = problem('rk4', bounded, horizon)
        self.x_0 = RELATIVE @ np.array(STARTS[start][0])
        state = crocoddyl.StateMultibody(pinocchio_model(ours.physical))
        actuated = (on_the_cart if actuation == 'python' else crocoddyl.ActuationModelFull)(state)
        self.nu = actuated.nu
        over = {'euler': crocoddyl.IntegratedActionModelEuler,
                'rk4': lambda continuous, step: crocoddyl.IntegratedActionModelRK(
                    continuous, crocoddyl.RKType.four, step)}[integrator]

        def node(S: tuple[float, ...], R: float, step: float) -> Any:
            costs = crocoddyl.CostModelSum(state, self.nu)
            weights = [R] + [FORBIDDEN] * (self.nu - 1)
            # crocoddyl halves its quadratic costs and multiplies them by the step
            for name, weight, residual in (
                    ('x', S, crocoddyl.ResidualModelState(state, np.zeros(6), self.nu)),
                    ('u', weights, crocoddyl.ResidualModelControl(state, self.nu))):
                costs.addCost(name, crocoddyl.CostModelResidual(
                    state, crocoddyl.ActivationModelWeightedQuad(2 * np.array(weight)), residual),
                    1 / step if step else 1.0)
            bound, constraints = self.actuate(BOUND), []
            if constrained and step:
                constraints.append(crocoddyl.ConstraintModelManager(state, self.nu))
                constraints[0].addConstraint('u', crocoddyl.ConstraintModelResidual(
                    state, crocoddyl.ResidualModelControl(state, self.nu), -bound, bound))
            model = over(crocoddyl.DifferentialActionModelFreeFwdDynamics(
                state, actuated, costs, *constraints), step)
            if bounded and step:
                model.u_lb, model.u_ub = -bound, bound
            return model
        running = node(RUNNING, ours.cost.R, ours.dt)
        self.problem = crocoddyl.ShootingProblem(
            self.x_0, [running] * horizon, node(TERMINAL, 0.0, 0.0))
        if self.problem.nthreads > 1:
            self.problem.nthreads = 1   # as ours; more are slower, for nodes this small
        forces = first_forces(ours, start, self.step)
        self.us = [self.actuate(u) for u in forces]
        self.xs = self.problem.rollout(self.us)
        self.iterations = STARTS[start][1]

    def actuate(self, u: float) -> Array:
        """Return the controls that are this force on the cart [N]."""
        return np.array([u] + [0.0] * (self.nu - 1))

    def step(self, x: Array, u: float) -> Array:
        """Return the next state, in our coordinates."""
        node = self.problem.runningModels[0]
        data = node.createData()
        node.calc(data, RELATIVE @ x, self.actuate(u))
        return np.linalg.solve(RELATIVE, data.xnext)

    def descent(self, package: str, solver: str) -> Work:
        """Return a descent of a solver that takes it; its units are iterations."""
        solves = getattr(import_module(package), f'Solver{solver}')(self.problem)
        # which nothing reaches: as many iterations as were asked for
        setattr(solves, STOPS[package], 1e-300)
        self.solver = solves

        def run() -> int:
            solves.solve(self.xs, self.us, self.iterations, True)
            return int(solves.iter)
        return run


def disagreement() -> float:
    """Return how far a rollout by crocoddyl's RK4 ends from ours, in any state."""
    theirs, ours = Crocoddyl('rk4', 'C++', False, 'swing-up'), problem('rk4', False)
    X = rollout(ours.model, np.array(STARTS['swing-up'][0]), np.array([u[0] for u in theirs.us]))
    return float(np.abs(np.array(theirs.xs) - X @ RELATIVE.T).max())


def descents(start: str, models: tuple[str, ...] = ('rk4', 'euler')) -> dict[str, Work]:
    """
    Return all contenders from a start.

    Raises RuntimeError where crocoddyl's pendulum is not ours: a Pinocchio that its wheel was not
    built against loads all the same, and has no gravity.
    """
    if (difference := disagreement()) > AGREED:
        raise RuntimeError(f"crocoddyl's pendulum ends {difference:g} from ours; install the "
                           'versions of constraints.txt')
    contenders = {
        f'{name} {model} {"20 N" if bounded else "unbounded"}': our_descent(
            name, problem(model, bounded), start)
        for name in ('ilqr', 'ddp') for model in models for bounded in (False, True)}
    for package in filter(has, SOLVED):
        for solver, bounded in SOLVED[package].items():
            constrained = solver == 'CSQP'
            if constrained and start == 'swing-up':
                continue
            for model in models:
                for actuation in ('python', 'C++'):
                    theirs = Crocoddyl(model, actuation, bounded, start, constrained=constrained)
                    contenders[f'{package} {solver} {model} {actuation}'] = theirs.descent(
                        package, solver)
    return contenders
