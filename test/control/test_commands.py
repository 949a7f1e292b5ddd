# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The commands that were sent: what they do to a state until a later time."""

import math

from controllers import controller
import numpy as np
import pytest

from dp_swing_ros.control.commands import SentCommands, SentVelocity
from dp_swing_ros.pendulum.model import hold
from dp_swing_ros.pendulum.parameters import DIRECT, Drive
from dp_swing_ros.pendulum.state import hanging

X = hanging() + np.array([0.1, 0.2, -0.1, 0.3, -0.2, 0.1])


@pytest.fixture
def model():
    return controller().nominal.model._replace(h=0.01)


def held(model, x, *commands):
    """Return a state after commands [N], each for a time [s]."""
    for force, duration in commands:
        x = hold(model, x, force, duration)
    return x


def sent(*commands):
    """Return what remembers commands [N] from times on [s]."""
    found = SentCommands()
    for t, force in commands:
        found.add(t, force)
    return found


def test_each_command_holds_until_the_next(model):
    x, force = sent((0.0, 5.0), (0.1, -3.0)).predict(model, DIRECT, X, 0.05, 0.2)
    np.testing.assert_allclose(x, held(model, X, (5.0, 0.05), (-3.0, 0.1)), atol=1e-9)
    assert force == -3.0


def test_before_the_first_there_is_no_force(model):
    x, _ = sent((1.0, 9.0)).predict(model, DIRECT, X, 0.0, 0.3)
    np.testing.assert_allclose(x, held(model, X, (0.0, 0.3)), atol=1e-9)


def test_what_was_sent_later_replaces_what_was_to_act_from_then_on():
    commands = sent((0.0, 1.0), (0.2, 2.0), (0.1, 3.0))
    assert commands.last(0.5) == (3.0, 0.1)
    assert commands.last(0.1) == (1.0, 0.0)


def test_what_is_forgotten_leaves_the_command_before():
    commands = sent(*((0.1 * n, float(n)) for n in range(100)))
    assert len(commands.times) < 20
    assert commands.last(-1.0)[0] == commands.forces[0] - 1.0


@pytest.mark.parametrize('drive', [DIRECT, DIRECT._replace(gain=0.7, bias=1.5)])
def test_a_command_counts_from_when_it_acts(model, drive):
    belief = controller(estimator='none').observer.belief._replace(t=0.0, x=X, drive=drive)
    x_0 = sent((-1.0, 4.0)).compensate(belief, 0.07)
    np.testing.assert_allclose(
        x_0, held(model, X, (drive.gain * 4.0 + drive.bias, 0.07)), atol=1e-9)


def test_one_that_comes_late_is_made_up_for(model):
    drive = Drive(**{**DIRECT._asdict(), 'delay': 0.1})
    belief = controller(estimator='none').observer.belief._replace(t=0.0, x=X, drive=drive)
    x_0 = sent((-1.0, 0.0), (0.02, 6.0)).compensate(belief, 0.05)
    # what was sent for 0.02 acts from 0.12 on; what is sent for 0.05, from 0.15 on
    np.testing.assert_allclose(x_0, held(model, X, (0.0, 0.12), (6.0, 0.03)), atol=1e-9)


def test_before_a_first_state_nothing_is_known():
    belief = controller().observer.belief
    assert np.all(np.isnan(SentCommands().compensate(belief, 1.0)))


def test_a_velocity_is_the_integral_of_accelerations_within_what_the_drive_can_do():
    reached = SentVelocity(t=1.0, before=0.2, velocity=0.5, lasts=0.05, u_max=20.0)
    assert reached.acceleration == pytest.approx(6.0)
    assert reached.afterwards == [(pytest.approx(1.05), 0.0)]
    late = reached._replace(velocity=2.2)   # 2 m/s more, of which 1 m/s can be had in its time
    assert late.acceleration == pytest.approx(20.0)
    (begins, rest), (ends, none) = late.afterwards
    assert (begins, rest) == (pytest.approx(1.05), 20.0)
    assert (ends, none) == (pytest.approx(1.10), 0.0)
    assert late.at(1.075) == pytest.approx(1.7)
    assert late.at(9.0) == pytest.approx(2.2)


def test_a_drive_that_was_told_to_stop_is_taken_to_stand(model):
    commands = SentCommands()
    commands.add_velocity(SentVelocity(0.0, 0.5, 0.0, 0.0, 20.0))
    x, _ = commands.predict(model, DIRECT, X, 0.01, 0.02)
    still = np.where(np.arange(6) == 3, 0.0, X)
    np.testing.assert_allclose(x, held(model, still, (0.0, 0.01)), atol=1e-9)


def test_a_run_goes_on_from_a_velocity_that_nobody_measures():
    commands = SentCommands(sent=SentVelocity(2.0, 0.0, 0.3, 0.05, 20.0))
    commands.begin(1.0, math.nan)   # the clock has gone back
    assert commands.sent is None
    commands = SentCommands(sent=SentVelocity(2.0, 0.0, 0.3, 0.05, 20.0))
    commands.begin(3.0, math.nan)
    assert commands.sent is not None
    commands.begin(3.0, 0.1)
    assert commands.sent is None
