# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From random forces to a pendulum that is held, in simulation."""

import math

from learned_dynamics import BODIES, USUAL
import numpy as np
import pytest
from similar import sized, SMALLER

from dp_swing_ros.control import controllers
from dp_swing_ros.evaluation.metrics import measure
from dp_swing_ros.learning.learner import Explorer, Learner
from dp_swing_ros.learning.trials import held_for, trials
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.units import SAME, STATES
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate

NOISY = {**BODIES, **USUAL, 'position_noise': 0.01, 'velocity_noise': 0.01}
DEFAULT = {'cart_mass': 1.0, 'link1_mass': 0.5, 'link2_mass': 0.5, 'link1_length': 1.0,
           'link2_length': 1.0}


def learner(**values):
    return Learner({'estimator': 'none', 'solver': 'mppi', **values}, 5.0)


@pytest.fixture(scope='module')
def held():
    """Return a learner, and its trial without a break until it is held."""
    one = learner()
    trial, = trials(one, NOISY, math.inf, 15.0, 2.0)
    return one, trial


def test_it_is_held_within_some_seconds_of_experience_and_again_to_the_bit(held):
    """Nothing of the bodies is told: those of the mpc are others."""
    (_, trial), (again,) = held, trials(learner(), NOISY, math.inf, 15.0, 2.0)
    assert trial.held >= 2.0 and trial.experience[-1] <= 15.0
    assert np.all(trial.deviation[trial.experience < 5.0] > 0.5)   # random forces do not hold it
    np.testing.assert_array_equal(trial.deviation, again.deviation)


def test_trials_begin_hanging_and_end_with_one_that_holds():
    found = list(trials(learner(seed=1), {**NOISY, 'seed': 1}, 5.0, 30.0, 1.0))
    assert len(found) > 1
    assert [trial.number for trial in found] == list(range(1, len(found) + 1))
    assert all(trial.deviation[0] > 3.0 for trial in found)
    assert [trial.held >= 1.0 for trial in found] == [False] * (len(found) - 1) + [True]
    assert not len(found[0].noise) and np.all(found[-1].noise < 0.2)


def test_it_ends_with_the_experience_that_is_allowed():
    one = learner()
    found = list(trials(one, NOISY, 2.0, 5.0, 1.0))
    assert sum(trial.held >= 1.0 for trial in found) == 0
    assert 4.5 < one.duration <= 5.0


def test_what_is_learned_is_planned_with_by_an_mpc(held, tmp_path):
    one, _ = held
    (tmp_path / 'model.json').write_text(one.model.to_text())
    control = controllers.controller({
        'dynamics': 'learned', 'model': str(tmp_path / 'model.json'), 'solver': 'ddp'})
    assert measure(simulate(plants.plant({**BODIES, **USUAL}), control, 8.0)).success


@pytest.mark.parametrize('bodies', [{}, BODIES, {'cart_mass': 3.0, 'link1_mass': 1.0}])
def test_random_forces_keep_off_the_ends_of_the_track(bodies):
    explorer, plant = Explorer(20.0, np.random.default_rng(0)), plants.plant({**bodies, **USUAL})
    places, forces = [], []
    for _ in range(400):
        forces.append(explorer.force(plant.measure().x, 0.05))
        plant.obey(forces[-1])
        plant.begin_period(0.0)
        plant.advance(0.05)
        places.append(plant.x[0])
    assert np.abs(places).max() < 2.3
    assert np.abs(forces).max() <= 20.0 and np.std(forces) > 8.0


def test_random_forces_are_as_slow_at_any_rate():
    def correlation(period, later):
        explorer = Explorer(20.0, np.random.default_rng(0))
        forces = [explorer.force(np.zeros(6), period) for _ in range(4000)]
        return np.corrcoef(forces[:-later], forces[later:])[0, 1]
    assert correlation(0.01, 5) == pytest.approx(correlation(0.05, 1), abs=0.1)


def test_a_smaller_pendulum_is_learned_as_the_same_in_its_own_units():
    def learned(scale):
        bodies = sized({**DEFAULT, 'cart_friction': 0.1}, scale)
        one, period = Learner(bodies), 0.05 * scale.time
        one.begin(period)
        simulate(plants.plant({**bodies, 'rate': 1 / period}), one, 102 * period)
        assert one.controller is not None and one.duration == pytest.approx(101 * period)
        return one
    usual, smaller = learned(SAME), learned(SMALLER)
    np.testing.assert_allclose([x for x, *_ in smaller.experience], [
        x * SMALLER.factors(STATES, 6) for x, *_ in usual.experience], rtol=1e-9, atol=1e-9)
    of_usual, deviations = usual.model.dynamics.free, usual.online.prior.deviations
    off = smaller.model.dynamics.sized(SMALLER.inverse).free - of_usual
    assert np.abs(off / deviations).max() < 1e-6 < np.abs(of_usual / deviations).max()
    np.testing.assert_allclose(
        smaller.noise, usual.noise * SMALLER.factors('m/s, rad/s', 3), rtol=1e-6)


def test_the_time_held_is_that_at_the_end():
    assert held_for(np.array([0.1, 0.1, 0.5, 0.1, 0.1]), 0.05) == pytest.approx(0.1)
    assert held_for(np.array([0.1, 0.1, np.nan]), 0.05) == 0.0


def test_without_a_limit_random_forces_are_those_of_default_bodies():
    explorer = Explorer(math.inf, np.random.default_rng(0))
    forces = np.abs([explorer.force(np.zeros(6), 0.05) for _ in range(100)])
    assert 1.0 < forces.mean() and forces.max() <= 20.0
    assert held_for(np.array([0.1, 0.5]), 0.05) == 0.0
    assert held_for(np.array([0.1, 0.1]), 0.05) == pytest.approx(0.1)


def test_what_cannot_be_is_refused():
    with pytest.raises(ParameterError, match='force_limit'):
        Learner({'force_limit': 0.0})
    with pytest.raises(ParameterError, match='unknown parameter'):
        Learner({'force': 0.0})
