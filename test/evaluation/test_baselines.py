# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
import dataclasses

import numpy as np
import pytest

from dp_swing_ros.control import controllers
from dp_swing_ros.evaluation.baselines import BASELINES, stabilised, swing_up, TVLQR
from dp_swing_ros.evaluation.metrics import measure, WITHOUT_SOLVE
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.equations import energy
from dp_swing_ros.pendulum.state import hanging, is_upright
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate

PROBLEM = controllers.problem({})


@pytest.fixture(scope='module')
def reference():
    return swing_up(PROBLEM)


def test_the_swing_up_goes_from_hanging_to_upright_with_force_to_spare(reference):
    plan = reference.plan
    np.testing.assert_array_equal(plan.X[0], hanging())
    assert is_upright(plan.X[-1])
    assert np.abs(plan.U).max() <= 0.8 * 20.0 + 1e-9


def test_gains_of_the_goal_are_those_of_the_infinite_horizon(reference):
    steps = 30
    at_goal = dataclasses.replace(
        reference.plan, X=np.zeros((steps + 1, 6)), U=np.zeros(steps), K=np.zeros((steps, 6)))
    found = stabilised(PROBLEM, at_goal)
    np.testing.assert_allclose(found.plan.K, np.tile(-PROBLEM.lqr.K, (steps, 1)), rtol=1e-6)
    np.testing.assert_allclose(found.V, PROBLEM.lqr.P, rtol=1e-6)


def test_tvlqr_swings_up_and_holds(reference):
    metrics = measure(simulate(plants.plant({}), TVLQR(PROBLEM, reference), 6.0))
    assert metrics.success
    assert metrics.largest_force <= 20.0


def test_feedback_keeps_it_on_the_swing_up_that_forces_alone_leave(reference):
    disturbed = plants.plant({'force_noise': 0.5, 'seed': 1})
    deaf = reference._replace(
        plan=dataclasses.replace(reference.plan, K=np.zeros_like(reference.plan.K)))
    assert measure(simulate(disturbed, TVLQR(PROBLEM, reference), 6.0)).success
    disturbed.reset()
    assert not measure(simulate(disturbed, TVLQR(PROBLEM, deaf), 6.0)).success


@pytest.mark.parametrize('turns', [0, 1, -2])
def test_a_start_near_the_goal_is_regulated_at_once(turns, reference):
    x = [0.0, 0.02 + 2 * np.pi * turns, 0.02, 0.0, 0.0, 0.0]
    plant = plants.plant({'initial_state': x})
    metrics = measure(simulate(plant, TVLQR(PROBLEM, reference), 3.0))
    assert metrics.success
    assert metrics.largest_angle < 0.1


def test_near_is_what_costs_the_regulators_less(reference):
    x = np.array([0.0, 0.3, 0.3, 0.0, 0.0, 0.0])
    assert TVLQR(PROBLEM, reference).skips(x)
    assert not TVLQR(PROBLEM, reference).skips(hanging())
    assert not TVLQR(PROBLEM, reference._replace(V=1e-9 * reference.V)).skips(x)


def test_a_swing_up_of_another_turn_is_the_same(reference):
    turns = np.array([0.0, 2 * np.pi, -2 * np.pi, 0.0, 0.0, 0.0])
    here, there = (TVLQR(PROBLEM, reference).update(0.0, hanging() + more, 0.0)
                   for more in (0 * turns, turns))
    np.testing.assert_allclose(there.U, here.U, atol=1e-6)
    np.testing.assert_allclose(there.X, here.X + turns, atol=1e-6)


def test_without_a_state_it_goes_on_with_what_it_predicted(reference):
    controller = TVLQR(PROBLEM, reference)
    plan = controller.update(0.0, hanging(), 0.0)
    blind = controller.fallback(0.05)
    assert blind.stats.status is Status.LAST_POLICY
    np.testing.assert_allclose(blind.U[0], plan.U[1])
    for n in range(2, 100):
        assert np.all(np.isfinite(controller.fallback(0.05 * n).X))


@pytest.mark.parametrize('name', BASELINES)
def test_a_state_may_be_lost_before_the_first(name):
    controller = BASELINES[name]({})(0)
    assert controller.fallback(0.0).first_force(20.0) == 0.0


@pytest.mark.parametrize('name', BASELINES)
def test_a_baseline_closes_the_loop_of_a_plant_that_loses_messages(name):
    plant = plants.plant({'state_loss': 0.3, 'command_loss': 0.3, 'delay': 0.04})
    episode = simulate(plant, BASELINES[name]({})(0), 2.0)
    assert np.all(np.isfinite(episode.X))
    assert measure(episode).stand_ins > 0 or name == 'nothing'
    ticks = episode.ticks
    stands_in = [status in WITHOUT_SOLVE for status in ticks.status]
    assert not ticks.solve_time[stands_in].any()   # its time is not that of a solve


def test_the_estimator_keeps_a_swing_up_on_its_way_that_noise_leads_astray():
    def held(name):
        make = BASELINES[name]({})
        return sum(measure(simulate(plants.plant(
            {'velocity_noise': 0.2, 'seed': seed}), make(seed), 6.0)).success
            for seed in range(4))
    assert held('tvlqr') < held('tvlqr_ekf') == 4


def test_the_energy_comes_to_that_of_upright():
    controller = BASELINES['energy_ekf']({})(0)
    episode = simulate(plants.plant({}), controller, 10.0)
    p = PROBLEM.model.pendulum
    still = np.where(np.arange(6) == 3, 0.0, episode.X)   # in the frame of the cart
    energies = [energy(p, x) for x in still.tolist()]
    lacking = energy(p, hanging().tolist()) - energy(p, [0.0] * 6)
    assert energies[0] == pytest.approx(energy(p, hanging().tolist()))
    reached = np.abs(np.array(energies[100:]) - energy(p, [0.0] * 6))
    assert np.median(reached) < 0.2 * abs(lacking)
    assert measure(episode).strikes == 0


def test_nothing_does_nothing():
    episode = simulate(plants.plant({}), BASELINES['nothing']({})(0), 2.0)
    np.testing.assert_array_equal(episode.U, 0.0)


def test_a_swing_up_that_cannot_be_is_refused():
    with pytest.raises(ParameterError, match='no swing-up'):
        swing_up(controllers.problem({'force_limit': 1.0}))
