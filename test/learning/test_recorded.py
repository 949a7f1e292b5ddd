# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What of a recorded motion is experience, and which force acted meanwhile."""

import numpy as np
import pytest
from similar import SMALLER

from dp_swing_ros.errors import UserError
from dp_swing_ros.identification.segments import Motion
from dp_swing_ros.learning.recorded import mean_forces, stretches, stretches_of
from dp_swing_ros.pendulum.parameters import DIRECT, Drive

PERIOD = 0.05


def recording(count=100, period=PERIOD, pushes=(), track_limit=2.4):
    """Return a motion in which all goes to and fro, under a command a period, and its speeds."""
    t = 3.0 + period * np.arange(count)
    phase = np.outer(t, [1.0, 2.0, 3.0])
    motion = Motion(t, 0.5 * np.sin(phase), t.copy(), np.cos(7 * t), np.array(pushes), track_limit)
    return motion, 0.5 * np.cos(phase) * [1.0, 2.0, 3.0]


def test_a_whole_motion_is_one_stretch():
    motion, speeds = recording()
    stretch, = stretches(motion, speeds, DIRECT)
    assert len(stretch.U) == 99
    np.testing.assert_allclose(stretch.h, PERIOD)
    np.testing.assert_allclose(stretch.U, motion.commands[:-1])
    np.testing.assert_array_equal(stretch.X[:, :3], motion.Q[:-1])
    np.testing.assert_array_equal(stretch.Y[:, 3:], speeds[1:])


def test_what_was_heard_live_is_the_same_stretch():
    """Angles may be on any turn, and forces in any order."""
    motion, speeds = recording()
    turned = motion.Q + np.where(np.arange(100) > 50, 2 * np.pi, 0.0)[:, None] * [0, 1, 1]
    order = np.random.default_rng(0).permutation(100)
    found, = stretches_of(motion.t, np.hstack((turned, speeds)), motion.sent[order],
                          motion.commands[order], motion.track_limit)
    for one, other in zip(found, stretches(motion, speeds, DIRECT)[0]):
        np.testing.assert_allclose(one, other, atol=1e-12)


def test_states_that_come_faster_are_thinned():
    stretch, = stretches(*recording(count=1000, period=0.005), DIRECT)
    np.testing.assert_allclose(stretch.h, PERIOD)
    assert len(stretch.U) == 99


def test_of_a_smaller_pendulum_states_and_jumps_count_in_its_own_units():
    motion, speeds = recording(count=200, period=0.0125)
    small = motion._replace(Q=motion.Q * [0.25, 1.0, 1.0]), speeds * [0.25, 1.0, 1.0]
    stretch, = stretches(*small, DIRECT, SMALLER)
    np.testing.assert_allclose(stretch.h, 0.025)
    small[0].Q[100:, 0] += 0.1   # of the default bodies it would be none
    assert len(stretches(*small, DIRECT)) == 1
    assert len(stretches(*small, DIRECT, SMALLER)) == 2


def broken(motion, speeds, what):
    """Return a motion of which something about state 50 is not known, or no motion."""
    after = np.arange(100) > 50
    if what == 'a gap':
        late = np.where(after, 0.5, 0.0)
        return motion._replace(t=motion.t + late, sent=motion.sent + late), speeds
    if what == 'a reset':
        return motion._replace(Q=motion.Q + np.where(after, 1.0, 0.0)[:, None]), speeds
    if what == 'no commands':
        kept = np.abs(np.arange(100) - 50) > 5
        return motion._replace(sent=motion.sent[kept], commands=motion.commands[kept]), speeds
    if what == 'no speed':
        speeds = speeds.copy()
        speeds[50, 1] = np.nan
        return motion, speeds
    return motion._replace(pushes=motion.t[50:51]), speeds


@pytest.mark.parametrize('what', ['a gap', 'a reset', 'no commands', 'no speed', 'a push'])
def test_what_is_not_known_parts_stretches(what):
    found = stretches(*broken(*recording(), what), DIRECT)
    assert len(found) == 2
    assert 80 < sum(len(each.U) for each in found) < 99
    for each in found:   # in each, one follows the other
        np.testing.assert_array_equal(each.X[1:], each.Y[:-1])


def test_nothing_to_use_is_said():
    with pytest.raises(UserError, match='nothing can be used'):
        stretches(recording(track_limit=0.1)[0], np.full((100, 3), np.nan), DIRECT)


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
