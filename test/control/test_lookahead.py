# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The steps of plans that go with the period of states, and what is done between two solves."""

from itertools import islice
import math

from controllers import controller
import numpy as np
import pytest

from dp_swing_ros.control import controllers
from dp_swing_ros.control.lookahead import Lookahead
from dp_swing_ros.control.planner import search
from dp_swing_ros.pendulum.model import hold
from dp_swing_ros.pendulum.state import hanging
from dp_swing_ros.problem.parameters import PredictionParameters
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate

GIVEN = PredictionParameters()


def after(times, **values):
    lookahead = Lookahead(controllers.problem(values))
    for t in times:
        lookahead.add(t)
    return lookahead


@pytest.mark.parametrize('rate, step, horizon', [
    (20.0, 0.05, 30), (40.0, 0.05, 30), (60.0, 0.05, 30), (100.0, 0.05, 30), (1000.0, 0.05, 30),
    (30.0, 1 / 30, 45), (50.0, 0.04, 38), (66.0, 3 / 66, 33), (18.0, 1 / 18, 27)])
def test_a_step_is_as_many_periods_as_fit_into_the_given_one(rate, step, horizon):
    found = after(np.arange(12) / rate).prediction
    assert found.step == pytest.approx(step, rel=1e-9)
    assert found.horizon == horizon
    if abs(step - 0.05) < 1e-12:
        assert found == GIVEN   # to the bit


@pytest.mark.parametrize('rate, step', [
    (20.0, 0.05), (30.0, 1 / 30), (60.0, 2 / 60), (200.0, 0.035)])
def test_a_step_of_several_periods_is_fine_for_what_falls_fast(rate, step):
    assert after(np.arange(12) / rate, links=3).prediction.step == pytest.approx(step)


def test_without_any_states_the_step_is_the_given_one():
    assert after([]).prediction == after([0.0, 0.03]).prediction == GIVEN
    assert math.isnan(after([0.0, 0.03]).period)


def test_a_step_that_is_given_stays_as_it_is():
    found = after(np.arange(12) / 30.0, step=0.04, horizon=25).prediction
    assert (found.step, found.horizon) == (0.04, 25)
    of_small = {'link1_length': 0.25, 'link2_length': 0.25}   # whose default is 0.025 s
    assert after(np.arange(12) / 90.0, **of_small).prediction.step == pytest.approx(2 / 90)
    assert after(np.arange(12) / 90.0, **of_small, step=0.05).prediction.step == 0.05


def test_states_that_come_unevenly_or_get_lost_change_no_step(rng):
    times = np.delete(np.arange(300) / 30.0 + rng.normal(0.0, 1e-3, 300), rng.integers(9, 300, 30))
    lookahead = after([])
    found = []
    for t in np.sort(times):
        lookahead.add(t)
        found.append(lookahead.prediction.step)
    assert len(set(found[40:])) == 1   # before, the period becomes known better
    assert found[-1] == pytest.approx(1 / 30, rel=0.05)


@pytest.mark.parametrize('per_step', [1.9, 1.95, 2.0])   # where one or two periods fit
def test_between_two_numbers_of_periods_it_does_not_go_to_and_fro(per_step, rng):
    lookahead, steps, t = after([]), [], 0.0
    for _ in range(500):
        t += 0.05 / per_step * (1 + rng.normal(0.0, 0.03))
        lookahead.add(t)
        steps.append(lookahead.prediction.step)
    assert len(set(steps[10:])) <= 2


def test_another_period_gives_other_steps():
    times = np.concatenate((np.arange(12) / 30.0, 11 / 30.0 + np.arange(1, 40) / 20.0))
    assert after(times).prediction.step == pytest.approx(0.05)


def test_a_period_in_which_it_falls_too_far_is_warned_of():
    assert after(np.arange(40) / 20.0).warning == ''
    assert after(np.arange(40) / 10.0).warning == (
        'states are answered every 100 ms, while the pendulum falls 2.2 times as far; expected '
        'one at least every 78.2 ms, 12.8 Hz')


def test_a_period_that_no_step_can_have_is_no_failure():
    c = controller(estimator='none')
    for n in range(20):
        assert np.isfinite(c.update(3.0 * n, hanging() + 1e-3 * n).U).all()


@pytest.mark.parametrize('solver', ['ilqr', 'ddp', 'mppi'])
def test_one_state_a_step_is_solved_for_and_the_others_get_feedback(solver):
    c, statuses = controller(solver), []
    plant = plants.plant({'rate': 100.0})
    simulate(plant, c, 1.0, on_tick=lambda t, plan: statuses.append(plan.stats.status))
    solved = [n for n, status in enumerate(statuses) if status is not Status.FEEDBACK]
    assert solved == list(range(0, 100, 5))


def test_between_two_solves_the_force_is_held_and_what_is_off_is_fed_back():
    c = controller(estimator='none')
    x = hanging() + np.array([0.0, 0.3, -0.2, 0.1, 0.5, 0.0])
    plan = c.update(0.0, x)
    fine = plan.X[0]
    for n in range(1, 5):
        fine = hold(c.belief.problem.model._replace(h=0.001), x, plan.U[0], 0.01 * n)
        feedback = c.update(0.01 * n, fine)
        assert feedback.stats.status is Status.FEEDBACK
        # as planned but for what a step of 50 ms is integrated less finely
        assert feedback.U[0] == pytest.approx(plan.U[0], abs=0.02 * c.nominal.u_max)
    off = fine + np.array([0.0, 0.01, 0.0, 0.0, 0.0, 0.0])
    again = c.update(0.041, off)
    assert again.U[0] - plan.U[0] == pytest.approx(0.01 * plan.K[0, 1], rel=0.3)


def test_starts_that_there_was_no_time_for_are_made_up_for_in_between():
    """As where there is time for one plan a search: most of the six starts of the first tick."""
    c, ticks = controller('mppi'), []
    c.planner.search = lambda planner, x_0, starts, deadline: search(
        planner, x_0, islice(starts, 1), deadline)
    simulate(plants.plant({'rate': 100.0}), c, 0.2, on_tick=lambda t, plan: ticks.append(plan))
    stats = [plan.stats for plan in ticks]
    others = [n for n, tick in enumerate(stats) if tick.candidates
              and tick.candidates[0].start != 'last_plan']
    assert others[:5] == [0, 1, 2, 3, 4] and len(others) > 7
    for n in others[1:]:
        candidate, = stats[n].candidates
        assert stats[n].cost <= candidate.cost
        assert (stats[n].cost == candidate.cost) is (stats[n].status is not Status.FEEDBACK)
    assert {stats[n].status is Status.FEEDBACK for n in others[1:]} == {True, False}


def test_what_could_not_be_solved_is_solved_for_the_next_state():
    c = controller(estimator='none')
    c.update(0.0, hanging())
    c.fallback(0.01)
    assert c.update(0.02, hanging()).stats.status is not Status.FEEDBACK


def test_a_reset_forgets_the_period():
    c = controller()
    simulate(plants.plant({'rate': 30.0}), c, 1.0)
    assert c.nominal.dt == pytest.approx(1 / 30)
    assert c.belief.problem.dt == c.planner.solver.problem.dt == c.nominal.dt
    c.reset()
    assert c.nominal.dt == c.belief.problem.dt == c.planner.solver.problem.dt == 0.05


def test_where_no_plan_comes_to_the_goal_plans_are_lengthened_until_it_is_there():
    """From hanging, with link 2 alone down; 30 steps are too few."""
    c, seen = controllers.controller({'goal': 'up_down'}), []

    def on_tick(t, plan):
        seen.append((len(plan.U), c.belief.problem.is_reached(c.belief.x)))
    simulate(plants.plant({}), c, 10.0, on_tick=on_tick)
    lengths, there = zip(*seen)
    assert lengths[0] == lengths[-1] == 30 and {*lengths} <= {30, 40, 53} and 40 in lengths
    assert all(there[-40:])


@pytest.mark.parametrize('values', [{'horizon': 30}, {'longest_horizon': 30}])
def test_a_horizon_that_is_given_stays(values):
    c, lengths = controllers.controller({'goal': 'up_down', **values}), set()
    simulate(plants.plant({}), c, 4.0, on_tick=lambda t, plan: lengths.add(len(plan.U)))
    assert lengths == {30}


def test_who_is_disabled_looks_no_further():
    c = controller(enabled=False)
    for n in range(60):
        c.update(0.05 * n, hanging() + 1e-3 * n)
    assert c.lookahead.steps == 30


def test_a_body_that_changes_leaves_the_step_fitted():
    c = controllers.controller({})
    simulate(plants.plant({'rate': 30.0}), c, 1.0)
    assert c.nominal.dt == pytest.approx(1 / 30)
    # as a node has it: all values, of which one is another
    c.reconfigure(controllers.controller({**controllers.MPC.complete({}), 'link1_mass': 0.6}))
    assert c.nominal.dt == c.belief.problem.dt == pytest.approx(1 / 30)
    c.reconfigure(controllers.controller({**controllers.MPC.complete({}), 'step': 0.04}))
    assert c.nominal.dt == 0.04


def test_another_solver_keeps_a_longer_plan():
    c = controllers.controller({'goal': 'up_down'})
    plant = plants.plant({})
    simulate(plant, c, 4.0)
    assert c.nominal.horizon > 30
    c.reconfigure(controllers.controller({'goal': 'up_down', 'solver': 'ddp'}))
    assert c.nominal.horizon > 30


@pytest.mark.parametrize('warm_start', ['policy', 'forces'])
def test_plans_get_shorter_again(warm_start):
    c = controllers.controller({'warm_start': warm_start})
    c.update(0.0, hanging())
    c.lookahead.steps = 53
    c.lookahead.arrived = 0.0
    assert len(c.update(0.05, hanging() + 1e-3).U) == 53
    c.lookahead.steps = 30
    assert len(c.update(0.1, hanging() + 2e-3).U) == 30


def test_feedback_after_a_turn_costs_what_the_plan_did():
    """The goal of a plan may be on another turn; so it is for its feedback."""
    c, plans = controllers.controller({'estimator': 'none'}), []
    x = hanging()
    x[2] += 4 * np.pi
    simulate(plants.plant({'rate': 100.0, 'initial_state': x.tolist()}), c, 3.0,
             on_tick=lambda t, plan: plans.append(plan))
    assert np.any(plans[-1].turns)
    for before, after in zip(plans[200:], plans[201:]):
        np.testing.assert_array_equal(np.broadcast_to(after.turns, 6) % (2 * np.pi), 0.0)
        assert after.stats.cost <= 1.5 * before.stats.cost + 1.0
