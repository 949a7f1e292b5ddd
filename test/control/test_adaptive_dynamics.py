# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Dynamics that are learned beside the equations: when they drive, and when no more."""

from learned_dynamics import BODIES as OF_EXPERIENCE, experience
import numpy as np
import pytest
from similar import sized, SMALLER

from dp_swing_ros.control import controllers
from dp_swing_ros.control.adaptive_dynamics import AdaptiveDynamics
from dp_swing_ros.control.commands import SentCommands
from dp_swing_ros.control.observer import prediction
from dp_swing_ros.dynamics.files import from_text
from dp_swing_ros.dynamics.priors import sizes
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.parameters import DIRECT
from dp_swing_ros.pendulum.units import SAME, STATES
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate

TOLD = {'link2_length': 1.3}   # of 1 m
WRONG = {'dynamics': 'adaptive', 'estimator': 'none', **TOLD}   # nobody estimates what is


def drives(controller):
    return controller.belief.problem.learned is not None


def watched(plant, values, duration):
    """Return controller and episode, and at which ticks what was learned drove."""
    c, ticks = controllers.controller(values), []
    run = simulate(plant, c, duration, on_tick=lambda *_: ticks.append(drives(c)))
    return c, run, ticks


def test_what_is_learned_drives_once_it_predicts_better_and_again_to_the_bit():
    (c, run, ticks), (_, again, _) = (watched(plants.plant({}), WRONG, 5.0) for _ in range(2))
    first = ticks.index(True)
    assert 19 < first < 60 and all(ticks[first:])
    np.testing.assert_array_equal(run.X, again.X)
    errors = c.observer.adaptive.errors
    assert errors.learned < errors.equations / 4
    assert 'learned dynamics have driven for' in c.observer.adaptive.words(5.0)
    assert c.belief.drive == c.observer.adaptive.drive and np.all(c.belief.balance == 0.0)


def test_until_then_the_run_is_that_of_the_equations():
    (_, run, ticks), (_, analytic, _) = (
        watched(plants.plant({}), {**WRONG, 'dynamics': each}, 3.0)
        for each in ('adaptive', 'analytic'))
    first = ticks.index(True)
    np.testing.assert_array_equal(run.U[:first], analytic.U[:first])
    assert run.U[first] != analytic.U[first]


def test_where_the_equations_are_right_they_drive():
    c, _, ticks = watched(plants.plant({}), {'dynamics': 'adaptive'}, 4.0)
    assert not any(ticks) and c.observer.adaptive.words(4.0) == ''
    assert c.observer.adaptive.count > 70


def test_it_goes_back_to_the_equations_where_these_predict_better():
    plant, c = plants.plant({}), controllers.controller(WRONG)
    simulate(plant, c, 8.0)
    assert drives(c)
    plant.reconfigure(plants.plant(TOLD))
    c.reconfigure(controllers.controller({**WRONG, 'goal': 'down_down'}))   # so that much moves
    simulate(plant, c, 4.0)
    assert not drives(c) and c.observer.adaptive.count > 200


def test_pushes_are_left_out_of_what_decides():
    plant, c = plants.plant({}), controllers.controller(WRONG)
    simulate(plant, c, 6.0)
    adaptive = c.observer.adaptive
    count, errors, R = adaptive.count, adaptive.errors, adaptive.learner.R.copy()
    simulate(plant, c, 2.0, pushes=np.where(np.arange(40) % 20 == 0, 15.0, 0.0))
    assert adaptive.count == count + 40 - 2 and drives(c)
    assert adaptive.errors.equations < 2 * errors.equations   # that of a push is 1000 times it
    assert np.all(adaptive.learner.R < 10 * R)


def refusing(duration=4.0):
    """Return a controller by which what was learned drives, and a state that it refuses."""
    told = {'dynamics': 'adaptive', **TOLD, **dict.fromkeys(
        ('ekf.body_error', 'ekf.inertia_error', 'ekf.gain_error', 'ekf.balance_error'), 0.0)}
    plant, c = plants.plant({}), controllers.controller(told)
    simulate(plant, c, duration)
    assert drives(c)
    return c, told, c.belief.x + np.array([0.0, 0.5, -0.5, 0.0, 0.0, 0.0])


def test_a_state_that_the_estimator_refuses_leaves_the_plan_to_what_was_learned():
    c, _, x = refusing()
    before, adaptive = c.belief, c.observer.adaptive
    count, t = adaptive.count, before.t + 0.05
    predicted = prediction(c.commands, before.problem, before.drive)(before.x, before.t, t)
    c.update(t, x)
    assert 'the estimator refuses it' in c.belief.rejection and adaptive.count == count
    assert drives(c) and c.belief.problem is before.problem and c.belief.drive == adaptive.drive
    np.testing.assert_array_equal(c.belief.x, predicted)
    assert c.belief.t == t


def test_a_live_change_leaves_the_plan_to_what_was_learned():
    c, told, x = refusing()
    before = c.belief
    c.reconfigure(controllers.controller({**told, 'force_weight': 0.002}))
    assert drives(c) and c.belief.problem.parameters.cost.force_weight == 0.002
    assert c.belief.drive == before.drive and np.all(c.belief.balance == 0.0)
    np.testing.assert_array_equal(c.belief.x, before.x)
    c.reconfigure(controllers.controller({**told, 'dynamics': 'analytic'}))
    assert not drives(c) and c.belief == c.observer.estimated


def test_a_reset_forgets_it():
    c, _, _ = watched(plants.plant({}), WRONG, 4.0)
    about = controllers.controller(WRONG).observer.adaptive
    c.reset()
    assert not drives(c) and c.observer.adaptive.count == 0
    np.testing.assert_array_equal(c.observer.adaptive.learner.p, about.learner.p)


def test_other_parameters_leave_what_was_learned():
    c, _, _ = watched(plants.plant({}), WRONG, 4.0)
    learned = c.observer.adaptive
    for other in {'horizon': 40}, {'estimator': 'ekf'}, {'estimator': 'ekf', 'ekf.gate': 50.0}:
        c.reconfigure(controllers.controller({**WRONG, **other}))
        simulate(plants.plant({}), c, 0.05)
        assert c.observer.adaptive is learned
    c.reconfigure(controllers.controller({**WRONG, 'link1_mass': 0.55}))
    assert c.observer.adaptive is not learned and not drives(c)
    c.reconfigure(controllers.controller({**WRONG, 'dynamics': 'analytic'}))
    assert c.observer.adaptive is None and not drives(c)


def test_what_was_learned_is_planned_with_elsewhere():
    c, _, _ = watched(plants.plant({}), WRONG, 5.0)
    text = c.observer.adaptive.model.to_text()
    assert from_text(text).about['seconds'] == pytest.approx(5.0, abs=0.2)
    other = controllers.controller({'dynamics': 'learned', 'model': text, 'estimator': 'none'})
    assert simulate(plants.plant({}), other, 6.0).errors[-1, 1:3] == pytest.approx(0.0, abs=0.1)


def test_the_force_gain_that_is_told_is_learned_with():
    """With half the gain, and all that moves half as heavy, it is the same."""
    c = controllers.controller({'dynamics': 'adaptive', 'force_gain': 0.5})
    usual = controllers.controller({'dynamics': 'adaptive'})
    np.testing.assert_allclose(c.observer.adaptive.learner.p / 2,
                               usual.observer.adaptive.learner.p)


def test_a_smaller_pendulum_is_learned_as_the_same_in_its_own_units():
    seen = experience(10.0)   # of links that are a tenth lighter than told

    def learned(scale):
        problem = controllers.problem({'dynamics': 'adaptive', **sized({
            **OF_EXPERIENCE, 'link1_mass': 0.55, 'link2_mass': 0.55}, scale)})
        adaptive, commands = AdaptiveDynamics(problem, DIRECT), SentCommands(scale)
        of_equations, drove = prediction(commands, problem, DIRECT), []
        for k, (x, u) in enumerate(zip(seen.X * scale.factors(STATES, 6),
                                       seen.U * scale.factor('N'))):
            t = 0.05 * k * scale.time
            adaptive.update(t, x, of_equations, commands)
            commands.add(t, u)
            drove.append(adaptive.drives)
        return adaptive, drove
    (usual, drove), (smaller, of_smaller) = learned(SAME), learned(SMALLER)
    assert drove == of_smaller and any(drove)
    np.testing.assert_allclose(smaller.errors, usual.errors, rtol=1e-3)
    np.testing.assert_allclose(smaller.learner.p, usual.learner.p * sizes(2, SMALLER), rtol=1e-3,
                               atol=1e-5)


def test_of_a_cart_that_is_driven_nothing_is_learned():
    with pytest.raises(ParameterError, match="'dynamics' is 'adaptive' with the drive 'velocity'"):
        controllers.controller({'dynamics': 'adaptive', 'drive': 'velocity'})


@pytest.mark.parametrize('spring', ['joint1_stiffness', 'joint2_preload'])
def test_beside_springs_nothing_is_learned(spring):
    with pytest.raises(ParameterError, match="'dynamics' is 'adaptive' with joint.* no springs"):
        controllers.controller({'dynamics': 'adaptive', spring: 0.1})
