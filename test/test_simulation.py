# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The plant, and the closed loop: the swing-up itself."""

import math

from controllers import controller, LIMITS, plant
import numpy as np
import pytest

from dp_swing_ros.dynamics import Pendulum, RK4
from dp_swing_ros.dynamics.trajectory import rollout
from dp_swing_ros.metrics import measure
from dp_swing_ros.parameters import LimitParameters
from dp_swing_ros.plan import Status
from dp_swing_ros.simulation import simulate
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.state import HANGING

START = (0.0, 1.0, 0.5, 0.0, 0.0, 0.0)


def test_the_plant_integrates_finely_under_a_held_force():
    p = plant(initial_state=START)
    p.command = 5.0
    p.advance(0.05)
    fine = RK4.of(Pendulum.of(p.bodies), 0.005)
    np.testing.assert_allclose(p.x, rollout(fine, np.array(START), np.full(10, 5.0))[-1],
                               rtol=1e-13)
    assert p.t == pytest.approx(0.05)


def test_uneven_steps_lead_to_the_same_place():
    even, uneven = plant(initial_state=START), plant(initial_state=START)
    even.advance(0.1)
    for duration in (0.013, 0.0, 0.0501, 0.0369):
        uneven.advance(duration)
    np.testing.assert_allclose(uneven.x, even.x, atol=1e-6)


def test_the_paper_s_euler_plant_is_an_option():
    p = plant(initial_state=START, integrator='euler', physics_step=0.05)
    p.advance(0.05)
    np.testing.assert_allclose(p.x[:3], START[:3])   # velocities were zero


@pytest.mark.parametrize(('command', 'applied'), [(50.0, 20.0), (-50.0, -20.0), (7.0, 7.0)])
def test_the_actuator_saturates(command, applied):
    p = plant()
    p.command = command
    p.advance(0.05)
    assert p.force == p.mean_force == applied


def test_the_force_of_a_period_is_its_mean():
    p = plant()
    for command, duration in ((10.0, 0.01), (0.0, 0.03), (-10.0, 0.01), (20.0, 0.0)):
        p.command = command
        p.advance(duration)
    assert p.mean_force == pytest.approx(0.0)
    p.begin_period(0.0)
    assert p.mean_force == 0.0


def test_the_end_stop_holds_the_cart():
    p = plant(initial_state=(2.3, math.pi, math.pi, 3.0, 0.0, 0.0))
    p.command = 20.0
    for _ in range(20):
        p.advance(0.05)
        assert p.x[0] <= 2.4
    assert p.x[0] == 2.4
    assert p.x[3] == 0.0


def test_without_a_limit_there_is_no_end_stop():
    p = plant(limits=LimitParameters(track_limit=math.inf, force_limit=math.inf))
    p.command = 100.0
    p.advance(2.0)
    assert p.x[0] > 2.4


def test_a_push_lasts_one_period_and_is_not_the_actuator_s():
    pushed, still = plant(), plant()
    pushed.begin_period(10.0)
    for p in (pushed, still):
        p.advance(0.05)
    assert pushed.mean_force == 0.0
    assert pushed.x[3] > still.x[3] + 0.1
    pushed.begin_period(0.0)
    assert pushed.push == 0.0


def test_noise_has_the_size_that_was_asked_for():
    p = plant(position_noise=0.01, velocity_noise=0.2, force_noise=1.5)
    errors = np.array([p.measure().x for _ in range(4000)]) - HANGING
    np.testing.assert_allclose(errors[:, :3].std(0), 0.01, rtol=0.05)
    np.testing.assert_allclose(errors[:, 3:].std(0), 0.2, rtol=0.05)
    forces = []
    for _ in range(4000):
        p.begin_period(0.0)
        forces.append(p.force)
    assert np.std(forces) == pytest.approx(1.5, rel=0.05)


def test_a_measurement_is_as_old_as_asked():
    p = plant(initial_state=START, delay=0.1)
    for n in range(5):
        p.advance(0.05)
    t, x = p.measure()
    assert t == pytest.approx(0.15)
    ideal = plant(initial_state=START)
    ideal.advance(0.15)
    np.testing.assert_allclose(x, ideal.x, atol=1e-9)


def test_a_reset_begins_the_same_noise_anew():
    p = plant(velocity_noise=0.1, force_noise=1.0)

    def run():
        p.begin_period(0.0)
        p.advance(0.05)
        return p.measure().x
    first = run()
    p.reset()
    np.testing.assert_array_equal(run(), first)
    assert not np.array_equal(plant(seed=1, velocity_noise=0.1).measure().x[3:], first[3:])


@pytest.mark.parametrize('name', sorted(SOLVERS))
@pytest.mark.parametrize('seed', [0, 7])
def test_the_pendulum_swings_up_and_stays(name, seed):
    """A quick version of the campaign of 20 seeds a solver in docs/results/swing_up.md."""
    metrics = measure(simulate(plant(seed), controller(name, seed), 10.0, name))
    assert metrics.success
    assert metrics.largest_force <= LIMITS.force_limit
    assert metrics.largest_position < LIMITS.track_limit


@pytest.mark.parametrize('name', sorted(SOLVERS))
def test_two_runs_of_a_seed_are_the_same_to_the_bit(name):
    first, second = (simulate(plant(2, velocity_noise=0.02), controller(name, 2), 1.0)
                     for _ in range(2))
    np.testing.assert_array_equal(first.X, second.X)
    np.testing.assert_array_equal(first.U, second.U)


def test_an_episode_holds_what_happened():
    seen = []
    episode = simulate(plant(), controller(), 1.0, 'ilqr', lambda t, plan: seen.append(t))
    assert episode.X.shape == (21, 6)
    assert episode.U.shape == (20,)
    np.testing.assert_allclose(episode.t, np.arange(21) * 0.05)
    np.testing.assert_allclose(seen, episode.t[1:])
    assert set(episode.ticks.status) <= {status.name for status in Status}
    fine = RK4.of(Pendulum.of(episode.bodies), 0.005)
    for n in range(20):
        np.testing.assert_allclose(rollout(fine, episode.X[n], np.full(10, episode.U[n]))[-1],
                                   episode.X[n + 1], atol=1e-9)
