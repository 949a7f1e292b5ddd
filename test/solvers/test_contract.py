# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
One contract for every solver of the registry, on every integrator and all numbers of links.

It asks for what README and Solver promise, and no more: a solver that is written from them passes.
"""

from dataclasses import fields, replace
from importlib.util import find_spec
import math
import time

from cross_entropy import CrossEntropy
import numpy as np
import pytest
from sampled_ilqr import SampledILQR

from dp_swing_ros.control import controllers
from dp_swing_ros.control.receding_horizon import MpcParameters
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.integrators import INTEGRATORS
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.pendulum.state import hanging, links_of, SIZES, upright
from dp_swing_ros.problem.cost import trajectory_cost
from dp_swing_ros.problem.parameters import PredictionParameters
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.problem.problem import Bounds, plan_of, policy_rollout
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.solvers.solver import policy_of

STATES = {'hanging': hanging(),
          'falling': np.array([0.3, 0.2, -0.2, 0.5, 1.0, -1.0]),
          'upright': upright(),
          'turned': np.array([0.1, 2 * np.pi, -6 * np.pi, 0.0, 0.1, 0.0]),
          'wild': np.array([-2.3, 2.0, -1.0, -3.0, 12.0, -15.0])}
# of other numbers of links, briefly
OTHERS = {'one hanging': hanging(1), 'one falling': np.array([0.3, 0.2, 0.5, 1.0]),
          'three hanging': hanging(3),
          'three falling': np.array([0.3, 0.1, -0.1, 0.1, 0.2, 0.5, -0.5, 0.5])}


DEFAULT = PredictionParameters().model

# by a name in the tests: the class, and parameters
CHOICES = {**{name: (SOLVERS[name], {}) for name in sorted(SOLVERS)},
           'mppi by torch': (
              SOLVERS['mppi'], {'device': 'torch', 'samples': 64, 'iterations': 2}),
           'cross-entropy': (CrossEntropy, {}), 'sampled iLQR': (SampledILQR, {})}
if find_spec('acados') and find_spec('casadi'):
    from acados_rti.solver import AcadosRTI

    CHOICES['acados RTI'] = AcadosRTI, {}


@pytest.fixture(params=CHOICES)
def name(request):
    return request.param


@pytest.fixture(params=sorted(STATES))
def x_0(request):
    return STATES[request.param]


@pytest.fixture(params=[*sorted(STATES), *OTHERS])
def any_x_0(request):
    """Return a state of one, two or three links."""
    return {**STATES, **OTHERS}[request.param]


# every integrator with two links, the default one with all: each other pair compiles for seconds
@pytest.fixture(params=[(model, state) for model in sorted(INTEGRATORS)
                        for state in (*sorted(STATES), *OTHERS)
                        if state in STATES or model == DEFAULT],
                ids='-'.join)
def modelled(request):
    """Return the name of an integrator, and a state."""
    model, state = request.param
    return model, {**STATES, **OTHERS}[state]


def problem(links=2, **values):
    return controllers.problem({'links': links, 'force_limit': 20.0, **values})


def problem_at(x_0, **values):
    return problem(links_of(x_0), **values)


def is_wild(x_0):
    """Return whether it is the state from which a coarse model diverges."""
    return x_0 is STATES['wild']


def solver(name, problem, seed=0, **more):
    kind, parameters = CHOICES[name]
    return kind(problem, kind.Parameters(**{**parameters, **more}), seed)


def random_start(problem, x_0, seed=0):
    U = np.random.default_rng(seed).uniform(-10, 10, problem.horizon)
    return plan_of(problem, rollout(problem.model, x_0, U), U, Status.COMPLETE)


def test_a_plan_re_integrates_to_itself(name, modelled):
    model, x_0 = modelled
    p = problem_at(x_0, model=model)
    plan = solver(name, p).solve(x_0, random_start(p, x_0), math.inf)
    assert plan.X.shape == (31, len(x_0))
    assert plan.U.shape == (30,)
    assert plan.K.shape == (30, len(x_0))
    np.testing.assert_array_equal(plan.X[0], x_0)
    np.testing.assert_array_equal(plan.X, rollout(p.model, x_0, plan.U))
    if not plan.usable:
        assert is_wild(x_0)
        return
    assert plan.stats.cost == pytest.approx(trajectory_cost(p.cost, plan.X, plan.U), rel=1e-9)


@pytest.mark.parametrize('force_limit', [20.0, 0.1, math.inf])
def test_the_bound_is_kept(name, force_limit, x_0):
    p = problem(force_limit=force_limit)
    plan = solver(name, p).solve(x_0, random_start(p, x_0), math.inf)
    assert np.all(np.abs(plan.U) <= force_limit)
    assert np.all(np.isfinite(plan.U))


@pytest.mark.parametrize('bounds', [Bounds(-3.0, 17.0), Bounds(-17.0, 3.0), Bounds(2.0, 6.0)])
def test_two_bounds_that_differ_are_kept(name, bounds, x_0):
    p = replace(problem_at(x_0), bounds=bounds)
    plan = solver(name, p).solve(x_0, random_start(p, x_0), math.inf)
    # in single precision, where samples are
    assert bounds.low - 1e-6 <= plan.U.min() and plan.U.max() <= bounds.high + 1e-6
    if plan.usable:
        assert trajectory_cost(p.cost, plan.X, plan.U) == pytest.approx(plan.stats.cost, rel=1e-9)


def test_the_cost_is_never_worse_than_the_warm_start_s(name, modelled):
    model, x_0 = modelled
    p = problem_at(x_0, model=model)
    warm = random_start(p, x_0)
    J = policy_rollout(p, *policy_of(p, x_0, warm)).J
    plan = solver(name, p).solve(x_0, warm, math.inf)
    if not np.isfinite(J):
        assert is_wild(x_0)
        return
    assert plan.stats.cost <= J
    again = solver(name, p).solve(x_0, plan, math.inf)
    assert again.stats.cost <= plan.stats.cost * (1 + 1e-12)


def test_the_same_seed_gives_the_same_plan(name, any_x_0):
    x_0 = any_x_0
    p = problem_at(x_0)
    first, second = (solver(name, p, 3).solve(x_0, random_start(p, x_0), math.inf)
                     for _ in range(2))
    np.testing.assert_array_equal(first.U, second.U)
    np.testing.assert_array_equal(first.K, second.K)


def test_a_deadline_that_has_passed_is_a_status_and_no_error(name, any_x_0):
    x_0 = any_x_0
    p = problem_at(x_0)
    warm = random_start(p, x_0)
    plan = solver(name, p).solve(x_0, warm, time.perf_counter())   # by when it is looked at
    assert plan.stats.status is Status.DEADLINE
    assert plan.usable
    assert plan.stats.iterations == 0
    assert plan.stats.cost <= policy_rollout(p, *policy_of(p, x_0, warm)).J


@pytest.mark.parametrize('name', SOLVERS)
def test_a_solve_says_what_it_spent_its_time_on(name, x_0):
    p = problem_at(x_0)
    one = solver(name, p)
    one.solve(x_0, random_start(p, x_0), math.inf)   # compiled from here on
    stats = one.solve(x_0, random_start(p, x_0), math.inf).stats
    assert all(spent >= 0 for spent in stats.phases.values())
    assert 0 < sum(stats.phases.values()) <= stats.solve_time


@pytest.mark.parametrize('name', SOLVERS)
def test_what_a_solve_tried_is_within_the_bound(name, x_0):
    p = problem_at(x_0)
    one = solver(name, p)
    assert len(one.tries(8).weights) == 0
    plan = one.solve(x_0, random_start(p, x_0), math.inf)
    if not plan.usable:
        return
    tries = one.tries(8)
    assert 1 < len(tries.weights) <= 9 and tries.U.shape == (len(tries.weights), p.horizon)
    assert tries.weights.max() == 1.0 and tries.weights.min() >= 0.0
    assert tries.U.min() >= p.bounds.low - 1e-6 and tries.U.max() <= p.bounds.high + 1e-6
    assert len(np.unique(tries.U[:, 0].round(9))) > 1
    again = one.solve(x_0, random_start(p, x_0), time.perf_counter() - 1)   # before any
    assert again.usable and (name in ('ilqr', 'ddp') or len(one.tries(8).weights) == 0)


@pytest.mark.parametrize('name', SOLVERS)
def test_to_show_tries_changes_no_plan(name):
    p, x_0 = problem(), STATES['hanging']
    shown, other = solver(name, p), solver(name, p)
    for n in range(3):
        plans = [each.solve(x_0, random_start(p, x_0, n), math.inf) for each in (shown, other)]
        shown.tries(5)
        np.testing.assert_array_equal(plans[0].U, plans[1].U)


def test_a_deadline_cuts_a_long_solve_short(name):
    """A solve of so many iterations would take many times longer."""
    p, x_0 = problem(horizon=400), STATES['hanging']
    known = {field.name for field in fields(CHOICES[name][0].Parameters)}
    endless = {'iterations': 1000, 'tolerance': 0.0}
    late = solver(name, p, **{key: endless[key] for key in known & set(endless)})
    warm = random_start(p, x_0)
    late.solve(x_0, warm, time.perf_counter())   # compiled from here on
    plan = late.solve(x_0, warm, time.perf_counter() + 0.002)
    assert plan.stats.status is Status.DEADLINE
    assert plan.stats.iterations < 1000
    assert plan.usable


@pytest.mark.parametrize('links', SIZES)
@pytest.mark.parametrize('bad', [np.nan, np.inf])
def test_a_state_that_is_not_finite_is_refused(name, links, bad):
    x_0 = upright(links)
    x_0[1] = bad
    with pytest.raises(ValueError, match=f'expected {SIZES[links]} finite numbers'):
        solver(name, problem(links)).solve(x_0, None, math.inf)


@pytest.mark.parametrize('links', SIZES)
def test_a_state_of_another_pendulum_is_refused(name, links):
    with pytest.raises(ValueError, match=f'expected {SIZES[links]} finite numbers'):
        solver(name, problem(links)).solve(upright(links % 3 + 1), None, math.inf)


@pytest.mark.parametrize('links', SIZES)
def test_a_start_beyond_all_numbers_is_a_failure_and_no_exception(name, links):
    x_0 = upright(links)
    x_0[-1] = 1e200
    plan = solver(name, problem(links)).solve(x_0, None, math.inf)
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


@pytest.mark.parametrize('horizon', [1, 2, 100])
def test_any_horizon_works(name, horizon):
    p = problem(horizon=horizon)
    plan = solver(name, p).solve(STATES['falling'], None, math.inf)
    assert plan.usable
    assert plan.U.shape == (horizon,)


def test_an_unknown_solver_is_named_with_the_choices():
    with pytest.raises(ParameterError, match="'solver' is 'lqr'; expected one of "
                       f'{", ".join(sorted(SOLVERS))}'):
        MpcParameters(solver='lqr')
