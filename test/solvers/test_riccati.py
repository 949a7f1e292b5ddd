# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The recursion of iLQR and DDP against the paper's formulas, written out plainly."""

from dataclasses import replace
import math

import numpy as np
import pytest

from dp_swing_ros.control import controllers
from dp_swing_ros.pendulum.derivatives import expand, STEPS
from dp_swing_ros.pendulum.model import advance, rollout
from dp_swing_ros.pendulum.state import LINKS
from dp_swing_ros.problem.cost import running_derivatives, terminal_derivatives, trajectory_cost
from dp_swing_ros.problem.problem import Bounds, regulator_rollout
from dp_swing_ros.solvers.riccati import backward, forward, line_search

N = 12
UNBOUNDED = Bounds(-math.inf, math.inf)


@pytest.fixture(params=LINKS)
def problem(request):
    return controllers.problem({'links': request.param, 'cart_friction': 0.1, 'horizon': N})


@pytest.fixture
def trajectory(problem, rng):
    """Return one near the top, disturbed, where DDP's expansion is positive too."""
    n = problem.physical.links
    size = 0.01 if n > 2 else 1.0   # three links diverge soon
    x = size * np.array([0.05, *(0.002, -0.002, 0.002)[:n], 0.0, *[0.01] * n])
    U = regulator_rollout(problem, x).U + size * rng.uniform(-0.1, 0.1, N)
    return rollout(problem.model, x, U), U


def no_gaps(X):
    return np.empty((0, X.shape[1]))


def empty_policy(X):
    """Return memory for k and K."""
    return np.empty(N), np.empty((N, X.shape[1]))


def pass_back(problem, X, U, bounds, mu, tensor, *policy):
    """Call the backward pass for a trajectory of the model, which has no gaps."""
    return backward(problem.model, problem.cost, expand(problem.model, X, U), X, U, no_gaps(X),
                    bounds, mu, tensor, *policy)


def expansions(problem, X, U):
    """Return the first and second derivatives of all steps by (x, u), by autograd."""
    import torch

    def f(z):
        return torch.stack(list(advance(problem.model, z[:-1].unbind(), z[-1])))
    first = torch.func.jacrev(f)
    Z = torch.tensor(np.column_stack((X[:-1], U)))
    return (torch.func.vmap(first)(Z).numpy(),
            torch.func.vmap(torch.func.jacfwd(first))(Z).numpy())


def plain(problem, X, U, mu, tensor, gaps=None):
    """Return k and K of (26)-(32), (36), (37) with autograd's derivatives and no force bound."""
    n = X.shape[1]
    V_x, V_xx = np.empty(n), np.empty((n, n))
    terminal_derivatives(problem.cost, X[-1], tensor, V_x, V_xx)
    k, K = empty_policy(X)
    of_cost = running_derivatives(problem.cost, X, U, tensor)
    of_steps = expansions(problem, X, U)
    for t in range(N - 1, -1, -1):
        l_x, l_xx = np.split(of_cost[t // STEPS, :, t % STEPS], 2)
        F, second = of_steps[0][t], of_steps[1][t]
        a, b = F[:, :n], F[:, n:]
        if gaps is not None:
            V_x = V_x + V_xx @ gaps[t]
        W = np.einsum('i,ijk->jk', V_x, second) * (tensor or 0.0)
        Q_x = l_x + a.T @ V_x
        Q_u = 2 * problem.cost.R * U[t] + b.T @ V_x
        Q_xx = np.diag(l_xx) + a.T @ V_xx @ a + W[:n, :n]
        Q_ux = b.T @ V_xx @ a + W[n:, :n]
        Q_uu = 2 * problem.cost.R + b.T @ V_xx @ b + W[n:, n:]
        V_mu = V_xx + mu * np.eye(n)
        Q_uu_mu = 2 * problem.cost.R + b.T @ V_mu @ b + W[n:, n:]
        Q_ux_mu = b.T @ V_mu @ a + W[n:, :n]
        k_t, K_t = -np.linalg.solve(Q_uu_mu, Q_u), -np.linalg.solve(Q_uu_mu, Q_ux_mu)
        V_x = Q_x + K_t.T @ Q_uu @ k_t + K_t.T @ Q_u + Q_ux.T @ k_t
        V_xx = Q_xx + K_t.T @ Q_uu @ K_t + K_t.T @ Q_ux + Q_ux.T @ K_t
        k[t], K[t] = k_t[0], K_t[0]
    return k, K


@pytest.mark.parametrize('tensor', [None, 0.3, 1.0], ids=['ilqr', 'between', 'ddp'])
@pytest.mark.parametrize('mu', [0.0, 10.0])
def test_gains_are_the_paper_s(problem, trajectory, tensor, mu):
    X, U = trajectory
    k, K = empty_policy(X)
    positive, slope, bend = pass_back(problem, X, U, UNBOUNDED, mu, tensor, k, K)
    k_plain, K_plain = plain(problem, X, U, mu, tensor)
    assert positive
    np.testing.assert_allclose(k, k_plain, rtol=1e-7)
    np.testing.assert_allclose(K, K_plain, rtol=1e-7, atol=1e-9)
    assert slope < 0


@pytest.mark.parametrize('mu', [0.0, 1.0, 1e3])
def test_a_regularised_gain_follows_a_dearer_state(problem, trajectory, mu):
    """At the last step K = -(2 R + Bᵀ (P + μ I) B)⁻¹ Bᵀ (P + μ I) A, by finite differences."""
    X, U = trajectory
    k, K = empty_policy(X)
    assert pass_back(problem, X, U, UNBOUNDED, mu, None, k, K)[0]
    n, h = X.shape[1], 1e-6
    V_x, V = np.empty(n), np.empty((n, n))
    terminal_derivatives(problem.cost, X[-1], None, V_x, V)
    V = np.triu(V) + np.triu(V, 1).T + mu * np.eye(n)   # its upper triangle counts

    def f(z):
        return rollout(problem.model, z[:n], z[n:])[1]
    z = np.append(X[-2], U[-1])
    F = np.column_stack([(f(z + dz) - f(z - dz)) / (2 * h) for dz in h * np.eye(n + 1)])
    A, B = F[:, :n], F[:, n]
    expected = -(B @ V @ A) / (2 * problem.cost.R + B @ V @ B)
    np.testing.assert_allclose(K[-1], expected, rtol=1e-4, atol=1e-6)


def test_gains_about_a_path_with_gaps(problem, trajectory, rng):
    X, U = trajectory
    (k, K), gaps = empty_policy(X), rng.normal(0.0, 1e-6, (N, X.shape[1]))
    points = expand(problem.model, X, U)
    assert backward(problem.model, problem.cost, points, X, U, gaps, UNBOUNDED, 0.0, 1.0, k, K)[0]
    k_plain, K_plain = plain(problem, X, U, 0.0, 1.0, gaps)
    np.testing.assert_allclose(k, k_plain, rtol=1e-7)
    np.testing.assert_allclose(K, K_plain, rtol=1e-7, atol=1e-9)
    assert not np.allclose(k, plain(problem, X, U, 0.0, 1.0)[0])


@pytest.mark.parametrize('tensor', [None, 1.0], ids=['ilqr', 'ddp'])
def test_the_slope_is_the_cost_s(problem, trajectory, tensor):
    """For a small α the cost changes by α slope."""
    X, U = trajectory
    k, K = empty_policy(X)
    _, slope, _ = pass_back(problem, X, U, UNBOUNDED, 0.0, tensor, k, K)
    J = trajectory_cost(problem.cost, X, U)
    X_new, U_new = np.empty_like(X), np.empty_like(U)
    change = forward(problem.model, problem.cost, X, U, no_gaps(X), k, K, 1e-7, UNBOUNDED,
                     X_new, U_new) - J
    assert change == pytest.approx(1e-7 * slope, rel=1e-3)


@pytest.mark.parametrize('side', [-1, 1])
@pytest.mark.parametrize('bounds', [Bounds(-0.5, 0.8), Bounds(-0.8, 0.5)])
def test_on_the_bound_the_force_stays_and_does_not_follow(problem, trajectory, bounds, side):
    """The mirrored trajectory is one, too, and meets the other bound."""
    X, U = (side * part for part in trajectory)
    k, K = empty_policy(X)
    pass_back(problem, X, U, bounds, 0.0, None, k, K)
    low, high = (np.isclose(U + k, bound) for bound in bounds)
    assert np.all((bounds.low - 1e-12 <= U + k) & (U + k <= bounds.high + 1e-12))
    on_bound = low | high
    assert 0 < on_bound.sum() < N
    assert low.any() == (side < 0) and high.any() == (side > 0)
    np.testing.assert_array_equal(K[on_bound], 0.0)
    assert np.all(np.abs(K[~on_bound]).max(axis=1) > 0)


def test_a_linear_problem_is_solved_in_one_step(problem):
    """At the goal one Newton step of full length reaches the optimum."""
    x = np.zeros(len(problem.cost.S))
    x[:2] = 1e-5, 1e-6
    U = np.zeros(N)
    X = rollout(problem.model, x, U)
    k, K = empty_policy(X)
    J = trajectory_cost(problem.cost, X, U)
    _, slope, bend = pass_back(problem, X, U, problem.bounds, 0.0, None, k, K)
    X_new, U_new = np.empty_like(X), np.empty_like(U)
    J_new = line_search(problem.model, problem.cost, X, U, J, k, K, slope, bend,
                        problem.bounds, X_new, U_new)
    assert J_new == pytest.approx(x @ problem.lqr.P @ x, rel=1e-3)
    assert J_new - J == pytest.approx(slope + bend / 2, rel=1e-3)


def test_a_curvature_that_is_not_positive_is_reported(problem, trajectory):
    X, U = trajectory
    concave = problem.cost._replace(P=-problem.cost.P)
    k, K = empty_policy(X)
    assert not pass_back(replace(problem, cost=concave), X, U, problem.bounds, 0.0, None, k, K)[0]
