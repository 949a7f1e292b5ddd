# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One contract for every solver of the registry, on every dynamics model of the other."""

import math
import time

import numpy as np
import pytest

from dp_swing_ros.cost import trajectory_cost
from dp_swing_ros.dynamics import MODELS
from dp_swing_ros.dynamics.trajectory import rollout
from dp_swing_ros.mpc import MpcParameters
from dp_swing_ros.parameters import (CostParameters, LimitParameters, ParameterError,
                                     PendulumParameters, PredictionParameters)
from dp_swing_ros.plan import Plan, SolverStats, Status
from dp_swing_ros.problem import policy_rollout, Problem
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.solvers.solver import policy_of
from dp_swing_ros.state import HANGING

STATES = {'hanging': np.array(HANGING),
          'falling': np.array([0.3, 0.2, -0.2, 0.5, 1.0, -1.0]),
          'upright': np.zeros(6),
          'turned': np.array([0.1, 2 * np.pi, -6 * np.pi, 0.0, 0.1, 0.0]),
          'wild': np.array([-2.3, 2.0, -1.0, -3.0, 12.0, -15.0])}


@pytest.fixture(params=sorted(MODELS))
def model(request):
    return request.param


# by a name in the tests: the name in the registry, and parameters
CHOICES = {**{name: (name, {}) for name in sorted(SOLVERS)},
           'mppi by torch': ('mppi', {'device': 'torch', 'samples': 64})}


@pytest.fixture(params=CHOICES)
def name(request):
    return request.param


@pytest.fixture(params=sorted(STATES))
def x_0(request):
    return STATES[request.param]


def problem(model='rk4', horizon=30, force_limit=20.0, **cost):
    return Problem.of(PendulumParameters(), LimitParameters(force_limit=force_limit),
                      CostParameters(**cost), PredictionParameters(model=model, horizon=horizon))


def solver(name, problem, seed=0, **more):
    name, parameters = CHOICES[name]
    return SOLVERS[name](problem, SOLVERS[name].Parameters(**parameters, **more), seed)


def random_start(problem, x_0, seed=0):
    U = np.random.default_rng(seed).uniform(-10, 10, problem.horizon)
    X = rollout(problem.model, x_0, U)
    return Plan(X, U, np.zeros((len(U), 6)), problem.dt,
                SolverStats(Status.COMPLETE, math.nan, 0, 0.0))


def test_a_plan_re_integrates_to_itself(name, model, x_0):
    p = problem(model)
    plan = solver(name, p).solve(x_0, random_start(p, x_0), math.inf)
    assert plan.X.shape == (31, 6)
    assert plan.U.shape == (30,)
    assert plan.K.shape == (30, 6)
    np.testing.assert_array_equal(plan.X[0], x_0)
    np.testing.assert_array_equal(plan.X, rollout(p.model, x_0, plan.U))
    if not plan.usable:   # Euler's steps diverge from the wild state
        assert (model, x_0[4]) == ('euler', 12.0)
        return
    assert plan.stats.cost == pytest.approx(trajectory_cost(p.cost, plan.X, plan.U), rel=1e-9)


@pytest.mark.parametrize('force_limit', [20.0, 0.1, math.inf])
def test_the_bound_is_kept(name, force_limit, x_0):
    p = problem(force_limit=force_limit)
    plan = solver(name, p).solve(x_0, random_start(p, x_0), math.inf)
    assert np.all(np.abs(plan.U) <= force_limit)
    assert np.all(np.isfinite(plan.U))


def test_the_cost_is_never_worse_than_the_warm_start_s(name, model, x_0):
    p = problem(model)
    for seed in range(5):
        warm = random_start(p, x_0, seed)
        J = policy_rollout(p, *policy_of(p, x_0, warm)).J
        plan = solver(name, p, seed).solve(x_0, warm, math.inf)
        if not np.isfinite(J):   # Euler's steps diverge from the wild state
            assert (model, x_0[4]) == ('euler', 12.0)
            continue
        assert plan.stats.cost <= J
        again = solver(name, p, seed).solve(x_0, plan, math.inf)
        assert again.stats.cost <= plan.stats.cost * (1 + 1e-12)


def test_the_same_seed_gives_the_same_plan(name, x_0):
    p = problem()
    first, second = (solver(name, p, 3).solve(x_0, random_start(p, x_0), math.inf)
                     for _ in range(2))
    np.testing.assert_array_equal(first.U, second.U)
    np.testing.assert_array_equal(first.K, second.K)


def test_a_deadline_that_has_passed_returns_the_warm_start(name, x_0):
    p = problem()
    warm = random_start(p, x_0)
    plan = solver(name, p).solve(x_0, warm, time.perf_counter() - 1)
    assert plan.stats.status is Status.DEADLINE
    assert plan.usable
    np.testing.assert_array_equal(plan.U, warm.U)


def test_a_deadline_cuts_a_long_solve_short(name):
    """The same solve with all the time in the world takes many times longer."""
    p, x_0 = problem(horizon=400), STATES['hanging']
    late = solver(name, p, tolerance=0.0, iterations=1000 if 'mppi' in name else 10_000)
    warm = random_start(p, x_0)
    late.solve(x_0, warm, time.perf_counter())   # compiled from here on
    plan = late.solve(x_0, warm, time.perf_counter() + 0.002)
    assert plan.stats.status is Status.DEADLINE
    assert 0.002 <= plan.stats.solve_time < 2


@pytest.mark.parametrize('bad', [np.nan, np.inf])
def test_a_state_that_is_not_finite_is_refused(name, bad):
    with pytest.raises(ValueError, match='expected six finite numbers'):
        solver(name, problem()).solve(np.array([0, bad, 0, 0, 0, 0]), None, math.inf)


def test_a_start_beyond_all_numbers_is_a_failure_and_no_exception(name):
    plan = solver(name, problem()).solve(np.array([0, 0, 0, 0, 1e200, 0]), None, math.inf)
    assert plan.stats.status is Status.FAILED
    assert not plan.usable


def test_the_state_and_the_warm_start_are_left_as_they_were(name, x_0):
    p = problem()
    warm, x = random_start(p, x_0), x_0.copy()
    X, U = warm.X.copy(), warm.U.copy()
    solver(name, p).solve(x, warm, math.inf)
    np.testing.assert_array_equal(x, x_0)
    np.testing.assert_array_equal(warm.X, X)
    np.testing.assert_array_equal(warm.U, U)


def test_near_the_goal_the_solver_is_the_regulator(name):
    """Where the problem is linear and unbounded, its optimum is known."""
    p = problem(force_limit=math.inf)
    x = np.array([1e-3, 1e-4, -1e-4, 0.0, 0.0, 0.0])
    plan = None
    for _ in range(3):
        plan = solver(name, p).solve(x, plan, math.inf)
    assert plan.U[0] == pytest.approx(-p.lqr.K @ x, rel=0.02)
    assert plan.stats.cost == pytest.approx(x @ p.lqr.P @ x, rel=0.02)


@pytest.mark.parametrize('horizon', [1, 2, 100])
def test_any_horizon_works(name, horizon):
    p = problem(horizon=horizon)
    plan = solver(name, p).solve(STATES['falling'], None, math.inf)
    assert plan.usable
    assert plan.U.shape == (horizon,)


def test_a_short_warm_start_is_completed_by_the_regulator(name):
    p, x_0 = problem(), STATES['upright'] + (0.005, 0.001, 0, 0, 0, 0)
    whole = solver(name, p).solve(x_0, None, math.inf)
    rest = whole.shifted(10 * p.dt)
    started = policy_rollout(p, *policy_of(p, rest.X[0], rest))
    assert started.X.shape == (31, 6)
    np.testing.assert_allclose(started.X[:20], whole.X[10:30], atol=1e-9)
    assert started.U[25] == pytest.approx(-p.lqr.K @ started.X[25], rel=1e-3)


def test_an_unknown_solver_is_named_with_the_choices():
    with pytest.raises(ParameterError, match="'solver' is 'lqr'; expected one of ddp, ilqr, mppi"):
        MpcParameters(solver='lqr')
