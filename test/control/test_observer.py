# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From measurements to a belief, without anything else of a controller."""

import math

import numpy as np
import pytest

from dp_swing_ros.control.commands import SentCommands
from dp_swing_ros.control.observer import (
    checked, driven_by, is_of_another_run, Observer, ObserverParameters)
from dp_swing_ros.estimators import ESTIMATORS
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.parameters import DIRECT, LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import hanging
from dp_swing_ros.problem.parameters import CostParameters, PredictionParameters
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.problem.problem import plan_of, Problem

ESTIMATED = pytest.mark.parametrize('estimator', ['none', 'ekf'])
NOTHING = SentCommands()


def problem(**physical):
    return Problem.of(PendulumParameters(**physical), LimitParameters(), CostParameters(),
                      PredictionParameters())


def observer(estimator='none', drive=DIRECT, **physical):
    return Observer(problem(**physical), ObserverParameters(estimator=estimator),
                    ESTIMATORS[estimator].Parameters(), drive)


def state(n):
    """Return a state that differs from the one before, of a cart that is carried along."""
    return hanging() + np.array([0.01 * n, 0.0, 0.0, 0.2, 0.0, 0.0])


@ESTIMATED
def test_nothing_is_believed_before_a_first_state(estimator):
    belief = observer(estimator).belief
    assert np.all(np.isnan(belief.x)) and belief.t == -math.inf


def test_without_an_estimator_a_state_is_what_was_measured():
    belief = observer().update(1.0, state(1), 0.0, NOTHING)
    assert belief.t == 1.0 and np.array_equal(belief.x, state(1))
    assert belief.estimate is None and not belief.rejection


def test_an_estimator_does_without_velocities():
    watcher, x = observer('ekf'), state(0)
    for n in range(30):
        x = np.where(np.arange(6) < 3, state(n), np.nan)
        belief = watcher.update(0.05 * n, x, 0.0, NOTHING)
    assert belief.x[3] == pytest.approx(0.2, abs=0.05)
    with pytest.raises(ValueError, match='without velocities; estimator ekf does without'):
        observer().update(0.0, x, 0.0, NOTHING)


@ESTIMATED
def test_a_state_that_another_overtook_adds_nothing(estimator):
    watcher = observer(estimator)
    watcher.update(0.00, state(0), 0.0, NOTHING)
    belief = watcher.update(0.05, state(1), 0.0, NOTHING)
    assert watcher.update(0.02, state(9), 0.0, NOTHING) is belief
    assert not watcher.is_another_run(0.02)
    assert watcher.is_another_run(-0.01)   # it is before all of this one


@pytest.mark.parametrize('t, another', [
    (9.1, False), (9.0, False), (8.6, False), (8.4, True), (5.0, True), (1.0, True)])
def test_a_time_long_before_the_latest_is_of_another_run(t, another):
    assert is_of_another_run(t, 5.0, 9.0) is another
    assert is_of_another_run(t, 8.9, 9.0) is (t <= 8.9)   # it is before all, or is the first
    assert not is_of_another_run(t, math.inf, -math.inf)   # of a run that has not begun


@ESTIMATED
def test_a_state_that_cannot_be_is_rejected_and_the_last_one_stays(estimator):
    watcher = observer(estimator)
    before = watcher.update(0.0, state(0), 0.0, NOTHING)
    belief = watcher.update(0.05, state(1) + 1e6, 0.0, NOTHING)
    assert belief.rejection and belief.t == before.t
    assert np.array_equal(belief.x, before.x)
    assert not watcher.update(0.10, state(2), 0.0, NOTHING).rejection


def test_an_angle_goes_on_where_its_encoder_wraps():
    watcher = observer()
    watcher.update(0.0, state(0), 0.0, NOTHING)
    wrapped = state(1) - np.array([0.0, math.tau, 0.0, 0.0, 0.0, 0.0])
    assert watcher.update(0.05, wrapped, 0.0, NOTHING).x[1] == pytest.approx(math.pi)


@ESTIMATED
def test_after_a_reset_it_knows_as_much_as_at_first(estimator):
    def run(watcher):
        return [watcher.update(0.05 * n, state(n), 0.0, NOTHING).x for n in range(5)]
    watcher = observer(estimator)
    first = run(watcher)
    watcher.reset()
    assert np.array_equal(run(watcher), first)


def test_steps_in_which_nothing_can_be_held_change_nothing():
    watcher = observer()
    belief = watcher.update(0.0, state(0), 0.0, NOTHING)
    with pytest.raises(ParameterError):
        watcher.predict_as(PredictionParameters(step=30.0))
    assert watcher.belief is belief
    watcher.predict_as(PredictionParameters(step=0.02))
    assert watcher.belief.problem.dt == watcher.nominal.dt == 0.02
    assert np.array_equal(watcher.belief.x, belief.x)


def test_it_goes_on_with_what_it_believes_unless_it_is_told_other_bodies():
    watcher = observer('ekf')
    for n in range(5):
        belief = watcher.update(0.05 * n, state(n), 0.0, NOTHING)
    watcher.reconfigure(observer('ekf'))
    assert watcher.belief.estimate is not None and np.array_equal(watcher.belief.x, belief.x)
    watcher.reconfigure(observer('ekf', link1_mass=0.9))
    assert watcher.belief.estimate is None and np.array_equal(watcher.belief.x, belief.x)
    assert watcher.nominal.physical.link1_mass == 0.9


def test_what_a_drive_can_do_bounds_the_problem():
    nominal = problem()
    assert driven_by(DIRECT, nominal) is nominal
    weak = driven_by(DIRECT._replace(gain=0.5, bias=1.0), nominal)
    assert weak.bounds == (-9.0, 11.0)


def test_a_measurement_is_checked():
    with pytest.raises(ValueError, match='expected 6 finite numbers'):
        checked(np.zeros(4), 6)
    with pytest.raises(ValueError, match='expected 6 finite numbers'):
        checked(np.array([0, np.nan, 0, 0, 0, 0]), 6)
    x = np.zeros(6)
    assert checked(x, 6) is not x


def test_a_plan_is_told_in_the_angles_of_the_sensors():
    belief = observer('ekf').update(0.0, state(0), 0.0, NOTHING)
    balance = np.array([0.01, -0.02])
    leaning = belief._replace(estimate=belief.estimate._replace(balance=balance))
    X = np.tile(state(0), (belief.problem.horizon + 1, 1))
    plan = plan_of(belief.problem, X, np.zeros(belief.problem.horizon), Status.ZERO)
    assert np.allclose(leaning.as_measured(plan).X[:, 1:3], X[:, 1:3] + balance)
