# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Controllers to compare the receding horizon with: they solved long ago, or never do.

Each is built as BASELINES[name](parameters of the mpc)(seed), and then is a Controller of
closed_loop.py. Those with `_ekf` stand where a solver stands in the receding horizon: filters,
estimator, prediction to when the force acts and fallbacks are the same.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
import math
import time
from typing import NamedTuple

import numpy as np

from dp_swing_ros.control import controllers
from dp_swing_ros.control.planner import Planner, Search
from dp_swing_ros.control.receding_horizon import RecedingHorizon
from dp_swing_ros.parameters import ParameterError, Values
from dp_swing_ros.pendulum.derivatives import linearisation
from dp_swing_ros.pendulum.equations import derivative, energy, Parts
from dp_swing_ros.pendulum.model import hold, rollout, step
from dp_swing_ros.pendulum.state import Array, hanging, is_upright, to_turn_of, upright
from dp_swing_ros.pendulum.units import scaled_speeds
from dp_swing_ros.problem.plan import Plan, SolverStats, Status
from dp_swing_ros.problem.problem import (
    Bounds, plan_of, policy_rollout, Problem, regulator_rollout)
from dp_swing_ros.simulation.closed_loop import Controller
from dp_swing_ros.solvers.descent import ILQR

SWING_UP = 3.0     # [s] scaled, that the offline swing-up takes
MARGIN = 0.8       # share of the force that it may use; the rest is left for feedback
STARTS = 40        # random forces that it is solved from
STRONGEST = 10.0   # [N] scaled, of these at most
ITERATIONS = 1000  # at most, in each of these solves
FINE = 0.005       # [s] scaled, steps of the model that it is tried on

# of the energy-shaping law; chosen by hand on random starts of seeds from 2,000 on
PUMP = 400.0       # [s/(kg² m²)] scaled, acceleration by missing energy and its flow
HOLD_X, HOLD_V = 10.0, 3.0   # [1/s², 1/s] scaled, acceleration back to the centre
KICK, MOST = 5.0, 15.0   # [m/s²] scaled, where nothing moves, and at most
STANDING = 1e-2    # [m/s, rad/s] scaled, where nothing does
UNLIMITED = 1e3    # [N] scaled, taken for a force without a limit
AHEAD = 4          # steps of a plan, all that carries over a lost state


class Reference(NamedTuple):
    """A swing-up as a policy, and what it costs to start off it: eᵀ V e with e = x - X[0]."""

    plan: Plan
    V: Array  # (2n + 2, 2n + 2)


def swing_up(problem: Problem) -> Reference:
    """Return the cheapest swing-up from hanging that its regulator holds; or ParameterError."""
    scale = problem.scale
    N = round(scale.sized(SWING_UP, 's') / problem.dt)
    bound = MARGIN * min(problem.u_max, scale.sized(UNLIMITED, 'N'))
    long = replace(problem, horizon=N, bounds=Bounds(-bound, bound))
    solver = ILQR(long, ILQR.Parameters(iterations=ITERATIONS))
    random, x_0 = np.random.default_rng(0), hanging(problem.physical.links)
    found: list[Reference] = []
    for _ in range(STARTS):
        U = random.uniform(-1, 1, N) * min(bound, scale.sized(STRONGEST, 'N'))
        start = plan_of(long, rollout(problem.model, x_0, U), U, Status.COMPLETE)
        plan = solver.solve(x_0, start, math.inf)
        if is_upright(plan.X[-1], scale) and is_held(
                problem, reference := stabilised(problem, plan)):
            found.append(reference)
    if not found:
        raise ParameterError(f'no swing-up of {N * problem.dt:.3g} s in {STARTS} solves within '
                             f'{bound:g} N; a TVLQR needs one')
    return min(found, key=lambda reference: reference.plan.stats.cost)


def is_held(problem: Problem, reference: Reference) -> bool:
    """Return whether it ends upright in finer steps, short of the margin, where regulated."""
    fine = problem.model._replace(h=problem.scale.sized(FINE, 's'))
    controller, x = TVLQR(problem, reference), hanging(problem.physical.links)
    for n in range(2 * len(reference.plan.U)):
        force = controller.update(n * problem.dt, x, 0.0).U[0]
        x = hold(fine, x, force, problem.dt)
        if not abs(x[0]) < problem.cost.x_soft:
            return False
    return bool(is_upright(x, problem.scale))


def stabilised(problem: Problem, plan: Plan) -> Reference:
    """
    Give a trajectory the gains of its time-varying linear-quadratic regulator.

    From V = P of the infinite horizon back: V ← S + Aᵀ V (A + B K), K = -(R + BᵀVB)⁻¹ BᵀVA.
    """
    K, V = np.empty_like(plan.K), problem.lqr.P
    for t in range(len(plan.U) - 1, -1, -1):
        A, B = linearisation(problem.model, plan.X[t], plan.U[t])
        K[t] = -(B @ V @ A) / (problem.cost.R + B @ V @ B)
        V = np.diag(problem.cost.S) + A.T @ V @ (A + np.outer(B, K[t]))
    return Reference(replace(plan, K=K), V)


class TVLQR:
    """
    Follows a swing-up solved beforehand in time, then regulates.

    A run that starts nearer to the goal than to the swing-up's beginning is regulated at once.
    """

    def __init__(self, problem: Problem, reference: Reference) -> None:
        """Take the reference of swing_up."""
        self.problem, self.reference = problem, reference
        self.joined: float | None = None  # [s] when the reference would have begun
        self.last, self.began = Nothing(problem).fallback(0.0), 0.0   # the last answer, its time

    def update(self, t: float, x: Array, delay: float) -> Plan:
        """Return the policy followed from the measured state on; see Controller.update."""
        began = time.perf_counter()
        if self.joined is None:
            self.joined = t - (self.reference.plan.duration if self.skips(x) else 0.0)
        left = self.reference.plan.shifted(t + delay - self.joined)
        turns = to_turn_of(left.X[:1], x) - left.X[:1]
        _, X, U, _ = policy_rollout(self.problem, x, left.X + turns, left.U, left.K)
        return self.answer(X, U, Status.CONVERGED, t + delay, began)

    def fallback(self, acts_at: float) -> Plan:
        """Go on with what the last answer predicted; see Controller.fallback."""
        left = self.last.shifted(min(acts_at - self.began, self.last.duration - self.last.dt))
        return self.answer(left.X, left.U, Status.LAST_POLICY, acts_at)

    def skips(self, x: Array) -> bool:
        """Return whether a start (2n + 2,) is nearer to the goal, as the regulators measure it."""
        from_start = to_turn_of(x - self.reference.plan.X[0], np.zeros(len(x)))
        from_goal = to_turn_of(x - self.problem.x_r, np.zeros(len(x)))
        return bool(from_goal @ self.problem.lqr.P @ from_goal
                    < from_start @ self.reference.V @ from_start)

    def answer(self, X: Array, U: Array, status: Status, acts_at: float,
               began: float | None = None) -> Plan:
        """Make the plan, whose solve began at a time [s] if there was one, and remember it."""
        plan = plan_of(self.problem, X, U, status)
        self.last = plan if began is None else replace(plan, stats=plan.stats._replace(
            solve_time=time.perf_counter() - began))
        self.began = acts_at
        return self.last


class Nothing:
    """Never applies a force: what the plant does alone."""

    def __init__(self, problem: Problem) -> None:
        """Take the problem for the duration of a step."""
        self.problem = problem

    def update(self, t: float, x: Array, delay: float) -> Plan:
        """Return a plan of zero force that predicts nothing; see Controller.update."""
        return Plan(np.tile(x, (2, 1)), np.zeros(1), np.zeros((1, len(x))), self.problem.dt,
                    SolverStats(Status.COMPLETE, math.nan, 0, 0.0))

    def fallback(self, acts_at: float) -> Plan:
        """Return the same without a state; see Controller.fallback."""
        return self.update(acts_at, hanging(self.problem.physical.links), 0.0)


class Following:
    """The search of a receding horizon that follows a swing-up instead, with its feedback."""

    def __init__(self, controller: RecedingHorizon, reference: Reference) -> None:
        """Take the controller whose search it is, and the reference of swing_up."""
        self.observer = controller.observer
        self.tvlqr = TVLQR(controller.nominal, reference)

    def __call__(self, planner: Planner, x_0: Array, starts: Iterable[Plan],
                 deadline: float) -> list[Plan]:
        """Return the policy from where the force will act; see planner.search."""
        return [self.tvlqr.update(self.observer.latest, x_0, 0.0)]


def shaped(planner: Planner, x_0: Array, starts: Iterable[Plan],
           deadline: float) -> list[Plan]:
    """
    Return the regulator where it comes upright, else the plan that brings the energy of upright.

    A search of a receding horizon; its model is that of the estimator.
    """
    problem = planner.problem
    _, X, U, K = regulator_rollout(problem, x_0)
    if problem.is_reached(X[-1]) and np.abs(X[:, 0]).max() < problem.cost.x_soft:
        return [plan_of(problem, X, U, Status.COMPLETE, K)]
    X, U = np.tile(x_0, (AHEAD + 1, 1)), np.zeros(AHEAD)
    for t in range(AHEAD):
        U[t] = shaping_force(problem, X[t].tolist())
        step(problem.model, X[t], U[t], X[t + 1])
    return [plan_of(problem, X, U, Status.COMPLETE)]


def shaping_force(problem: Problem, x: list[float]) -> float:
    """
    Return the force [N] under which the links gain the energy that they lack upright.

    An acceleration a of the cart changes their energy at the rate -a Σ a_i cos θ_i θ̇_i. Source:
    Åström and Furuta, "Swinging up a pendulum by energy control", Automatica 36, 2000, for one
    link. Shapes: x (2n + 2,).
    """
    p, scale = problem.model.pendulum, problem.scale
    kick, most = (scale.sized(each, 'm/s^2') for each in (KICK, MOST))
    standing = scaled_speeds(STANDING, scale, p.links)
    position, th, v, w = Parts.of(p, x)
    still = [position, *th, 0.0, *w]             # their energy is that in the frame of the cart
    excess = energy(p, still) - energy(p, upright(len(th)).tolist())
    flow = sum(a * math.cos(angle) * speed for a, angle, speed in zip(p.a, th, w))
    pump = kick if all(abs(each) < least for each, least in zip((v, *w), standing)) else (
        min(max(scale.sized(PUMP, 's/kg^2 m^2') * excess * flow, -most), most))
    wanted = pump - scale.sized(HOLD_X, '1/s^2') * position - scale.sized(HOLD_V, '1/s') * v
    free, pushed = (derivative(p, x, u)[len(th) + 1] for u in (0.0, 1.0))
    return float(np.clip((wanted - free) / (pushed - free), *problem.bounds))


def with_search(values: Values, search: Callable[[RecedingHorizon], Search]
                ) -> Callable[[int], Controller]:
    """Return what makes a receding horizon that obeys a search of this kind."""
    def make(seed: int) -> Controller:
        controller = controllers.controller({**values, 'seed': seed})
        controller.planner.search = search(controller)
        return controller
    return make


def tvlqr(values: Values) -> Callable[[int], Controller]:
    """Solve once for all seeds."""
    problem = controllers.problem(values)
    reference = swing_up(problem)
    return lambda seed: TVLQR(problem, reference)


def tvlqr_ekf(values: Values) -> Callable[[int], Controller]:
    """Solve once for all seeds."""
    reference = swing_up(controllers.problem(values))
    return with_search(values, lambda controller: Following(controller, reference))


def nothing(values: Values) -> Callable[[int], Controller]:
    """Never apply a force."""
    problem = controllers.problem(values)
    return lambda seed: Nothing(problem)


BASELINES: dict[str, Callable[[Values], Callable[[int], Controller]]] = {
    'tvlqr': tvlqr, 'tvlqr_ekf': tvlqr_ekf,
    'energy_ekf': lambda values: with_search(values, lambda _: shaped), 'nothing': nothing}
