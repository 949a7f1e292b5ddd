# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The LQR at the goal for a force that is bounded.

    min Σ (eᵀ S e + R u²) + e_Nᵀ P e_N   s.t.   e⁺ = A e + B u,  u_min ≤ u ≤ u_max

and e = x - x_r. With P of the Riccati equation this is the regulator as long as the bound does not
act. Where it does, the regulator's rollout falls over and leads a local solver away; this problem
is convex, so its optimum is found. It is a trajectory of the linear model; Riccati passes about it
close the gaps to the real one, which is multiple shooting (Giftthaler et al., IROS 2018).
"""

import numpy as np
from scipy.linalg import cholesky, qr

from dp_swing_ros.kernels import kernel
from dp_swing_ros.pendulum.derivatives import expand, linearisation
from dp_swing_ros.pendulum.model import size, step
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.pendulum.units import scaled_speeds
from dp_swing_ros.problem.cost import trajectory_cost
from dp_swing_ros.problem.problem import Problem, Rollout, turns_of, without_dry_friction
from dp_swing_ros.solvers.riccati import backward, forward

REACH = (0.6, 10.0)  # [rad], and [m/s, rad/s] scaled, of the linear model
PASSES = 8    # to close the gaps in
DEARER = 2.0  # in one of them the cost may grow by this factor


@kernel
def find_gaps(model, X, U, gaps):
    """
    Write f(X[t], U[t]) - X[t + 1].

    Shapes: X (T + 1, 2n + 2), U (T,), gaps (T, 2n + 2).
    """
    for t in range(len(U)):
        step(model, X[t], U[t], gaps[t])
        for i in range(size(model)):
            gaps[t, i] -= X[t + 1, i]


class BoundedLQR:
    """The bounded least-squares problem min |L u + M e_0|² of a goal, factorised once."""

    def __init__(self, problem: Problem) -> None:
        """Condense the states, e_t = Φ_t e_0 + G_t u, and the cost."""
        self.problem = problem
        N, cost, n = problem.horizon, problem.cost, len(problem.cost.S)
        A, B = linearisation(without_dry_friction(problem.model), problem.x_r, 0.0)
        self.Phi, self.G = np.zeros((N + 1, n, n)), np.zeros((N + 1, n, N))
        self.Phi[0] = np.eye(n)
        for t in range(N):
            self.Phi[t + 1], self.G[t + 1] = A @ self.Phi[t], A @ self.G[t]
            self.G[t + 1, :, t] += B
        weights = [np.diag(np.sqrt(cost.S))] * N + [cholesky(problem.lqr.P)]
        of_force = [W @ G for W, G in zip(weights, self.G)]
        of_state = [W @ Phi for W, Phi in zip(weights, self.Phi)]
        links, (angle, speed) = problem.physical.links, REACH
        self.reach = np.array([
            np.inf, *[angle] * links, *scaled_speeds(speed, problem.scale, links)])
        Q, self.L = qr(np.vstack([np.sqrt(cost.R) * np.eye(N), *of_force]), mode='economic')
        self.M = Q.T @ np.vstack([np.zeros((N, n)), *of_state])

    def start(self, x_0: Array) -> Rollout | None:
        """
        Return a trajectory of the model to the goal, None where none is in reach.

        Shapes: x_0 (2n + 2,).
        """
        problem, turns = self.problem, turns_of(self.problem, x_0)
        e_0 = x_0 - turns - problem.x_r
        if np.any(np.abs(e_0[1:]) > self.reach[1:]):
            return None
        from scipy.optimize import lsq_linear   # 0.2 s of loading, which a plant does without
        U = lsq_linear(self.L, -self.M @ e_0, problem.bounds, method='bvls').x
        U = np.clip(U, *problem.bounds)
        found = self.closed(problem.x_r + self.Phi @ e_0 + self.G @ U, U)
        return None if found is None else found._replace(X=found.X + turns)

    def closed(self, X: Array, U: Array) -> Rollout | None:
        """Close the gaps of a trajectory of the linear model by Riccati passes about it."""
        problem, N = self.problem, self.problem.horizon
        model, cost, bounds = problem.model, problem.cost, problem.bounds
        J = trajectory_cost(cost, X, U)
        X_new, U_new, gaps = np.empty_like(X), np.empty_like(U), np.empty((N, X.shape[1]))
        k, K = np.empty(N), np.empty((N, X.shape[1]))
        find_gaps(model, X, U, gaps)
        for number in range(1, PASSES + 1):
            if not backward(model, cost, expand(model, X, U), X, U, gaps, bounds, 0.0, None,
                            k, K)[0]:
                return None
            # as much of the gaps at once as does not throw it over; in the end all that is left
            for alpha in (1.0, 0.5, 0.25) if number < PASSES else (1.0,):
                J_new = forward(model, cost, X, U, gaps, k, K, alpha, bounds, X_new, U_new)
                if J_new <= DEARER * J:
                    break
            J, X, X_new, U, U_new = J_new, X_new, X, U_new, U
            gaps *= 1 - alpha
            if alpha == 1.0 or not np.isfinite(J):
                break
        return Rollout(J, X, U, K) if np.isfinite(J) else None
