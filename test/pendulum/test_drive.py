# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The drive against its differential equation, integrated by another."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dp_swing_ros.pendulum.drive import follow_commands, lagged
from dp_swing_ros.pendulum.equations import derivative, Pendulum
from dp_swing_ros.pendulum.integrators import INTEGRATORS
from dp_swing_ros.pendulum.model import hold, Model
from dp_swing_ros.pendulum.parameters import DIRECT, Drive, DriveParameters, PendulumParameters

MODEL = Model(Pendulum.of(PendulumParameters(cart_friction=0.2)), INTEGRATORS['rk4'], 1e-3)
START = np.array([0.1, 2.0, -1.0, 0.5, 2.0, -3.0])
# two that ended before, one that spans the beginning, and two that end in the middle
ENDS = np.array([-0.12, -0.03, 0.0137, 0.0612, math.inf])
COMMANDS = np.array([9.0, -6.0, 14.0, -11.0, 5.0])
DRIVES = {
    'direct': DIRECT, 'delay': Drive(delay=0.0231), 'lag': Drive(time_constant=0.03),
    'gain': Drive(gain=0.7), 'bias': Drive(bias=2.5),
    'long': Drive(delay=0.3), 'all': Drive(0.0231, 0.03, 1.2, -1.5)}

of_drives = pytest.mark.parametrize('drive', DRIVES.values(), ids=DRIVES)


def followed(drive, ends, commands, x, duration, model=MODEL):
    """Return state and force of the motor after a time."""
    x = x.copy()
    f = follow_commands(model, drive, np.asarray(ends), np.asarray(commands), x, duration)
    return x, f


def integrated(drive, ends, commands, x, duration):
    """Return the same by the differential equation, from long before on."""
    def f_of(f, u, elapsed):
        if drive.time_constant == 0:
            return u
        return solve_ivp(lambda t, f: (u - f) / drive.time_constant, (0, elapsed), [f],
                         rtol=1e-10, atol=1e-10).y[0, -1]

    def moving(u):
        def slope(t, z):
            force = z[-1] if drive.time_constant > 0 else u
            change = (u - z[-1]) / drive.time_constant if drive.time_constant > 0 else 0.0
            return [*derivative(MODEL.pendulum, z[:-1], drive.gain * force + drive.bias), change]
        return slope
    f, now = commands[0], -math.inf
    for end, u in zip(ends, commands):
        acts_until = min(end + drive.delay, duration)
        if now < 0 and acts_until > now:
            before = min(acts_until, 0.0)
            f = f_of(f, u, before - now) if now > -math.inf else u
            now = before
        if acts_until > now:
            z = solve_ivp(moving(u), (now, acts_until), [*x, f], rtol=1e-10, atol=1e-10).y[:, -1]
            x, f, now = z[:-1], z[-1] if drive.time_constant > 0 else u, acts_until
    return x, f


@pytest.mark.parametrize('f, u, tau, duration', [
    (0.0, 10.0, 0.03, 0.05), (-4.0, 3.0, 0.2, 0.01), (5.0, -5.0, 0.01, 0.3), (2.0, 2.0, 0.1, 0.1)])
def test_a_motor_lags(f, u, tau, duration):
    """Against 10,000 steps of the differential equation."""
    h, forces = duration / 10_000, [f]
    for _ in range(10_000):
        middle = forces[-1] + h / 2 * (u - forces[-1]) / tau
        forces.append(forces[-1] + h * (u - middle) / tau)
    last, mean = lagged(f, u, tau, duration)
    assert last == pytest.approx(forces[-1], abs=1e-6)
    assert mean == pytest.approx(np.trapezoid(forces, dx=h) / duration, abs=1e-6)


@pytest.mark.parametrize('tau', [0.0, 1e-12])
def test_without_a_lag_the_force_is_the_command(tau):
    assert lagged(-3.0, 8.0, tau, 0.01) == (8.0, 8.0)


def test_the_shorter_the_lag_the_nearer_to_none():
    far, near = (np.abs(followed(Drive(time_constant=tau), ENDS, COMMANDS, START, 0.1)[0]
                        - followed(DIRECT, ENDS, COMMANDS, START, 0.1)[0]).max()
                 for tau in (1e-3, 1e-4))
    assert 0 < near < 0.2 * far


@of_drives
def test_it_is_its_differential_equation(drive):
    x, f = followed(drive, ENDS, COMMANDS, START, 0.1)
    expected, f_expected = integrated(drive, ENDS, COMMANDS, START, 0.1)
    np.testing.assert_allclose(x, expected, atol=2e-5)
    assert f == pytest.approx(f_expected, abs=1e-6)
    if drive is not DIRECT:   # which would be a poor test if drives made no difference
        direct, _ = followed(DIRECT, ENDS, COMMANDS, START, 0.1)
        assert np.abs(x - direct).max() > 0.01


@of_drives
@pytest.mark.parametrize('parts', [(0.05, 0.05), (0.0137, 0.0863), (0.001, 0.03, 0.069),
                                   (0.0231, 0.0137, 0.0001, 0.0631)])
def test_how_an_interval_is_split_changes_nothing(drive, parts):
    whole, f_whole = followed(drive, ENDS, COMMANDS, START, 0.1)
    x, passed = START, 0.0
    for duration in parts:
        x, f = followed(drive, ENDS - passed, COMMANDS, x, duration)
        passed += duration
    assert passed == pytest.approx(0.1)
    # the mean of a lagging force over a step is its effect but for the step's square
    np.testing.assert_allclose(x, whole, atol=1e-9 if drive.time_constant == 0 else 2e-5)
    assert f == pytest.approx(f_whole, rel=1e-12)


def test_a_command_that_ends_in_the_middle_of_a_step_acts_for_its_time():
    for step in (1e-3, 0.01, 0.05):
        model = MODEL._replace(h=step)
        x, f = followed(Drive(delay=0.02), [0.0137, math.inf], [10.0, -4.0], START, 0.05, model)
        expected = hold(model, hold(model, START, 10.0, 0.0337), -4.0, 0.0163)
        np.testing.assert_allclose(x, expected, rtol=1e-13)
        assert f == -4.0


def test_a_motor_remembers_what_was_before():
    """A command that ended a time constant ago leaves 1 / e of it."""
    drive = Drive(time_constant=0.04)
    _, f = followed(drive, [-0.04, math.inf], [10.0, 0.0], START, 1e-6)
    assert f == pytest.approx(10 / math.e, rel=1e-4)
    _, f = followed(drive._replace(delay=0.04), [-0.04, math.inf], [10.0, 0.0], START, 1e-6)
    assert f == pytest.approx(10.0, rel=1e-4)


def test_no_time_changes_nothing():
    x, f = followed(DRIVES['all'], ENDS, COMMANDS, START, 0.0)
    np.testing.assert_array_equal(x, START)
    assert np.isfinite(f)


def test_gain_and_bias_make_the_force():
    driven, _ = followed(Drive(gain=1.5, bias=-2.0), [math.inf], [6.0], START, 0.05)
    direct, _ = followed(DIRECT, [math.inf], [7.0], START, 0.05)
    np.testing.assert_allclose(driven, direct, rtol=1e-13)


def test_a_drive_is_that_of_its_parameters():
    assert Drive.of(DriveParameters()) == DIRECT
    assert Drive.of(DriveParameters(actuation_delay=0.01, motor_time_constant=0.02,
                                    force_gain=0.9, force_bias=-1.0)) == (0.01, 0.02, 0.9, -1.0)
