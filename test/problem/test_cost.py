# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The cost against the paper's formula, and its derivatives against finite differences."""

import dataclasses

import numpy as np
import pytest

from dp_swing_ros.control import controllers
from dp_swing_ros.pendulum.derivatives import STEPS
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import hanging, LINKS
from dp_swing_ros.problem.cost import (
    errors, running, running_cost, running_derivatives, terminal, terminal_cost,
    terminal_derivatives, terms, trajectory_cost)
from dp_swing_ros.problem.parameters import CostParameters, PredictionParameters
from dp_swing_ros.problem.problem import Problem

SHIFTED = CostParameters(reference=(0.5, np.pi, 0.0, 0.0, 0.0, 0.0))
AS_THE_PAPER = {'angle_error': 'angle', 'terminal_cost': 'scaled', 'track_weight': 0.0}


PAPER = CostParameters(**AS_THE_PAPER)


def cost_of(parameters, limits=LimitParameters()):
    links = len(parameters.reference) // 2 - 1
    return Problem.of(PendulumParameters(links=links), limits, parameters,
                      PredictionParameters()).cost


def costs():
    """Return costs by names: the paper's, the tuned ones, and about another equilibrium."""
    found = {'shifted': cost_of(SHIFTED), 'slow': cost_of(
        CostParameters(speed_weight=50.0), LimitParameters(cart_speed_limit=2.0))}
    for links in LINKS:
        tuned = controllers.cost({'links': links})
        found.update({f'tuned {links}': cost_of(tuned),
                      f'paper {links}': cost_of(dataclasses.replace(tuned, **AS_THE_PAPER)),
                      f'hanging {links}': cost_of(dataclasses.replace(
                          tuned, reference=tuple(hanging(links).tolist())))})
    return [pytest.param(cost, id=name) for name, cost in found.items()]


def test_the_paper_s_cost_to_the_letter(rng):
    """(16)-(21), with S_f = 1000 S."""
    S, R = np.diag([10, 100, 100, 2, 6, 0.1]), 0.001
    X, U = rng.normal(size=(4, 6)) * 3, rng.normal(size=3) * 10
    J = sum(x @ S @ x + R * u * u for x, u in zip(X, U)) + X[-1] @ (1000 * S) @ X[-1]
    np.testing.assert_allclose(trajectory_cost(cost_of(PAPER), X, U), J, rtol=1e-13)


@pytest.mark.parametrize('parameters', [CostParameters(), PAPER, SHIFTED])
def test_the_terms_of_a_cost_are_its_parts(parameters, rng):
    cost = cost_of(parameters)
    X, U = rng.normal(size=(4, 6)) * 3, rng.normal(size=3) * 10
    found = terms(cost, X, U)
    assert sum(found) == pytest.approx(trajectory_cost(cost, X, U), rel=1e-12)
    assert found.force == pytest.approx(cost.R * U @ U)
    assert found.terminal == pytest.approx(terminal(cost, X[-1]))
    at = np.tile(cost.x_r, (4, 1))   # but for one number, nothing costs but its own term
    for i, term in enumerate(('position', 'angles', 'angles', *['velocities'] * 3)):
        off = at.copy()
        off[:-1, i] += 0.1
        others = {name: value for name, value in terms(cost, off, 0 * U)._asdict().items()
                  if name != term}
        assert getattr(terms(cost, off, 0 * U), term) > 0
        assert others == pytest.approx(dict.fromkeys(others, 0.0), abs=1e-12)


def test_what_is_beyond_a_soft_limit_is_a_term_of_its_own():
    cost, X = cost_of(CostParameters()), np.zeros((3, 6))
    assert terms(cost, X, np.zeros(2)).limits == 0.0
    X[0, 0] = cost.x_soft + 0.1
    assert terms(cost, X, np.zeros(2)).limits == pytest.approx(cost.w * 0.01)


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


@pytest.mark.parametrize('cost', costs())
def test_gradients_meet_finite_differences(cost, rng):
    size = len(cost.S)
    X, U = rng.normal(size=(20, size)) * 2.5, rng.normal(size=20) * 10
    of_steps = running_derivatives(cost, X, U, None)
    for t, x in enumerate(X):
        V_x, V_xx = np.empty(size), np.empty((size, size))
        l_x, l_xx = np.split(of_steps[t // STEPS, :, t % STEPS], 2)
        terminal_derivatives(cost, x, None, V_x, V_xx)
        for f, gradient in ((lambda x: running(cost, x, U[t]), l_x),
                            (lambda x: terminal(cost, x), V_x)):
            expected = [(f(x + 1e-6 * e) - f(x - 1e-6 * e)) / 2e-6 for e in np.eye(size)]
            np.testing.assert_allclose(gradient, expected, rtol=1e-5, atol=1e-2)
        assert np.all(l_xx >= 0)
        np.testing.assert_allclose(V_xx, V_xx.T, rtol=1e-12)
        assert np.linalg.eigvalsh(V_xx).min() > -1e-9 * np.abs(V_xx).max()


@pytest.mark.parametrize('cost', costs())
def test_errors_have_their_derivatives(cost, rng):
    x = rng.normal(size=len(cost.S)) * 2

    def differences(which):
        return [(errors(cost, x + step)[which][i] - errors(cost, x - step)[which][i]) / 2e-6
                for i, step in enumerate(1e-6 * np.eye(len(x)))]
    np.testing.assert_allclose(errors(cost, x).slope, differences(0), rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(errors(cost, x).bend, differences(1), rtol=1e-6, atol=1e-8)
    np.testing.assert_array_equal(errors(cost, np.array(cost.x_r)).e, 0.0)


def gradients(cost, x):
    """Return the gradients of the running and the terminal cost by a state, stacked."""
    size, V_x = len(x), np.empty(len(x))
    terminal_derivatives(cost, x, None, V_x, np.empty((size, size)))
    return np.array([running_derivatives(cost, x[None], np.zeros(1), None)[0, :size, 0], V_x])


@pytest.mark.parametrize('cost', costs())
def test_the_exact_hessian_meets_finite_differences(cost, rng):
    size = len(cost.S)
    for x in rng.normal(size=(20, size)) * 2.5:
        differences = np.stack([
            (gradients(cost, x + 1e-6 * e) - gradients(cost, x - 1e-6 * e)) / 2e-6
            for e in np.eye(size)], axis=-1)
        V_xx = np.empty((size, size))
        terminal_derivatives(cost, x, 1.0, np.empty(size), V_xx)
        l_xx = np.diag(running_derivatives(cost, x[None], np.zeros(1), 1.0)[0, size:, 0])
        for exact, expected in zip((l_xx, V_xx), differences):
            np.testing.assert_allclose(exact, expected, rtol=1e-6,
                                       atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize('cost', costs())
def test_tensors_cost_what_arrays_do(cost, rng):
    torch = pytest.importorskip('torch')
    X, U = rng.normal(size=(4, len(cost.S))) * 2.5, rng.normal(size=3) * 10
    tensors = [torch.tensor(x).unbind() for x in X]
    J = sum(running_cost(cost, x, torch.tensor(u)) for x, u in zip(tensors, U)) + terminal_cost(
        cost._replace(P=torch.tensor(cost.P)), tensors[-1])
    assert float(J) == pytest.approx(trajectory_cost(cost, X, U), rel=1e-12)


def test_the_hessian_is_exact_for_the_paper_s_cost(rng):
    cost, x = cost_of(PAPER), rng.normal(size=6)
    V_x, V_xx = np.empty(6), np.empty((6, 6))
    terminal_derivatives(cost, x, None, V_x, V_xx)
    l_xx = running_derivatives(cost, x[None], np.zeros(1), None)[0, len(x):, 0]
    np.testing.assert_allclose(l_xx, 2 * np.array(cost.S))
    np.testing.assert_allclose(V_xx, 2 * cost.P)


def test_the_soft_track_costs_only_beyond_its_margin():
    cost = cost_of(CostParameters(track_margin=0.2, track_weight=1000.0))
    free = cost_of(CostParameters(track_weight=0.0))
    for x, extra in ((2.19, 0.0), (2.3, 1000 * 0.1 ** 2), (-2.4, 1000 * 0.2 ** 2)):
        state = np.array([x, 0, 0, 0, 0, 0])
        assert running(cost, state, 0.0) - running(free, state, 0.0) == pytest.approx(extra)
