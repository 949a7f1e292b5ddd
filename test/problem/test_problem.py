# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The problem: its regulator, and the parameters that it refuses."""

import dataclasses

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.trajectory import rollout
from dp_swing_ros.problem.parameters import CostParameters, PredictionParameters
from dp_swing_ros.problem.problem import linearisation, policy_rollout, Problem, regulator_rollout


def problem(cost=CostParameters(), limits=LimitParameters(),
            prediction=PredictionParameters(horizon=100)):
    return Problem.of(PendulumParameters(), limits, cost, prediction)


@pytest.mark.parametrize('reference', [(0, 0, 0, 0, 0, 0), (0.5, np.pi, 0, 0, 0, 0),
                                       (0, np.pi, np.pi, 0, 0, 0), (-1, 0, np.pi, 0, 0, 0)])
def test_the_regulator_holds_every_equilibrium(reference):
    p = problem(CostParameters(reference=reference))
    x = np.array(reference) + (0.1, 0.02, -0.02, 0, 0, 0)
    X = rollout(p.model, x, regulator_rollout(p, x).U)
    assert np.abs(X[-1] - reference).max() < 0.02


def test_the_terminal_value_solves_the_riccati_equation():
    p = problem()
    A, B = linearisation(p.model, np.zeros(6), 0.0)
    P = solve_discrete_are(A, B[:, None], np.diag(p.cost.S), [[p.cost.R]])
    np.testing.assert_allclose(p.cost.P, P, rtol=1e-9)


def test_a_policy_goes_on_with_the_regulator():
    p = problem()
    x = np.array([0.1, 0.02, -0.02, 0, 0, 0])
    U = regulator_rollout(p, x).U
    _, X, forces, _ = policy_rollout(p, x, rollout(p.model, x, U[:7]), U[:7], np.zeros((7, 6)))
    np.testing.assert_allclose(forces, U, atol=1e-12)
    np.testing.assert_allclose(X, rollout(p.model, x, U), atol=1e-12)


def test_what_is_left_of_a_plan_is_completed_by_the_regulator():
    p = problem(prediction=PredictionParameters(horizon=30))
    whole = regulator_rollout(p, np.array([0.005, 0.001, 0.0, 0.0, 0.0, 0.0]))
    started = policy_rollout(p, whole.X[10], whole.X[10:], whole.U[10:], whole.K[10:])
    assert started.X.shape == (31, 6)
    np.testing.assert_allclose(started.X[:20], whole.X[10:30], atol=1e-9)
    assert started.U[25] == pytest.approx(-p.lqr.K @ started.X[25], rel=1e-3)


@pytest.mark.parametrize(('change', 'words'), [
    ({'limits': LimitParameters(force_limit=0.0)}, 'force_limit'),
    ({'cost': CostParameters(state_weights=(0, 100, 100, 2, 6, 0.1))}, 'state_weights'),
])
def test_an_impossible_problem_is_refused(change, words):
    with pytest.raises(ParameterError, match=words):
        problem(**change)


@pytest.mark.parametrize(('group', 'name', 'value', 'words'), [
    (LimitParameters, 'force_limit', float('nan'), 'finite'),
    (LimitParameters, 'force_limit', -1.0, 'at least 0'),
    (PendulumParameters, 'link1_mass', 0.0, 'at least 0.001 kg'),
    (PredictionParameters, 'model', 'rk5', 'rk4, euler'),
    (PredictionParameters, 'horizon', 2.5, 'horizon'),
    (CostParameters, 'reference', (0.0, 0.0), 'list of 6'),
    (CostParameters, 'state_weights', (1, 1, 1, 1, 1, -1), 'at least 0'),
])
def test_impossible_parameters_are_refused(group, name, value, words):
    with pytest.raises(ParameterError, match=words) as caught:
        group(**{name: value})
    assert name in str(caught.value)


def test_parameters_are_frozen():
    with pytest.raises(dataclasses.FrozenInstanceError):
        PendulumParameters().link1_mass = 2.0
