# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The recursion of iLQR and DDP against the paper's formulas, written out plainly."""

from dataclasses import replace
import math

import numpy as np
import pytest

from dp_swing_ros.kernels.lanes import STEPS
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.torch_twin import expand
from dp_swing_ros.pendulum.trajectory import rollout
from dp_swing_ros.problem.cost import running_derivatives, terminal_derivatives, trajectory_cost
from dp_swing_ros.problem.parameters import CostParameters, PredictionParameters
from dp_swing_ros.problem.problem import Problem, regulator_rollout
from dp_swing_ros.solvers.riccati import backward, forward, line_search

N = 12


@pytest.fixture
def problem():
    return Problem.of(PendulumParameters(cart_friction=0.1), LimitParameters(),
                      CostParameters(), PredictionParameters(horizon=N))


@pytest.fixture
def trajectory(problem, rng):
    """Return a disturbed catch near the top, where DDP's expansion is positive too."""
    x = np.array([0.05, 0.002, -0.002, 0.0, 0.01, 0.01])
    U = regulator_rollout(problem, x).U + rng.uniform(-0.1, 0.1, N)
    return rollout(problem.model, x, U), U


def pass_back(problem, X, U, *more):
    """Call the backward pass for a trajectory of the model, which has no gaps."""
    return backward(problem.model, problem.cost, X, U, np.zeros((N, 6)), *more)


def plain(problem, X, U, mu, tensor, gaps=np.zeros((N, 6))):
    """Return k and K of (26)-(32), (36), (37) with autograd's derivatives and no force bound."""
    import torch
    A, B, second = (part.numpy() for part in expand(
        'rk4', problem.model.pendulum, problem.dt, torch.tensor(X[:-1]), torch.tensor(U)))
    V_x, V_xx = np.empty(6), np.empty((6, 6))
    terminal_derivatives(problem.cost, X[-1], V_x, V_xx)
    k, K = np.empty(N), np.empty((N, 6))
    of_cost = running_derivatives(problem.cost, X, U)
    for t in range(N - 1, -1, -1):
        l_x, l_xx = (part[t // STEPS, :, t % STEPS] for part in of_cost)
        a, b = A[t], B[t][:, None]
        V_x = V_x + V_xx @ gaps[t]
        W = np.einsum('i,ijk->jk', V_x, second[t]) * tensor
        Q_x = l_x + a.T @ V_x
        Q_u = 2 * problem.cost.R * U[t] + b.T @ V_x
        Q_xx = np.diag(l_xx) + a.T @ V_xx @ a + W[:6, :6]
        Q_ux = b.T @ V_xx @ a + W[6:, :6]
        Q_uu = 2 * problem.cost.R + b.T @ V_xx @ b + W[6:, 6:]
        V_mu = V_xx + mu * np.eye(6)
        Q_uu_mu = 2 * problem.cost.R + b.T @ V_mu @ b + W[6:, 6:]
        Q_ux_mu = b.T @ V_mu @ a + W[6:, :6]
        k_t, K_t = -np.linalg.solve(Q_uu_mu, Q_u), -np.linalg.solve(Q_uu_mu, Q_ux_mu)
        V_x = Q_x + K_t.T @ Q_uu @ k_t + K_t.T @ Q_u + Q_ux.T @ k_t
        V_xx = Q_xx + K_t.T @ Q_uu @ K_t + K_t.T @ Q_ux + Q_ux.T @ K_t
        k[t], K[t] = k_t[0], K_t[0]
    return k, K


@pytest.mark.parametrize('tensor', [0.0, 0.3, 1.0], ids=['ilqr', 'between', 'ddp'])
@pytest.mark.parametrize('mu', [0.0, 10.0])
def test_gains_are_the_paper_s(problem, trajectory, tensor, mu):
    X, U = trajectory
    k, K = np.empty(N), np.empty((N, 6))
    positive, slope, bend = pass_back(problem, X, U, math.inf, mu, tensor, k, K)
    k_plain, K_plain = plain(problem, X, U, mu, tensor)
    assert positive
    np.testing.assert_allclose(k, k_plain, rtol=1e-7)
    np.testing.assert_allclose(K, K_plain, rtol=1e-7, atol=1e-9)
    assert slope < 0


def test_gains_about_a_path_with_gaps(problem, trajectory, rng):
    X, U = trajectory
    k, K, gaps = np.empty(N), np.empty((N, 6)), rng.normal(0.0, 1e-4, (N, 6))
    assert backward(problem.model, problem.cost, X, U, gaps, math.inf, 0.0, 1.0, k, K)[0]
    k_plain, K_plain = plain(problem, X, U, 0.0, 1.0, gaps)
    np.testing.assert_allclose(k, k_plain, rtol=1e-7)
    np.testing.assert_allclose(K, K_plain, rtol=1e-7, atol=1e-9)
    assert not np.allclose(k, plain(problem, X, U, 0.0, 1.0)[0])


@pytest.mark.parametrize('tensor', [0.0, 1.0], ids=['ilqr', 'ddp'])
def test_the_slope_is_the_cost_s(problem, trajectory, tensor):
    """For a small α the cost changes by α slope."""
    X, U = trajectory
    k, K = np.empty(N), np.empty((N, 6))
    _, slope, _ = pass_back(problem, X, U, math.inf, 0.0, tensor, k, K)
    J = trajectory_cost(problem.cost, X, U)
    X_new, U_new = np.empty_like(X), np.empty_like(U)
    change = forward(problem.model, problem.cost, X, U, np.zeros((N, 6)), k, K, 1e-7, math.inf,
                     X_new, U_new) - J
    assert change == pytest.approx(1e-7 * slope, rel=1e-3)


def test_on_the_bound_the_force_stays_and_does_not_follow(problem, trajectory):
    X, U = trajectory
    k, K = np.empty(N), np.empty((N, 6))
    u_max = 0.5
    pass_back(problem, X, U, u_max, 0.0, 0.0, k, K)
    on_bound = np.isclose(np.abs(U + k), u_max)
    assert 0 < on_bound.sum() < N
    assert np.all(np.abs(U + k) <= u_max + 1e-12)
    np.testing.assert_array_equal(K[on_bound], 0.0)
    assert np.all(np.abs(K[~on_bound]).max(axis=1) > 0)


def test_a_linear_problem_is_solved_in_one_step(problem):
    """At the goal one Newton step of full length reaches the optimum."""
    x = np.array([1e-4, 1e-5, -1e-5, 0, 0, 0])
    U = np.zeros(N)
    X = rollout(problem.model, x, U)
    k, K = np.empty(N), np.empty((N, 6))
    J = trajectory_cost(problem.cost, X, U)
    _, slope, bend = pass_back(problem, X, U, 20.0, 0.0, 0.0, k, K)
    X_new, U_new = np.empty_like(X), np.empty_like(U)
    J_new = line_search(problem.model, problem.cost, X, U, J, k, K, slope, bend,
                        20.0, X_new, U_new)
    assert J_new == pytest.approx(x @ problem.lqr.P @ x, rel=1e-3)
    assert J_new - J == pytest.approx(slope + bend / 2, rel=1e-3)


def test_a_curvature_that_is_not_positive_is_reported(problem, trajectory):
    X, U = trajectory
    concave = problem.cost._replace(P=-problem.cost.P)
    k, K = np.empty(N), np.empty((N, 6))
    assert not pass_back(replace(problem, cost=concave), X, U, 20.0, 0.0, 0.0, k, K)[0]
