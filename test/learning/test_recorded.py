# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What of a recorded motion is experience, and which force acted meanwhile."""

import numpy as np
import pytest

from dp_swing_ros.errors import UserError
from dp_swing_ros.identification.recorded import Recorded
from dp_swing_ros.identification.segments import Motion
from dp_swing_ros.learning.recorded import mean_forces, stretches
from dp_swing_ros.pendulum.parameters import DIRECT, Drive, PendulumParameters

PERIOD = 0.05


def recording(count=100, period=PERIOD, pushes=(), track_limit=2.4):
    """Return a motion in which all goes to and fro, under a command a period."""
    t = 3.0 + period * np.arange(count)
    phase = np.outer(t, [1.0, 2.0, 3.0])
    motion = Motion(t, 0.5 * np.sin(phase), t.copy(), np.cos(7 * t), np.array(pushes), track_limit)
    return Recorded(motion, 0.5 * np.cos(phase) * [1.0, 2.0, 3.0], 'none', PendulumParameters(),
                    DIRECT)


def test_a_whole_motion_is_one_stretch():
    found = recording()
    stretch, = stretches(found)
    assert len(stretch.U) == 99
    np.testing.assert_allclose(stretch.h, PERIOD)
    np.testing.assert_allclose(stretch.U, found.motion.commands[:-1])
    np.testing.assert_array_equal(stretch.X[:, :3], found.motion.Q[:-1])
    np.testing.assert_array_equal(stretch.Y[:, 3:], found.V[1:])


def test_states_that_come_faster_are_thinned():
    stretch, = stretches(recording(count=1000, period=0.005))
    np.testing.assert_allclose(stretch.h, PERIOD)
    assert len(stretch.U) == 99


def broken(found, what):
    """Return a motion of which something about state 50 is not known, or no motion."""
    motion, V = found.motion, found.V.copy()
    if what == 'a gap':
        return found._replace(motion=motion._replace(t=motion.t + np.where(
            np.arange(100) > 50, 0.5, 0.0), sent=motion.sent + np.where(
                np.arange(100) > 50, 0.5, 0.0)))
    if what == 'a reset':
        return found._replace(motion=motion._replace(Q=motion.Q + np.where(
            np.arange(100) > 50, 1.0, 0.0)[:, None]))
    if what == 'no commands':
        kept = np.abs(np.arange(100) - 50) > 5
        return found._replace(motion=motion._replace(
            sent=motion.sent[kept], commands=motion.commands[kept]))
    if what == 'no speed':
        V[50, 1] = np.nan
        return found._replace(V=V)
    return found._replace(motion=motion._replace(pushes=motion.t[50:51]))


@pytest.mark.parametrize('what', ['a gap', 'a reset', 'no commands', 'no speed', 'a push'])
def test_what_is_not_known_parts_stretches(what):
    found = stretches(broken(recording(), what))
    assert len(found) == 2
    assert 80 < sum(len(each.U) for each in found) < 99
    for each in found:   # in each, one follows the other
        np.testing.assert_array_equal(each.X[1:], each.Y[:-1])


def test_nothing_to_use_is_said():
    with pytest.raises(UserError, match='nothing can be used'):
        stretches(recording(track_limit=0.1)._replace(V=np.full((100, 3), np.nan)))


def test_the_mean_force_is_that_of_delay_lag_gain_and_bias():
    drive = Drive(delay=0.013, time_constant=0.02, gain=0.8, bias=0.5)
    rng = np.random.default_rng(0)
    sent = np.sort(rng.uniform(0.1, 0.9, 15))
    commands, t = rng.normal(size=15), np.arange(0.0, 1.01, 0.05)
    fine = np.arange(0.0, 1.0, 1e-5)
    which = np.searchsorted(sent + drive.delay, fine, 'right') - 1
    asked = np.where(which >= 0, commands[which], 0.0)
    f, force = 0.0, []
    for u in asked:   # by small steps
        f += (u - f) * 1e-5 / drive.time_constant
        force.append(drive.gain * f + drive.bias)
    by_steps = np.mean(np.reshape(force, (20, -1)), axis=1)
    np.testing.assert_allclose(mean_forces(drive, sent, commands, t), by_steps, atol=2e-3)
