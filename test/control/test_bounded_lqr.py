# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The bounded LQR holds what the regulator drops, and is the regulator where no bound acts."""

from dataclasses import replace

from controllers import controller
import numpy as np
import pytest

from dp_swing_ros.control.bounded_lqr import BoundedLQR, find_gaps
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.pendulum.state import angles
from dp_swing_ros.problem.problem import Bounds, regulator_rollout


@pytest.fixture(scope='module')
def problem():
    return controller().belief.problem


def leaning(th_1, th_2):
    return np.array([0.0, th_1, th_2, 0.0, 0.0, 0.0])


def angle(X):
    return np.abs(X[:, angles(X)]).max()


def test_without_a_bound_that_acts_it_is_the_regulator(problem):
    x = leaning(0.01, 0.008)
    found = BoundedLQR(problem).start(x)
    np.testing.assert_allclose(found.U, regulator_rollout(problem, x).U, atol=0.01)


# the last takes several passes
@pytest.mark.parametrize('th_1, th_2', [
    (0.20, -0.02), (-0.10, 0.12), (0.07, 0.23), (-0.29, -0.19), (-0.18, -0.22), (0.28, 0.21),
    (-0.0787, -0.267)])
def test_it_holds_where_the_regulator_drops(problem, th_1, th_2):
    x = leaning(th_1, th_2)
    assert angle(rollout(problem.model, x, regulator_rollout(problem, x).U)) > 1.0
    found = BoundedLQR(problem).start(x)
    assert angle(found.X) < 0.4
    assert np.abs(found.U).max() <= problem.u_max
    np.testing.assert_allclose(found.X, rollout(problem.model, x, found.U), atol=1e-6)


@pytest.mark.parametrize('bounds', [Bounds(-20.0, 12.0), Bounds(-12.0, 20.0)])
@pytest.mark.parametrize('th_1, th_2', [(0.15, 0.0), (-0.15, 0.0)])
def test_its_two_bounds_may_differ(problem, bounds, th_1, th_2):
    found = BoundedLQR(replace(problem, bounds=bounds)).start(leaning(th_1, th_2))
    assert bounds.low <= found.U.min() and found.U.max() <= bounds.high
    # to the right the one bound acts, to the left the other
    assert found.U[0] == pytest.approx(bounds.high if th_1 > 0 else bounds.low)
    assert angle(found.X) < 0.4


def test_out_of_reach_there_is_none(problem):
    assert BoundedLQR(problem).start(leaning(0.7, 0.0)) is None


def test_the_gaps_of_a_rollout_are_zero_and_those_of_another_path_are_not(problem, rng):
    U = rng.uniform(-5, 5, 30)
    X, gaps = rollout(problem.model, leaning(0.1, 0.2), U), np.empty((30, 6))
    find_gaps(problem.model, X, U, gaps)
    np.testing.assert_array_equal(gaps, 0.0)
    X[7] += 1e-3
    find_gaps(problem.model, X, U, gaps)
    np.testing.assert_allclose(gaps[6], -1e-3)
    assert np.count_nonzero(np.abs(gaps).max(axis=1)) == 2
