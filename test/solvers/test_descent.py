# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How iLQR and DDP fare from cold starts, and what their status promises."""

import math

import numpy as np
import pytest

from dp_swing_ros.control import controllers
from dp_swing_ros.evaluation.scenarios import SCENARIOS
from dp_swing_ros.pendulum.derivatives import expand
from dp_swing_ros.pendulum.state import hanging, LINKS, SIZES
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.solvers.riccati import backward

COUNT = 200
PROBLEM = controllers.problem({})
SHARES = (1.0, *np.geomspace(1e-3, 1.0, 200), 0.0)


def cold_solves(name, **parameters):
    """Return what comes of zero forces from every start of the scenario `random`."""
    solver = SOLVERS[name](PROBLEM, SOLVERS[name].Parameters(**parameters))
    cases = SCENARIOS['random'].cases('random', range(COUNT), None, 10.0)
    return [solver.solve(np.array(case.plant['initial_state']), None, math.inf)
            for case in cases]


def promise(plan, second_order):
    """Return by what share a step without regularisation promises to lower the cost."""
    k, K = np.empty(len(plan.U)), np.empty_like(plan.K)
    points = expand(PROBLEM.model, plan.X, plan.U)
    positive, slope, _ = backward(
        PROBLEM.model, PROBLEM.cost, points, plan.X, plan.U, np.empty((0, 6)), PROBLEM.bounds, 0.0,
        second_order, k, K)
    return -slope / plan.stats.cost if positive else math.inf


@pytest.mark.parametrize('name', ['ilqr', 'ddp'])
def test_most_cold_starts_converge_within_the_iterations_of_a_tick(name):
    ends = [plan.stats.status for plan in cold_solves(name)]
    assert ends.count(Status.CONVERGED) >= 150


@pytest.mark.parametrize(('name', 'shares'), [('ilqr', [None]), ('ddp', SHARES)])
def test_what_has_converged_promises_nothing_without_regularisation(name, shares):
    """In DDP that of the share at the end, which the plan does not name."""
    converged = [plan for plan in cold_solves(name, iterations=500)
                 if plan.stats.status is Status.CONVERGED]
    assert len(converged) > 0.95 * COUNT
    tolerance = SOLVERS[name].Parameters().tolerance
    assert all(min(promise(plan, share) for share in shares) <= tolerance
               for plan in converged)


@pytest.mark.parametrize('angle', [0.25, 0.5, 0.6])
def test_second_order_terms_end_a_descent_quadratically(angle):
    """Where no bound is in its way it takes few iterations through the last seven digits."""
    p = controllers.problem({'force_limit': math.inf})
    x = np.array([0.3, angle, 0.3 * angle, 0.0, 0.0, 0.0])

    def ending(name):
        J = np.array([SOLVERS[name](p, SOLVERS[name].Parameters(
            iterations=n, tolerance=0.0)).solve(x, None, math.inf).stats.cost
            for n in range(1, 100)])
        distance = (J - J[-1]) / J[-1]
        return np.count_nonzero((distance > 1e-13) & (distance < 1e-6))
    assert 0 < ending('ddp') <= 5
    assert ending('ilqr') >= 10


@pytest.mark.parametrize('name', ['ilqr', 'ddp'])
def test_every_solve_ends(name):
    """Even where nothing is good enough, μ ends it."""
    plans = cold_solves(name, tolerance=0.0, iterations=10_000)[:20]
    assert {plan.stats.status for plan in plans} <= {Status.CONVERGED, Status.STALLED}


@pytest.mark.parametrize('links', LINKS)
@pytest.mark.parametrize('name', ['ilqr', 'ddp'])
def test_near_the_goal_the_plan_is_the_regulator_s(name, links):
    """Where the problem is linear and unbounded, its optimum is known."""
    p = controllers.problem({'links': links, 'force_limit': math.inf})
    x = np.zeros(SIZES[links])
    x[:2] = 1e-3, 1e-4
    plan = SOLVERS[name](p, SOLVERS[name].Parameters()).solve(x, None, math.inf)
    assert plan.U[0] == pytest.approx(-p.lqr.K @ x, rel=1e-3)
    assert plan.stats.cost == pytest.approx(x @ p.lqr.P @ x, rel=1e-3)
    np.testing.assert_allclose(plan.K[0], -p.lqr.K, rtol=2e-3)


@pytest.mark.parametrize('name', ['ilqr', 'ddp'])
def test_without_time_the_plan_is_the_warm_start(name):
    """So a recorded tick without an iteration can be solved again."""
    solver = SOLVERS[name](PROBLEM, SOLVERS[name].Parameters())
    warm = solver.solve(hanging(), None, math.inf)
    plan = solver.solve(hanging(), warm, -math.inf)
    assert plan.stats.status is Status.DEADLINE
    np.testing.assert_array_equal(plan.U, warm.U)
