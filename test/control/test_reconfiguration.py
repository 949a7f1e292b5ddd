# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A controller goes on with other parameters: what is kept, and that nothing falls."""

from itertools import pairwise

from learned_dynamics import model_of, of_chain
import numpy as np
import pytest

from dp_swing_ros.control import controllers
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import angles, errors, is_upright
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate
from dp_swing_ros.solvers import SOLVERS

LEANING = np.array([0.1, 0.02, -0.01, 0.0, 0.05, 0.0])
# one after the other, each on top of those before
CHANGES = [
    {'state_weights': (30.0, 50.0, 100.0, 2.0, 6.0, 0.1)}, {'force_weight': 0.01},
    {'horizon': 50}, {'step': 0.04}, {'horizon': 20}, {'step': 0.05, 'horizon': 30},
    {'force_limit': 12.0}, {'track_limit': 1.5}, {'estimator': 'none'}, {'estimator': 'ekf'},
    {'first_starts': 2, 'other_starts': 3}, {'model': 'euler'},
    {'model': 'rk4'}, {'link1_mass': 0.55}, {'ekf.gate': 20.0}, {'seed': 3},
    {'longest_horizon': 40}, {'terminal_cost': 'scaled'}, {'terminal_cost': 'lqr'},
    {'reference': (0.5, 0.0, 0.0, 0.0, 0.0, 0.0)}, {'reference': (0.0,) * 6}]


def balanced(solver='ilqr', **values):
    """Return a controller that holds the pendulum, and the plant."""
    c = controllers.controller({'solver': solver, **values})
    p = plants.plant({'initial_state': LEANING.tolist()})
    simulate(p, c, 1.0)
    return c, p


def go_on(c, p, duration):
    """Go on with the same run for a time [s]; return states and plans."""
    X, plans = [], []
    for _ in range(round(duration / 0.05)):
        plan = c.update(round(p.t * 1e9) / 1e9, p.measure().x)
        p.obey(plan.first_force(20.0))
        p.begin_period(0.0)
        p.advance(0.05)
        X.append(p.x.copy())
        plans.append(plan)
    return np.array(X), plans


@pytest.mark.parametrize('solver', sorted(SOLVERS))
def test_the_same_parameters_again_change_nothing(solver):
    (c, p), (other, q) = balanced(solver), balanced(solver)
    for _ in range(3):
        other.reconfigure(controllers.controller({'solver': solver}))
        for X, Y in zip(*(go_on(*one, 0.2)[0] for one in ((c, p), (other, q)))):
            np.testing.assert_array_equal(X, Y)


def test_what_changes_counts_in_the_next_plan():
    c, p = balanced()
    c.reconfigure(controllers.controller({'horizon': 45, 'force_weight': 0.5, 'step': 0.04}))
    _, (plan, *_) = go_on(c, p, 0.05)
    assert (len(plan.U), plan.dt) == (45, 0.04)
    assert c.belief.problem.cost.R == 0.5


@pytest.mark.parametrize('values', [{}, {'step': 0.03}, {'horizon': 10}, {'solver': 'ddp'}])
def test_the_last_plan_is_the_start_of_the_next(values):
    c, p = balanced()
    before = c.planner.warm_start(p.t).U[0]
    c.reconfigure(controllers.controller(values))
    left = c.planner.warm_start(p.t)
    assert left.U[0] == pytest.approx(before, abs=2e-3)   # in other steps, interpolated
    start = next(c.planner.starts.of(c.belief.x, left))
    # which may cost less than what is left
    assert start.start == 'regulator' or np.array_equal(start.U, left.U)


@pytest.mark.parametrize('values, kept', [
    ({'force_weight': 0.01}, True), ({'solver': 'mppi'}, True), ({'horizon': 40}, True),
    ({'link1_mass': 0.6}, False), ({'actuation_delay': 0.01}, False), ({'ekf.gate': 5.0}, False),
    ({'estimator': 'none'}, False)])
def test_what_is_believed_goes_on_unless_something_else_is_told(values, kept):
    c, p = balanced()
    estimator = c.observer.estimator
    c.reconfigure(controllers.controller(values))
    assert (c.observer.estimator is estimator) is kept
    assert c.belief.problem.physical.link1_mass == pytest.approx(
        values.get('link1_mass', 0.5), rel=0.05)
    go_on(c, p, 0.2)
    assert (c.belief.estimate is None) is (values.get('estimator') == 'none')


def test_what_is_learned_of_the_pendulum_is_kept():
    c = controllers.controller({})
    p = plants.plant({'link2_mass': 0.65})
    simulate(p, c, 4.0)
    learned = c.belief.problem.physical
    assert learned.link2_mass > (0.5 + 0.65) / 2   # nearer to what is than to what was told
    c.reconfigure(controllers.controller({'solver': 'ddp', 'horizon': 40}))
    assert c.belief.problem.physical == learned


def test_another_learned_model_changes_nothing_that_is_believed_of_the_state():
    models = [model_of(of_chain(PendulumParameters(link2_mass=mass))).to_text()
              for mass in (0.5, 0.55)]
    runs = []
    for then in models:
        c = controllers.controller({'dynamics': 'learned', 'model': models[0]})
        p = plants.plant({'initial_state': LEANING.tolist(), 'force_bias': 2.0})
        simulate(p, c, 2.0)
        before = c.belief.estimate
        c.reconfigure(controllers.controller({'dynamics': 'learned', 'model': then}))
        X, plans = go_on(c, p, 0.05)
        assert np.abs(c.belief.estimate.x - before.x).max() < 0.1
        assert c.belief.estimate.drive.bias == pytest.approx(2.0, abs=0.5)
        runs.append(plans[0].U)
    assert not np.array_equal(*runs)   # but with the other it plans


def test_enabled_counts_where_it_changes_alone():
    c, p = balanced()
    c.enable(False)
    c.reconfigure(controllers.controller({'horizon': 40}))
    assert not c.enabled
    c.enable(True)
    c.reconfigure(controllers.controller({'horizon': 40, 'enabled': False}))
    assert go_on(c, p, 0.05)[1][0].stats.status is Status.DISABLED


def test_a_seed_begins_its_random_numbers():
    runs = []
    for seeds in ((0, 5, 5), (0, 5), (5,)):
        c = controllers.controller({'seed': seeds[0]})
        for seed in seeds[1:]:
            c.reconfigure(controllers.controller({'seed': seed}))
        runs.append(c.planner.starts.draw(5))
    np.testing.assert_array_equal(runs[0], runs[1])
    np.testing.assert_array_equal(runs[0], runs[2])


@pytest.mark.parametrize('solver', sorted(SOLVERS))
def test_it_is_held_through_all_changes(solver):
    c, p = balanced(solver)
    values = {'solver': solver}
    for change in CHANGES:
        values |= change
        c.reconfigure(controllers.controller(values))
        X, plans = go_on(c, p, 0.5)
        assert np.abs(X[:, angles(c.belief.x)]).max() < 0.2, (change, values)
        assert not {plan.stats.status for plan in plans} & {Status.ZERO, Status.REGULATOR}, change


def test_it_is_held_through_all_solvers():
    c, p = balanced()
    for before, solver in pairwise([*sorted(SOLVERS), *sorted(SOLVERS, reverse=True)]):
        c.reconfigure(controllers.controller({'solver': solver}))
        assert np.abs(go_on(c, p, 0.25)[0][:, angles(c.belief.x)]).max() < 0.05, (before, solver)


@pytest.mark.parametrize('solver', sorted(SOLVERS))
def test_one_change_leads_to_another_equilibrium(solver):
    c, p = balanced(solver, horizon=40)
    for goal in ('down_down', 'up_up'):
        c.reconfigure(controllers.controller({'solver': solver, 'horizon': 40, 'goal': goal}))
        X, _ = go_on(c, p, 5.0)
        assert is_upright(errors(X[-20:], c.belief.problem.x_r)).all(), goal
