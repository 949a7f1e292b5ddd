# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a chain of links is, from some seconds of its motion."""

from learned_dynamics import BODIES, experience, of_chain, rms
import numpy as np
import pytest

from dp_swing_ros.dynamics.priors import structured
from dp_swing_ros.learning.experience import Experience
from dp_swing_ros.learning.regression import fitted, followed, predicted, spread
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.parameters import PendulumParameters


def test_structured_dynamics_are_those_of_the_chain():
    seen, other = experience(10.0), experience(5.0, seed=9)
    untold, prior = structured(2)
    found = untold.with_free(fitted(untold, seen, prior))
    truth = of_chain(PendulumParameters(**BODIES))
    assert np.all(rms(untold, other) > 20 * rms(found, other))
    s, c = np.sin([0.4, -1.0]), np.cos([0.4, -1.0])
    np.testing.assert_allclose(found.mass_matrix(s, c), truth.mass_matrix(s, c), atol=0.02)
    assert found.friction[0] == pytest.approx(0.1, abs=0.05)


def test_noise_leaves_the_numbers_near_the_truth():
    seen = experience(5.0, position_noise=0.01, velocity_noise=0.01)
    untold, prior = structured(2)
    free, truth = fitted(untold, seen, prior), of_chain(PendulumParameters(**BODIES)).free
    e = spread(seen.Y[:, 3:] - predicted(untold.with_free(free), seen))
    assert np.all(e > 0.01) and np.all(e < 0.3)
    off, before = (np.abs(each - truth) / prior.deviations for each in (free, prior.mean))
    assert off.max() < before.max() and np.mean(off) < 0.5 * np.mean(before)


def test_friction_makes_no_energy():
    seen = experience(3.0, cart_friction=0.0, position_noise=0.01, velocity_noise=0.01)
    untold, prior = structured(2)
    found = untold.with_free(fitted(untold, seen, prior))
    assert np.all(found.friction >= 0) and np.all(found.dry >= 0)


def test_each_of_some_transitions_on_end_has_its_own_duration():
    some, truth = experience(1.0), Pendulum.of(PendulumParameters(**BODIES))
    seen = Experience(some.X, some.Y, some.U, np.resize([0.05, 0.02, 0.08], len(some.U)))
    once = followed(truth, seen)
    twice = followed(truth, Experience(once[:-1], seen.Y[1:], seen.U[1:], seen.h[1:]))
    np.testing.assert_allclose(followed(truth, seen, steps=2), twice, rtol=1e-12)


def test_transitions_may_take_longer_than_a_step():
    seen = experience(4.0)
    twice = Experience(seen.X[:-1:2], seen.Y[1::2], seen.U[:-1:2], 2 * seen.h[:-1:2])
    held = np.abs(np.diff(seen.U))[::2] < 1.0   # where the force was about the same
    truth = Pendulum.of(PendulumParameters(**BODIES))
    assert held.any()
    assert np.median(np.abs(predicted(truth, twice) - twice.Y[:, 3:])[held]) < 0.3
    assert twice.duration == pytest.approx(4.0)


def test_slopes_that_are_beyond_all_numbers_do_not_end_a_fit():
    untold, prior = structured(2)
    nearly_singular = prior.mean.copy()
    nearly_singular[0] = 1e-7   # [kg] of cart and links together
    with np.errstate(all='ignore'):
        found = fitted(untold.with_free(nearly_singular), experience(3.0), prior)
    assert np.all(np.isfinite(found))
