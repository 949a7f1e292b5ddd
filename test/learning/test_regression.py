# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a chain of links is, from some seconds of its motion."""

from learned_dynamics import BODIES, experience, network, of_chain, rms
import numpy as np
import pytest

from dp_swing_ros.dynamics.kinds import Residual
from dp_swing_ros.learning.experience import Experience
from dp_swing_ros.learning.priors import structured
from dp_swing_ros.learning.regression import fitted, predicted, Prior
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.parameters import PendulumParameters


def test_structured_dynamics_are_those_of_the_chain():
    seen, other = experience(10.0), experience(5.0, seed=9)
    untold, prior = structured(2)
    found = untold.with_free(fitted(untold, seen, prior).mean)
    truth = of_chain(PendulumParameters(**BODIES))
    assert np.all(rms(untold, other) > 20 * rms(found, other))
    s, c = np.sin([0.4, -1.0]), np.cos([0.4, -1.0])
    np.testing.assert_allclose(found.mass_matrix(s, c), truth.mass_matrix(s, c), atol=0.02)
    assert found.friction[0] == pytest.approx(0.1, abs=0.05)


def test_noise_is_estimated_and_so_is_how_sure_the_numbers_are():
    seen = experience(5.0, position_noise=0.01, velocity_noise=0.01)
    untold, prior = structured(2)
    found = fitted(untold, seen, prior)
    truth = of_chain(PendulumParameters(**BODIES))
    assert np.all(found.noise > 0.01) and np.all(found.noise < 0.3)
    off = found.mean - truth.free
    deviations = np.sqrt(np.diag(found.covariance))
    assert np.mean(np.abs(off) < 3 * deviations) > 0.9
    assert np.all(deviations <= prior.deviations * 1.001)
    draws = found.draws(400, np.random.default_rng(0))
    np.testing.assert_allclose(draws.std(axis=0), deviations, rtol=0.25)


def test_friction_makes_no_energy():
    seen = experience(3.0, cart_friction=0.0, position_noise=0.01, velocity_noise=0.01)
    untold, prior = structured(2)
    found = untold.with_free(fitted(untold, seen, prior).mean)
    assert np.all(found.friction >= 0) and np.all(found.dry >= 0)


def test_a_last_layer_takes_up_what_the_equations_leave_out():
    seen, other = experience(20.0, force_bias=3.0), experience(5.0, seed=5, force_bias=3.0)
    known = Pendulum.of(PendulumParameters(**BODIES))
    untold = Residual(known, network(size=0.0))
    prior = Prior(untold.free, np.full(len(untold.free), 0.1), np.full(len(untold.free), -np.inf))
    found = untold.with_free(fitted(untold, seen, prior).mean)
    assert np.all(rms(found, other) < 0.2 * rms(known, other))


def test_transitions_may_take_longer_than_a_step():
    seen = experience(4.0)
    twice = Experience(seen.X[:-1:2], seen.Y[1::2], seen.U[:-1:2], 2 * seen.h[:-1:2])
    held = np.abs(np.diff(seen.U))[::2] < 1.0   # where the force was about the same
    truth = Pendulum.of(PendulumParameters(**BODIES))
    assert held.any()
    assert np.median(np.abs(predicted(truth, twice) - twice.Y[:, 3:])[held]) < 0.3
    assert twice.duration == pytest.approx(4.0)
