# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The optimal control problem that every solver solves.

    min Σ ℓ(x_t, u_t) + ℓ_f(x_N)   s.t.   x_{t+1} = f(x_t, u_t),   |u_t| ≤ u_max
"""

from dataclasses import dataclass
import math
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, solve_discrete_are

from dp_swing_ros.kernels import kernel
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.model import expand, linearise
from dp_swing_ros.pendulum.models import MODELS
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import ANGLES, Array
from dp_swing_ros.pendulum.trajectory import step
from dp_swing_ros.problem.cost import Cost, trajectory_cost
from dp_swing_ros.problem.parameters import CostParameters, PredictionParameters

TURN = 2 * math.pi
NO_POLICY = (np.empty((0, 6)), np.empty(0), np.empty((0, 6)))
SLOWEST = 1 - 1e-6  # spectral radius of a regulated model; at 1 an error would never die out


class LQR(NamedTuple):
    """The infinite-horizon regulator about the reference: value eᵀPe, force -Ke, e = x - x_r."""

    P: Array  # (6, 6)
    K: Array  # (6,)


@dataclass(frozen=True)
class Problem:
    """Model, cost and bound of the force, the length of a plan, and the regulator at the goal."""

    model: Any      # a NamedTuple of pendulum.models.MODELS
    cost: Cost
    horizon: int
    dt: float       # [s]
    u_max: float    # [N]
    lqr: LQR
    bodies: PendulumParameters
    given: tuple[LimitParameters, CostParameters, PredictionParameters]  # it was made from

    @classmethod
    def of(cls, bodies: PendulumParameters, limits: LimitParameters, cost: CostParameters,
           prediction: PredictionParameters) -> 'Problem':
        """
        Build the problem from parameters.

        Raises ParameterError where no regulator holds the reference state.
        """
        if limits.force_limit == 0:
            raise ParameterError('parameter force_limit is 0; the controller needs a force')
        model = MODELS[prediction.model].of(Pendulum.of(bodies), prediction.step)
        lqr = regulator(model, cost)
        S, x_r = np.array(cost.state_weights), np.array(cost.reference)
        P = lqr.P if cost.terminal_cost == 'lqr' else cost.terminal_scale * np.diag(S)
        return cls(model, Cost(
            S=S, R=cost.force_weight, P=np.ascontiguousarray(P), x_r=x_r, s_r=np.sin(x_r),
            c_r=np.cos(x_r), chord=cost.angle_error == 'chord',
            x_soft=limits.track_limit - cost.track_margin, w=cost.track_weight),
            prediction.horizon, prediction.step, limits.force_limit, lqr, bodies,
            (limits, cost, prediction))

    def with_bodies(self, bodies: PendulumParameters) -> 'Problem':
        """
        Build the same problem for other bodies.

        Raises ParameterError where no regulator holds the reference state.
        """
        return Problem.of(bodies, *self.given)


def turns_of(problem: Problem, x: Array) -> Array:
    """
    Return how far the goal on the turn of a state is from the reference: whole turns [rad].

    The goal of a solve is the one where its start ends; there the terminal cost is right.
    Shapes: x (6,) -> (6,). Where angles count as they are, as in the paper, there is one goal.
    """
    turns = np.zeros(6)
    if problem.cost.chord:
        for i in range(ANGLES.start, ANGLES.stop):
            turns[i] = TURN * np.rint((x[i] - problem.cost.x_r[i]) / TURN)
    return turns


def regulator(model: Any, cost: CostParameters) -> LQR:
    """
    Solve the discrete algebraic Riccati equation of the model at the reference state.

    Raises ParameterError where it has no stabilising solution.
    """
    x_r, S = np.array(cost.reference), np.diag(cost.state_weights)
    A, B = linearisation(model, x_r, 0.0)
    B = B[:, None]
    try:
        P = solve_discrete_are(A, B, S, np.array([[cost.force_weight]]))
        K = np.linalg.solve(cost.force_weight + B.T @ P @ B, B.T @ P @ A)
        radius = np.abs(np.linalg.eigvals(A - B @ K)).max()
    except (LinAlgError, ValueError):
        radius = np.inf
    if radius > SLOWEST:
        raise ParameterError(
            f'parameters reference {cost.reference} and state_weights '
            f'{cost.state_weights} give no regulator that comes to rest; expected an equilibrium '
            'and a positive weight on the position of the cart')
    return LQR((P + P.T) / 2, K[0])


@kernel
def linearisation(model, x, u):
    """Return A = ∂f/∂x (6, 6) and B = ∂f/∂u (6,)."""
    F = np.empty((6, 8))
    linearise(model, expand(model, np.expand_dims(x, 0), np.array([u])), 0, F)
    return F[:, :6].copy(), F[:, 6].copy()


@kernel
def regulate(cost, K, u_max, x):
    """Return the force -K (x - x_r) of the regulator, bounded; angles on the nearest turn."""
    u = 0.0
    for i in range(6):
        e = x[i] - cost.x_r[i]
        if cost.chord and (i == 1 or i == 2):
            e -= TURN * math.floor(e / TURN + 0.5)
        u -= K[i] * e
    return min(max(u, -u_max), u_max)


@kernel
def follow_policy(model, cost, lqr_gain, u_max, x_0, X, U, K, horizon):
    """
    Follow the policy u = U[t] + K[t] (x - X[t]), then the regulator up to the horizon.

    Returns the cost, infinite where it is not a number, states, forces and gains. The angles of X
    are brought to the turns of x_0.
    Shapes: x_0 (6,), X (T or more, 6), U (T,), K (T, 6) -> (horizon + 1, 6), (horizon,),
    (horizon, 6).
    """
    states, forces = np.empty((horizon + 1, 6)), np.empty(horizon)
    gains, turns = np.empty((horizon, 6)), np.zeros(6)
    if len(X) > 0:
        for i in range(1, 3):
            turns[i] = TURN * np.rint((x_0[i] - X[0, i]) / TURN)
    for i in range(6):
        states[0, i] = x_0[i]
    for t in range(horizon):
        x = states[t]
        if t < len(U):
            u = U[t]
            for i in range(6):
                gains[t, i] = K[t, i]
                u += K[t, i] * (x[i] - (X[t, i] + turns[i]))
            u = min(max(u, -u_max), u_max)
        else:
            for i in range(6):
                gains[t, i] = -lqr_gain[i]
            u = regulate(cost, lqr_gain, u_max, x)
        forces[t] = u
        step(model, x, u, states[t + 1])
    J = trajectory_cost(cost, states, forces)
    return J if np.isfinite(J) else np.inf, states, forces, gains


class Rollout(NamedTuple):
    """What came of a policy: cost, states (N + 1, 6), forces (N,), and its gains (N, 6)."""

    J: float
    X: Array
    U: Array
    K: Array


def policy_rollout(problem: Problem, x_0: Array, X: Array, U: Array, K: Array) -> Rollout:
    """Follow a policy, and where it ends the regulator, over the horizon; see follow_policy."""
    return Rollout(*follow_policy(problem.model, problem.cost, problem.lqr.K, problem.u_max, x_0,
                                  X, U, K, problem.horizon))


def regulator_rollout(problem: Problem, x_0: Array) -> Rollout:
    """Follow the regulator over the horizon."""
    return policy_rollout(problem, x_0, *NO_POLICY)
