# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recursive least squares of structured dynamics."""

import math

from learned_dynamics import bent, experience, of_chain, rms
import numpy as np
import pytest

from dp_swing_ros.dynamics import priors
from dp_swing_ros.estimators.least_squares import RecursiveLeastSquares, sensitivities
from dp_swing_ros.pendulum.integrators import INTEGRATORS
from dp_swing_ros.pendulum.model import Model
from dp_swing_ros.pendulum.parameters import DIRECT, PendulumParameters

NEVER = np.full(1, math.inf)


def learner(dynamics):
    return RecursiveLeastSquares(
        Model(dynamics, INTEGRATORS['rk4'], 0.01), priors.known(dynamics), np.full(3, 0.3),
        np.full(3, 1e-3), 60.0)


def test_sensitivities_are_differences_of_other_numbers():
    dynamics, p = bent(), bent().free
    x, H = np.array([0.1, 2.0, 1.0, 0.5, -2.0, 3.0]), np.empty((3, len(p)))
    given = DIRECT, NEVER, np.array([4.0]), x, 0.05
    model = Model(dynamics, INTEGRATORS['rk4'], 0.01)
    none = np.empty(0)
    after = sensitivities(model, *given, np.full(len(p), 1e-5), H)
    np.testing.assert_allclose(dynamics.free, p, atol=1e-12)
    for i in range(len(p)):
        moved = [sensitivities(model._replace(pendulum=dynamics.with_free(
            p + change * np.eye(len(p))[i])), *given, none, H[:, :0])[3:]
            for change in (-1e-5, 1e-5)]
        np.testing.assert_allclose(H[:, i], (moved[1] - moved[0]) / 2e-5, rtol=1e-3, atol=1e-3)
    assert np.all(np.isfinite(after))


def test_from_one_transition_after_the_other_it_learns_what_moves():
    """Its bodies are others than those that it begins with, which are off by a tenth."""
    about = of_chain(PendulumParameters(cart_mass=0.55, link1_mass=0.45, link2_mass=0.52,
                                        link1_length=0.62, link2_length=0.58))
    one, seen, other = learner(about), experience(30.0), experience(5.0, seed=9)
    off = [one.update(DIRECT, NEVER, np.array([u]), x, y, h)[0] for x, y, u, h in zip(*seen)]
    assert np.abs(off[-100:]).max() < 0.2 * np.abs(off[:100]).max()
    assert np.all(rms(one.dynamics, other) < 0.3 * rms(about, other))
    assert np.all(one.dynamics.friction >= 0) and np.all(one.dynamics.dry >= 0)
    one.reset()
    np.testing.assert_array_equal(one.dynamics.free, about.free)


def test_of_a_push_nothing_is_learned():
    about = of_chain(PendulumParameters())
    one, x = learner(about), np.array([0.0, np.pi, np.pi, 0.0, 0.0, 0.0])
    for _ in range(50):   # hangs still, so that residuals are small
        one.update(DIRECT, NEVER, np.zeros(1), x, x, 0.05)
    p, R = one.p.copy(), one.R.copy()
    pushed = x + np.array([0.05, 0.0, 0.0, 2.0, 0.0, 0.0])
    off, is_learned = one.update(DIRECT, NEVER, np.zeros(1), x, pushed, 0.05)
    assert off[0] == pytest.approx(2.0) and not is_learned
    # nor of what is wild
    assert not one.update(DIRECT, NEVER, np.zeros(1), x, np.full(6, np.nan), 0.05)[1]
    np.testing.assert_array_equal(one.p, p)
    np.testing.assert_array_equal(one.R, R)
    assert one.update(DIRECT, NEVER, np.zeros(1), x, x, 0.05)[1]
