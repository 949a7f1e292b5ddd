# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where the solves of a tick start."""

from dataclasses import replace
import math

from controllers import controller
import numpy as np
import pytest

from dp_swing_ros.control.starts import solved
from dp_swing_ros.pendulum.state import angles, hanging
from dp_swing_ros.problem.problem import policy_rollout, regulator_rollout, turns_of

HANGS = hanging()
ANGLES = angles(HANGS)
FALLING = np.array([0.1, 0.1, -0.05, 0.0, 0.3, 0.0])
UP = np.array([0.1, 0.01, 0.01, 0.0, 0.0, 0.0])


def starts_of(c, x_0, left=None):
    return list(c.planner.starts.of(x_0, left))


def after_a_plan(x_0=HANGS, **parameters):
    """Return a controller with a plan, the state that it predicts next, and the plan's rest."""
    c = controller(**parameters)
    plan = c.update(0.0, x_0)
    return c, plan.X[1], c.planner.warm_start(0.05)


def test_a_first_tick_starts_from_random_forces_and_from_others():
    first, regulator, rest, *randoms = starts_of(controller(first_starts=4), HANGS)
    assert 5.0 < np.abs(first.U).max() <= 10.0
    np.testing.assert_array_equal(rest.U, 0.0)
    np.testing.assert_allclose(rest.X, np.tile(HANGS, (31, 1)), atol=1e-12)
    assert not np.array_equal(regulator.U, rest.U)
    assert [len(plan.U) for plan in randoms] == [30]  # in place of the bounded LQR, out of reach


def test_a_tick_says_where_each_of_its_solves_began_and_what_came_of_it():
    c, x, _ = after_a_plan(first_starts=4)
    first = c.planner.last.stats
    assert [each.start for each in first.candidates] == ['random', 'regulator', 'rest', 'random']
    assert min(each.cost for each in first.candidates) == first.cost
    assert sum(first.solves) == first.iterations
    plan = c.update(0.05, x)
    assert [each.start for each in plan.stats.candidates] == [
        'last_plan', 'random', 'regulator']
    assert plan.start == 'last_plan'
    assert {'estimate', 'starts', 'backward', 'line_search'} <= set(plan.stats.phases)
    phases = plan.stats.phases.values()
    assert min(phases) >= 0 and 0 < sum(phases) <= plan.stats.solve_time


def test_the_same_seed_gives_the_same_starts():
    plans = [starts_of(controller(seed=seed), HANGS) for seed in (0, 0, 1)]
    for one, same in zip(*plans[:2]):
        np.testing.assert_array_equal(one.U, same.U)
    assert np.abs(plans[0][0].U - plans[2][0].U).max() > 0.1


def test_a_later_tick_starts_from_the_rest_of_the_last_plan_and_others_in_turn():
    c, x, left = after_a_plan()
    # the bounded LQR, first in turn, is out of reach
    last, random, regulator = starts_of(c, x, left)
    assert [plan.start for plan in starts_of(c, x, left)[1:]] == ['random', 'regulator']
    np.testing.assert_array_equal(regulator.U, regulator_rollout(c.belief.problem, x).U)
    assert not np.array_equal(random.U, regulator.U)
    for part, old in ((last.U, left.U), (last.X, left.X), (last.K, left.K)):
        np.testing.assert_array_equal(part, old)
    assert c.planner.warm_start(0.05 * 30) is None


def test_once_upright_there_is_nothing_to_look_for():
    c, _, left = after_a_plan(FALLING, other_starts=3)
    assert len(starts_of(c, UP, left)) == 1
    assert len(starts_of(c, np.array([0.0, 0.3, 0.0, 0.0, 0.0, 0.0]), left)) == 4


def test_the_paper_has_one_start_a_tick():
    c, x, left = after_a_plan(first_starts=1, other_starts=0)
    assert len(starts_of(c, HANGS)) == len(starts_of(c, x, left)) == 1


def test_the_regulator_replaces_a_worse_last_plan():
    c, _, left = after_a_plan(of_solver={'iterations': 1})
    start = starts_of(c, UP, left)[0]   # somebody lifted it
    np.testing.assert_allclose(start.U, regulator_rollout(c.belief.problem, UP).U, rtol=1e-8)


def test_within_its_reach_the_bounded_lqr_is_the_first_of_the_others():
    _, bounded, regulator = starts_of(controller(first_starts=3), FALLING)
    assert (bounded.start, regulator.start) == ('bounded_lqr', 'regulator')
    np.testing.assert_array_equal(
        regulator.U, regulator_rollout(controller().belief.problem, FALLING).U)
    assert not np.array_equal(bounded.U, regulator.U)


def test_the_regulator_goes_to_the_turn_where_the_last_plan_ends():
    c, _, left = after_a_plan(of_solver={'iterations': 1})
    turns = np.zeros(6)
    turns[ANGLES] = 2 * np.pi * (1 + np.round(left.X[-1, ANGLES] / (2 * np.pi)))
    ended = replace(left, X=left.X + turns)
    goal = np.zeros(6)
    goal[ANGLES] = 2 * np.pi * np.round(ended.X[-1, ANGLES] / (2 * np.pi))
    start = starts_of(c, UP + goal, ended)[0]
    expected = regulator_rollout(c.belief.problem, UP).X + goal
    np.testing.assert_allclose(start.X, expected, atol=1e-8)


def test_on_another_turn_a_solve_is_the_same():
    c, x, left = after_a_plan()
    start, turn = starts_of(c, x, left)[0], np.zeros(6)
    turn[ANGLES] = 2 * np.pi, -2 * np.pi
    problem, solver = c.belief.problem, c.planner.solver
    goal = turns_of(problem, start.X[-1])
    assert goal.any()   # the goal is on another turn already
    plan = solved(solver, problem, x, start, math.inf, c.planner.build)
    assert plan.stats.cost <= policy_rollout(
        problem, x - goal, start.X - goal, start.U, start.K).J
    turned = solved(solver, problem, x + turn, replace(start, X=start.X + turn), math.inf,
                    c.planner.build)
    np.testing.assert_allclose(turned.X, plan.X + turn, atol=1e-6)
    np.testing.assert_allclose(turned.U, plan.U, atol=1e-6)


def test_the_paper_s_warm_start_is_forces_alone():
    c = controller(warm_start='forces')
    plan = c.update(0.0, FALLING)
    warm = starts_of(c, FALLING, c.planner.warm_start(0.1))[0]
    np.testing.assert_array_equal(warm.U, [*plan.U[2:], 0.0, 0.0])
    np.testing.assert_array_equal(warm.K, 0.0)


def test_over_a_long_horizon_others_are_solved_over_a_short_one():
    first, *others = starts_of(controller(horizon=60), HANGS)
    assert len(first.U) == 60
    assert [len(plan.U) for plan in others] == [30] * 5
    tops = [np.abs(np.cos(plan.X[-1, ANGLES]) - 1).max() for plan in others]
    assert min(tops) < 0.1                        # a solve, no draw, ends upright


def test_in_a_wild_state_there_are_as_many_starts_as_in_any():
    wild = np.array([0.0, 1.0, 2.0, 0.0, 1e160, 0.0])
    found = starts_of(controller(first_starts=4), wild)
    assert len(found) == 4 and not np.isfinite(found[-1].X).all()


@pytest.mark.parametrize('turn', [0.0, 2 * np.pi])
def test_the_bounded_lqr_of_a_whole_turn_is_the_same(turn):
    x = np.array([0.0, 0.2, 0.1, 0.0, 0.0, 0.0])
    x[ANGLES] += turn
    start = controller().planner.starts.bounded_lqr(x)
    np.testing.assert_allclose(start.X[0], x)
    np.testing.assert_allclose(start.X[-1, ANGLES], turn, atol=0.05)


def test_at_one_tick_a_step_the_last_plan_is_the_start():
    c, x, left = after_a_plan()
    np.testing.assert_array_equal(c.planner.warm_start(0.05).U, left.U)
    plan = c.update(0.05, x)
    np.testing.assert_array_equal(c.planner.warm_start(0.1).U, plan.U[1:])
