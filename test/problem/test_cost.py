# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The cost against the paper's formula, and its derivatives against finite differences."""

import dataclasses

import numpy as np
import pytest

from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.problem.cost import (
    running, running_derivatives, terminal, terminal_derivatives, trajectory_cost)
from dp_swing_ros.problem.parameters import CostParameters, PredictionParameters
from dp_swing_ros.problem.problem import Problem

PAPER = CostParameters(angle_error='angle', terminal_cost='scaled', track_weight=0.0)
SHIFTED = CostParameters(reference=(0.5, np.pi, 0.0, 0.0, 0.0, 0.0))


def cost_of(parameters):
    return Problem.of(PendulumParameters(), LimitParameters(), parameters,
                      PredictionParameters()).cost


def test_the_paper_s_cost_to_the_letter(rng):
    """(16)-(21), with S_f = 1000 S."""
    S, R = np.diag([10, 100, 100, 2, 6, 0.1]), 0.001
    X, U = rng.normal(size=(4, 6)) * 3, rng.normal(size=3) * 10
    J = sum(x @ S @ x + R * u * u for x, u in zip(X, U)) + X[-1] @ (1000 * S) @ X[-1]
    np.testing.assert_allclose(trajectory_cost(cost_of(PAPER), X, U), J, rtol=1e-13)


def test_a_whole_turn_costs_nothing_by_the_chord(rng):
    cost, x = cost_of(CostParameters()), rng.normal(size=6)
    turned = x + (0, 2 * np.pi, -4 * np.pi, 0, 0, 0)
    assert running(cost, turned, 1.0) == pytest.approx(running(cost, x, 1.0), rel=1e-12)
    assert running(cost_of(PAPER), turned, 1.0) > running(cost_of(PAPER), x, 1.0) + 100


def test_near_the_goal_the_chord_is_the_angle(rng):
    x = rng.normal(size=6) * 1e-3
    chord = cost_of(dataclasses.replace(PAPER, angle_error='chord'))
    assert running(chord, x, 0.0) == pytest.approx(running(cost_of(PAPER), x, 0.0), rel=1e-6)
    assert terminal(chord, x) == pytest.approx(terminal(cost_of(PAPER), x), rel=1e-6)


@pytest.mark.parametrize('parameters', [PAPER, CostParameters(), SHIFTED],
                         ids=['paper', 'tuned', 'shifted'])
def test_gradients_meet_finite_differences(parameters, rng):
    cost = cost_of(parameters)
    for _ in range(20):
        x = rng.normal(size=6) * (2, 2, 2, 3, 3, 3)
        V_x, V_xx = np.empty(6), np.empty((6, 6))
        l_x, l_xx = (part[0, :, 0] for part in running_derivatives(cost, x[None], np.zeros(1)))
        terminal_derivatives(cost, x, V_x, V_xx)
        for f, gradient in ((lambda x: running(cost, x, 1.0), l_x),
                            (lambda x: terminal(cost, x), V_x)):
            expected = [(f(x + 1e-6 * e) - f(x - 1e-6 * e)) / 2e-6 for e in np.eye(6)]
            np.testing.assert_allclose(gradient, expected, rtol=1e-5, atol=1e-3)
        assert np.all(l_xx >= 0)
        np.testing.assert_allclose(V_xx, V_xx.T, rtol=1e-12)
        assert np.linalg.eigvalsh(V_xx).min() > -1e-9 * np.abs(V_xx).max()


def test_the_hessian_is_exact_for_the_paper_s_cost(rng):
    cost, x = cost_of(PAPER), rng.normal(size=6)
    V_x, V_xx = np.empty(6), np.empty((6, 6))
    _, l_xx = running_derivatives(cost, x[None], np.zeros(1))
    terminal_derivatives(cost, x, V_x, V_xx)
    np.testing.assert_allclose(l_xx[0, :, 0], 2 * cost.S)
    np.testing.assert_allclose(V_xx, 2 * cost.P)


def test_the_soft_track_costs_only_beyond_its_margin():
    cost = cost_of(CostParameters(track_margin=0.2, track_weight=1000.0))
    free = cost_of(CostParameters(track_weight=0.0))
    for x, extra in ((2.19, 0.0), (2.3, 1000 * 0.1 ** 2), (-2.4, 1000 * 0.2 ** 2)):
        state = np.array([x, 0, 0, 0, 0, 0])
        assert running(cost, state, 0.0) - running(free, state, 0.0) == pytest.approx(extra)
