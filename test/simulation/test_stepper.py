# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

from controllers import plant
import numpy as np
import pytest

from dp_swing_ros.simulation.stepper import Stepper

FAULTS = {'position_noise': 1e-3, 'force_noise': 1.0, 'command_loss': 0.3, 'state_loss': 0.3,
          'delay': 0.03, 'command_jitter': 0.02}


def by_hand(p, n, late):
    """Take a plant through a period; return what was measured, and whether it heard the force."""
    measured, force = p.measure(), p.mean_force
    p.begin_period(float(n % 3))
    p.advance(late)
    heard = p.obey(float(n))
    p.advance(0.05 - late)
    return measured, force, heard


@pytest.mark.parametrize('late', [0.0, 0.012])
def test_a_period_is_measured_pushed_late_obeyed_and_advanced(late):
    p, other = plant(3, **FAULTS), plant(3, **FAULTS)
    stepper, lost = Stepper(other), 0
    for n in range(60):
        measured, force, heard = by_hand(p, n, late)
        observation = stepper.begin(float(n % 3))
        assert (observation is None) is (measured is None)
        if observation is not None:
            assert (observation.t, observation.force) == (measured.t, force)
            np.testing.assert_array_equal(observation.x, measured.x)
        assert stepper.finish(float(n), late) is heard
        lost += not heard
    np.testing.assert_array_equal(p.x, other.x)
    assert 5 < lost < 55


def test_without_a_force_the_one_before_acts_on():
    stepper = Stepper(plant())
    for force in (2.0, None):
        stepper.begin()
        assert stepper.finish(force)
    assert stepper.begin().force == 2.0


def test_a_period_lasts_as_long_as_the_plant_says_now():
    stepper = Stepper(plant())
    stepper.begin()
    stepper.plant.reconfigure(plant(rate=100.0))
    stepper.finish(0.0)
    assert stepper.plant.t == pytest.approx(0.01)
