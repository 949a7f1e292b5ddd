# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
One iteration of those who follow a gradient, ours and the peers', number for number.

    min Σ ℓ(x_t, u_t) + ℓ_f(x_N)   s.t.   x_{t+1} = f(x_t, u_t),   |u_t| ≤ u_max

It is the default problem, over a horizon of 30 steps where nothing else is said. Near the goal
every contender takes every step whole, so that its iteration is one expansion, one Riccati pass
and one rollout, while a swing-up also has line searches.
"""

from collections.abc import Iterator
import math
from typing import Any

import numpy as np
from timing import has, Work

from dp_swing_ros.control import controllers
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.pendulum.state import Array, hanging
from dp_swing_ros.problem.plan import Plan, Status
from dp_swing_ros.problem.problem import plan_of, Problem
from dp_swing_ros.solvers import SOLVERS

NEAR, SWING_UP = 'near the goal', 'swing-up'
STARTS = {NEAR: 2, SWING_UP: 10}         # in how many iterations of one descent each is timed
BOUND = 20.0                             # [N]
MODELS = 'rk4', 'euler'
BOUNDS = {'unbounded': math.inf, f'{BOUND:g} N': BOUND}
HORIZON = 30
HORIZONS = (10, 30, 100, 500)
LINKS = (1, 2, 3)


def problem(model: str = 'rk4', bound: float = BOUND, horizon: int = HORIZON,
            links: int = 2) -> Problem:
    """Return the problem."""
    return controllers.problem({
        'model': model, 'horizon': horizon, 'force_limit': bound, 'links': links})


def first_state(ours: Problem, start: str) -> Array:
    """Return the state that a descent starts from (2n + 2,)."""
    links = ours.physical.links
    if start == SWING_UP:
        return hanging(links)
    return np.array([0.02, *(0.005, -0.003, 0.002)[:links], *[0.0] * (links + 1)])


def first_plan(ours: Problem, start: str) -> Plan:
    """Follow the forces that a descent begins with: random, or a disturbed regulator's."""
    random = np.random.default_rng(0).uniform(-1, 1, ours.horizon)
    x = first_state(ours, start)
    U = 10 * random
    if start == NEAR:
        at = x
        for t in range(ours.horizon):
            U[t] = np.clip(-ours.lqr.K @ at + random[t], -BOUND, BOUND)
            at = rollout(ours.model, at, U[t:t + 1])[1]
    return plan_of(ours, rollout(ours.model, x, U), U, Status.COMPLETE)


def our_descents(ours: Problem, start: str) -> dict[str, Work]:
    """Return descents of ours; their units are iterations."""
    plan = first_plan(ours, start)

    def descent(name: str) -> Work:
        solver = SOLVERS[name](ours, SOLVERS[name].Parameters(
            iterations=STARTS[start], tolerance=0.0))
        return lambda: int(solver.solve(plan.X[0], plan, np.inf).stats.iterations)
    return {name: descent(name) for name in ('ilqr', 'ddp')}


def descents(ours: Problem, start: str) -> dict[str, Work]:
    """Return all contenders on a problem, from a start."""
    works = our_descents(ours, start)
    for peer in peers():
        works |= peer.descents(ours, start)
    return works


def peers() -> Iterator[Any]:
    """Yield the modules of those that are installed."""
    if has('libcrocoddyl') and has('libmim-solvers'):
        import peers_crocoddyl
        yield peers_crocoddyl
    if has('comma-deps-acados'):
        import peers_acados
        yield peers_acados
    if has('libaligator'):
        import peers_aligator
        yield peers_aligator


def contenders(start: str) -> dict[str, Work]:
    """Return all by step and bound; of a bound that does not exist, who needs none."""
    return {f'{name} {model} {bound}': work for model in MODELS for bound, of in BOUNDS.items()
            for name, work in descents(problem(model, of), start).items()}


def growing() -> Iterator[tuple[str, int, dict[str, Work]]]:
    """Yield near the goal all contenders over longer horizons, then with more links."""
    for horizon in HORIZONS:
        yield 'horizon', horizon, descents(problem(horizon=horizon), NEAR)
    for links in LINKS:
        yield 'links', links, descents(problem(links=links), NEAR)
