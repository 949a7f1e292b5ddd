# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A plan as a policy in time."""

from dataclasses import replace
import math

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from dp_swing_ros.pendulum.parameters import Drive
from dp_swing_ros.pendulum.state import SIZES
from dp_swing_ros.problem.plan import Plan, SolverStats, Status

STATS = SolverStats(Status.CONVERGED, 1.0, 1, 0.001)


@pytest.fixture(params=SIZES.values())
def plan(request, rng):
    size = request.param
    return Plan(rng.normal(size=(6, size)), rng.normal(size=5), rng.normal(size=(5, size)), 0.05,
                STATS)


def spline(plan):
    """Return the states of a plan as a function of time, by scipy."""
    q, v = np.hsplit(plan.X, 2)
    positions = CubicHermiteSpline(plan.dt * np.arange(len(q)), q, v)
    return lambda t: np.hstack((positions(t), positions.derivative()(t)))


@pytest.mark.parametrize('planned, sent', [
    (3.0, 3.0), (30.0, 20.0), (-30.0, -20.0), (math.nan, 0.0), (math.inf, 0.0)])
def test_the_force_that_is_sent_is_finite_and_within_its_limit(plan, planned, sent):
    assert replace(plan, U=np.append(planned, plan.U[1:])).first_force(20.0) == sent


@pytest.mark.parametrize('drive, planned, sent', [
    (Drive(gain=0.5), 3.0, 6.0), (Drive(bias=2.0), 3.0, 1.0),
    (Drive(gain=2.0, bias=-4.0), 3.0, 3.5), (Drive(gain=0.5), 15.0, 20.0),
    (Drive(bias=5.0), -18.0, -20.0),
    (Drive(0.03, 0.02), 3.0, 3.0), (Drive(bias=2.0), math.nan, 0.0)])
def test_the_command_is_what_makes_the_planned_force(plan, drive, planned, sent):
    plan = replace(plan, U=np.append(planned, plan.U[1:]), drive=drive)
    assert plan.first_force(20.0) == pytest.approx(sent, rel=1e-15)


def test_what_is_left_of_a_plan_is_for_the_same_drive(plan):
    drive = Drive(0.03, 0.02, 0.9, 1.0)
    assert replace(plan, drive=drive).shifted(0.07).drive == drive


def test_between_steps_the_plan_is_interpolated(plan):
    left = plan.shifted(0.0625)
    for part, whole in ((left.U, plan.U), (left.K, plan.K)):
        np.testing.assert_allclose(part[0], 0.75 * whole[1] + 0.25 * whole[2])
    np.testing.assert_allclose(left.X, spline(plan)(0.0625 + 0.05 * np.arange(4)))
    assert (len(left.U), len(left.K)) == (4, 4)


def test_over_the_last_step_force_and_gain_are_held(plan):
    left = plan.shifted(0.2125)
    np.testing.assert_allclose(left.X, spline(plan)([0.2125]))
    np.testing.assert_allclose(left.U, plan.U[4:])
    np.testing.assert_allclose(left.K, plan.K[4:])


@pytest.mark.parametrize('elapsed', [0.3, 0.30000000001, 0.29999999999])
def test_whole_steps_stay_whole(rng, elapsed):
    plan = Plan(rng.normal(size=(11, 6)), rng.normal(size=10), rng.normal(size=(10, 6)), 0.1,
                STATS)
    left = plan.shifted(elapsed)
    np.testing.assert_array_equal(left.X, plan.X[3:])
    np.testing.assert_array_equal(left.U, plan.U[3:])
    np.testing.assert_array_equal(left.K, plan.K[3:])


def test_past_its_end_nothing_is_left(plan):
    assert plan.duration == pytest.approx(0.25)
    assert len(plan.shifted(0.25).U) == 0
    assert len(plan.shifted(9.0).U) == 0


def test_every_status_says_what_it_means():
    assert all(len(status.value.split()) > 3 for status in Status)


@pytest.mark.parametrize('dt', [0.0003, 0.02, 0.03, 0.04, 0.05, 0.07, 0.1, 0.9, 3.0])
def test_a_resampled_plan_is_what_is_left_of_it_step_by_step(rng, dt):
    plan = Plan(rng.normal(size=(31, 6)), rng.normal(size=30), rng.normal(size=(30, 6)), 0.05,
                STATS)
    found = plan.resampled(dt)
    assert len(found.U) == len(found.X) - 1 == int(1.5 / dt + 1e-6)
    for n in range(len(found.U)):
        left = plan.shifted(n * dt)
        np.testing.assert_array_equal(found.X[n], left.X[0])
        np.testing.assert_array_equal(found.K[n], left.K[0])
        assert found.U[n] == left.U[0]
    np.testing.assert_array_equal(found.X[-1], plan.shifted(len(found.U) * dt).X[0])
