# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
One iteration of those who follow a gradient, ours and the peers', number for number.

    min Σ ℓ(x_t, u_t) + ℓ_f(x_N)   s.t.   x_{t+1} = f(x_t, u_t),   |u_t| ≤ u_max

It is the default problem, over a horizon of 30 steps where nothing else is said, so near the goal
that every contender takes every step whole: an iteration is one expansion, one Riccati pass and
one rollout. How much of it are step, cost and derivatives is measured as well, of the peers.
"""

from collections.abc import Iterator
import math
from typing import Any

import numpy as np
from timing import has, Work

from dp_swing_ros.control import controllers
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.problem.plan import Plan, Status
from dp_swing_ros.problem.problem import plan_of, Problem
from dp_swing_ros.solvers import SOLVERS

ITERATIONS = 2                           # of one descent; after them all have converged
BOUND = 20.0                             # [N]
MODELS = 'rk4', 'euler'
BOUNDS = {f'{BOUND:g} N': BOUND, 'unbounded': math.inf}
HORIZON = 30
HORIZONS = (10, 30, 100, 500)
LINKS = (1, 2, 3)
OURS = 'ilqr', 'ddp'
ALONE = 'CasADi, step, cost and derivatives alone'   # what peers are given, and no contender


def problem(model: str = 'rk4', bound: float = BOUND, horizon: int = HORIZON,
            links: int = 2) -> Problem:
    """Return the problem."""
    return controllers.problem({
        'model': model, 'horizon': horizon, 'force_limit': bound, 'links': links})


def first_plan(ours: Problem) -> Plan:
    """Return what a descent begins with: the regulator, disturbed, near the goal."""
    links, K = ours.physical.links, -ours.lqr.K
    random = np.random.default_rng(0).uniform(-1, 1, ours.horizon)
    X = np.empty((ours.horizon + 1, 2 * links + 2))
    X[0] = [0.02, *(0.005, -0.003, 0.002)[:links], *[0.0] * (links + 1)]
    U = np.empty(ours.horizon)
    for t in range(ours.horizon):
        U[t] = np.clip(K @ X[t] + random[t], -BOUND, BOUND)
        X[t + 1] = rollout(ours.model, X[t], U[t:t + 1])[1]
    # the gains keep rounding errors of the rollout small, which else grow like a fall
    return plan_of(ours, X, U, Status.COMPLETE, np.tile(K, (ours.horizon, 1)))


def our_descents(ours: Problem) -> dict[str, Work]:
    """Return descents of ours; their units are iterations."""
    plan = first_plan(ours)

    def descent(name: str) -> Work:
        solver = SOLVERS[name](ours, SOLVERS[name].Parameters(
            iterations=ITERATIONS, tolerance=0.0))
        return lambda: int(solver.solve(plan.X[0], plan, np.inf).stats.iterations)
    return {name: descent(name) for name in OURS}


def descents(ours: Problem) -> dict[str, Work]:
    """Return all contenders on a problem."""
    works = our_descents(ours)
    for peer in peers():
        works |= peer.descents(ours)
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


def contests() -> dict[str, dict[str, Work]]:
    """Return all contenders by step and bound."""
    return {f'{model}, {words}': descents(problem(model, bound))
            for model in MODELS for words, bound in BOUNDS.items()}


def growing() -> Iterator[tuple[str, int, dict[str, Work]]]:
    """Yield all contenders over longer horizons, then with more links."""
    for horizon in HORIZONS:
        yield 'horizon', horizon, descents(problem(horizon=horizon))
    for links in LINKS:
        yield 'links', links, descents(problem(links=links))
