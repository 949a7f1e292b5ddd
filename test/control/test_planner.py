# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From a state to a plan, without anything else of a controller."""

from dataclasses import replace
import math

import numpy as np
import pytest

from dp_swing_ros.control.planner import best_of, Planner, PlannerParameters
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import hanging, upright
from dp_swing_ros.problem.parameters import CostParameters, PredictionParameters
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.problem.problem import Problem
from dp_swing_ros.solvers import SOLVERS

ENDLESS = math.inf
NEAR = upright() + np.array([0.1, 0.05, -0.05, 0.0, 0.0, 0.0])
EACH = pytest.mark.parametrize('solver', ['ilqr', 'ddp', 'mppi'])


def problem(step=PredictionParameters.step):
    return Problem.of(PendulumParameters(), LimitParameters(), CostParameters(),
                      PredictionParameters(step=step))


def planner(solver='ilqr', of=None, **parameters):
    return Planner(of or problem(), PlannerParameters(solver=solver, **parameters),
                   SOLVERS[solver].Parameters())


def followed(planner, x_0, times):
    """Return plans at times [s], each of which is obeyed until the next."""
    plans = []
    for t in times:
        plans.append(planner.plan(planner.problem, x_0, t, ENDLESS))
        planner.keep(plans[-1], t)
        if len(plans[-1].X) > 1:
            x_0 = plans[-1].X[1]
    return plans


@EACH
def test_a_plan_begins_in_the_state_and_costs_what_it_says(solver):
    of = problem()
    plan, = followed(planner(solver, of), hanging(), [0.0])
    assert np.array_equal(plan.X[0], hanging())
    assert len(plan.U) == of.horizon and plan.usable
    assert plan.stats.cost == min(each.cost for each in plan.stats.candidates)


@EACH
def test_after_a_reset_random_numbers_are_the_same(solver):
    one = planner(solver)
    times = 0.05 * np.arange(3)
    first = followed(one, hanging(), times)
    one.reset(one.problem)
    for before, again in zip(first, followed(one, hanging(), times)):
        assert np.array_equal(before.U, again.U)


def test_another_seed_is_another_first_plan():
    a, b = (followed(planner('mppi', seed=seed), hanging(), [0.0])[0] for seed in (0, 1))
    assert not np.array_equal(a.U, b.U)


def test_where_there_is_no_time_one_start_is_solved_all_the_same():
    plan = planner(first_starts=4).plan(problem(), hanging(), 0.0, deadline=-math.inf)
    assert len(plan.stats.candidates) == 1


def test_the_cheapest_usable_plan_is_the_best():
    of = problem()
    plan, = followed(planner(of=of), NEAR, [0.0])
    dear = replace(plan, stats=plan.stats._replace(cost=plan.stats.cost + 1.0))
    failed = replace(plan, stats=plan.stats._replace(cost=0.0, status=Status.FAILED))
    assert not failed.usable
    assert best_of(of, [dear, failed, plan]) is plan


def test_the_last_plan_is_what_a_tick_starts_from():
    first, second = followed(planner(), hanging(), [0.0, 0.05])
    assert first.stats.candidates[0].start == 'random'
    assert second.stats.candidates[0].start in ('last_plan', 'regulator')
    assert second.stats.cost < 1.05 * first.stats.cost


def test_between_its_steps_a_plan_is_followed_with_feedback():
    one = planner(of=problem(step=0.05), first_starts=1, other_starts=0)
    solved, between, again = followed(one, NEAR, [0.0, 0.02, 0.05])
    assert between.stats.status is Status.FEEDBACK
    assert solved.stats.status is not Status.FEEDBACK
    assert again.stats.status is not Status.FEEDBACK
    assert one.since == 0.05


def test_a_plan_of_no_force_predicts_nothing():
    one = planner()
    plan, = followed(one, NEAR, [0.0])
    assert one.warm_start(0.05) is not None
    one.keep(replace(plan, stats=plan.stats._replace(status=Status.ZERO)), 0.05)
    assert one.warm_start(0.10) is None


def test_past_its_end_nothing_is_left_of_a_plan():
    one = planner()
    followed(one, NEAR, [0.0])
    assert len(one.warm_start(0.10).U) == one.problem.horizon - 2
    assert one.warm_start(0.05 * one.problem.horizon + 1.0) is None


def test_for_another_problem_it_goes_on_with_the_last_plan_in_its_steps():
    one, other = planner(), problem(step=0.025)
    followed(one, NEAR, [0.0])
    plan = one.plan(other, NEAR, 0.05, ENDLESS)
    assert plan.dt == other.dt == one.problem.dt
    assert plan.stats.candidates[0].start in ('last_plan', 'regulator')


def test_other_parameters_count_and_random_numbers_go_on_unless_the_seed_is_another():
    one = planner('mppi', seed=3)
    followed(one, hanging(), [0.0])
    before = one.random
    one.reconfigure(planner('mppi', seed=3, other_starts=0), one.problem)
    assert one.random is before and one.starts.parameters.other_starts == 0
    one.reconfigure(planner('mppi', seed=4), one.problem)
    assert one.random is not before
