# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The optimal control problem that every solver solves.

    min Σ ℓ(x_t, u_t) + ℓ_f(x_N)   s.t.   x_{t+1} = f(x_t, u_t),   u_min ≤ u_t ≤ u_max
"""

import contextlib
from dataclasses import dataclass, field, replace
from functools import cached_property
import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, solve_discrete_are

from dp_swing_ros.dynamics.files import LearnedModel
from dp_swing_ros.kernels import kernel
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.derivatives import linearisation
from dp_swing_ros.pendulum.equations import Pendulum, resting, scale_of
from dp_swing_ros.pendulum.model import Model, size, step
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import (
    angles, Array, hanging, is_at_rest, SIZES, upright_bounds)
from dp_swing_ros.pendulum.units import Units
from dp_swing_ros.problem.cost import ANGLE_ERRORS, Cost, is_periodic, trajectory_cost
from dp_swing_ros.problem.parameters import CostParameters, PredictionParameters
from dp_swing_ros.problem.plan import Plan, SolverStats, Status

TURN = 2 * math.pi
FAST = 0.9          # of the limit of the cart's speed, from where on it costs
SLOWEST = 1 - 1e-6  # spectral radius of a regulated model; at 1 an error would never die out


class LQR(NamedTuple):
    """The infinite-horizon regulator about the reference: value eᵀPe, force -Ke, e = x - x_r."""

    P: Array  # (2n + 2, 2n + 2)
    K: Array  # (2n + 2,)


class Bounds(NamedTuple):
    """Between which forces [N] the solvers may choose."""

    low: float
    high: float


class ProblemParameters(NamedTuple):
    """The parameters that a problem is made from, beside those of the pendulum."""

    limits: LimitParameters
    cost: CostParameters
    prediction: PredictionParameters


@dataclass(frozen=True)
class Problem:
    """Model, cost and bounds of the force, the length of a plan, and the regulator at the goal."""

    model: Model
    cost: Cost
    horizon: int
    bounds: Bounds
    lqr: LQR
    physical: PendulumParameters
    parameters: ProblemParameters
    scale: Units                          # of the bodies that were given
    learned: LearnedModel | None = None   # instead of the equations of the pendulum
    # with the goal on other turns, as far as they were asked for
    others: dict[tuple[float, ...], 'Problem'] = field(
        default_factory=dict, init=False, repr=False, compare=False)

    @classmethod
    def of(cls, physical: PendulumParameters, limits: LimitParameters, cost: CostParameters,
           prediction: PredictionParameters, learned: LearnedModel | None = None,
           scale: Units | None = None) -> 'Problem':
        """
        Build the problem from parameters; a learned model takes the place of the pendulum's.

        Raises ParameterError where no regulator holds the reference state, or where the cost is
        that of another number of links.
        """
        u_max = limits.input_limit(physical.drive)
        if u_max == 0:
            name, what = ('acceleration_limit', 'an acceleration') if physical.is_driven else (
                'force_limit', 'a force')
            raise ParameterError(f'parameter {name} is 0; the controller needs {what}')
        for name in ('reference', 'state_weights'):
            count = len(getattr(cost, name))
            if count != SIZES[physical.links]:
                raise ParameterError(
                    f'parameter {name} has {count} numbers; expected {SIZES[physical.links]} for '
                    f'links {physical.links}')
        scale = scale or scale_of(physical)
        dynamics = Pendulum.of(physical, scale=scale) if learned is None else learned.dynamics
        model = Model(dynamics, prediction.integrator, prediction.step)
        x = float(cost.x_r[0])
        if abs(x) > limits.track_limit or not math.isfinite(x * x):
            raise ParameterError(f'parameter reference has the cart at {x:g} m; expected a place '
                                 f'on the track, at most {limits.track_limit:g} m from its centre')
        if not is_at_rest(cost.x_r):
            raise ParameterError(
                f'parameter reference is {tuple(cost.x_r.tolist())}; expected an equilibrium: '
                'each link up or down (an angle of 0 or π), speeds of 0')
        x_r = goal_of(model, cost.x_r)
        lqr = regulator(model, cost, x_r)
        return cls(model, Cost(
            S=cost.state_weights, R=cost.force_weight, P=terminal_weights(cost, lqr),
            x_r=tuple(x_r.tolist()), angle_error=ANGLE_ERRORS[cost.angle_error],
            x_soft=limits.track_limit - cost.track_margin, w=cost.track_weight,
            v_soft=FAST * limits.cart_speed_limit, w_v=cost.speed_weight),
            prediction.horizon, Bounds(-u_max, u_max), lqr, physical,
            ProblemParameters(limits, cost, prediction), scale, learned)

    @property
    def warning(self) -> str:
        """Return what is possible, but hardly meant, or nothing."""
        limits, cost, _ = self.parameters
        margin, track = cost.track_margin, limits.track_limit
        return '' if cost.track_weight == 0 or 2 * margin < track else (
            f'parameter track_margin is {margin:g} m of the {track:g} m of track on either side, '
            f'and plans avoid it; expected less than half, {track / 2:g} m')

    @property
    def dt(self) -> float:
        """Return the duration of a step [s]."""
        return self.model.h

    @property
    def u_max(self) -> float:
        """Return the largest force either way [N]."""
        return max(-self.bounds.low, self.bounds.high)

    @property
    def x_r(self) -> Array:
        """Return the reference state (2n + 2,)."""
        return np.array(self.cost.x_r)

    def is_reached(self, x: Array) -> bool:
        """Return whether a state (2n + 2,) is that of the goal, or nearly, on any turn."""
        there = self.on_turn_of(x)
        return there is not None and bool(is_near(x, there.cost.x_r, self.nearness))

    @cached_property
    def nearness(self) -> Array:
        """Return how far from the goal each number of a state (2n + 2,) may be to be there."""
        return upright_bounds(self.physical.links, self.scale)

    @cached_property
    def winds_up(self) -> bool:
        """Return whether springs tell one turn from another."""
        return isinstance(self.model.pendulum, Pendulum) and any(self.model.pendulum.stiffness)

    def with_goal_on(self, turns: Array | float) -> tuple['Problem', Array | float]:
        """
        Return what to solve for a goal on other turns, and by what states are turned back for it.

        Without springs that is the same problem for states turned back by as much. With them
        states stay as they are and the goal moves: springs wind up from turn to turn, and links
        rest elsewhere. Shapes: turns and the angles to turn back by (2n + 2,), or 0.
        """
        if not self.winds_up or not np.any(turns):
            return self, turns
        key = tuple(np.asarray(turns).tolist())
        if key not in self.others:
            self.others[key] = self
            cost = self.parameters.cost
            with contextlib.suppress(ParameterError):   # where no regulator holds them there
                x_r = goal_of(self.model, cost.x_r + turns)
                lqr = regulator(self.model, cost, x_r)
                self.others[key] = replace(self, lqr=lqr, cost=self.cost._replace(
                    x_r=tuple(x_r.tolist()), P=terminal_weights(cost, lqr)))
        return self.others[key], 0.0

    def on_turn_of(self, x: Array) -> 'Problem | None':
        """Return the problem on the turn of a state (2n + 2,), or None if springs leave none."""
        if not self.winds_up or not np.all(np.isfinite(x)):
            return self
        turns = turns_of(self, x)
        found, _ = self.with_goal_on(turns)
        return None if found is self and turns.any() else found

    def with_physical(self, physical: PendulumParameters) -> 'Problem':
        """
        Build the same problem for other physical parameters.

        Raises ParameterError where no regulator holds the reference state.
        """
        return Problem.of(physical, *self.parameters, self.learned, self.scale)

    def with_prediction(self, prediction: PredictionParameters) -> 'Problem':
        """Build the same problem in other steps; raises ParameterError as with_physical does."""
        return replace(Problem.of(self.physical, *self.parameters._replace(prediction=prediction),
                                  self.learned, self.scale), bounds=self.bounds)


def turns_of(problem: Problem, x: Array) -> Array:
    """
    Return how far the goal on the turn of a state is from the reference: whole turns [rad].

    The goal of a solve is the one where its start ends; there the terminal cost is right.
    Shapes: x (2n + 2,) -> (2n + 2,). Where angles count as they are, as in the paper, there is
    one goal.
    """
    turns = np.zeros(len(x))
    if problem.cost.angle_error.periodic:
        where = angles(x)
        turns[where] = TURN * np.rint((x[where] - problem.cost.x_r[where]) / TURN)
    return turns


def without_dry_friction(model: Model) -> Model:
    """
    Return the model without dry friction.

    About a state at rest its linearisation would take what is dry, made smooth, for strong viscous
    friction, and a regulator would rely on it.
    """
    return model._replace(pendulum=model.pendulum.without_dry_friction())


def goal_of(model: Model, x: Array) -> Array:
    """
    Return where links rest that would in a state (2n + 2,) if they had no springs.

    Raises ParameterError where they do not, nearby.
    """
    if not isinstance(model.pendulum, Pendulum):
        return x
    try:
        return resting(model.pendulum, x)
    except ValueError as error:
        raise ParameterError(f'parameters joint1_stiffness, joint1_preload …: {error}; expected '
                             'weaker ones') from None


def terminal_weights(cost: CostParameters, lqr: LQR) -> Array:
    """Return P of the cost, (2n + 2, 2n + 2)."""
    return np.ascontiguousarray(lqr.P if cost.terminal_cost == 'lqr' else (
        cost.terminal_scale * np.diag(cost.state_weights)))


def regulator(model: Model, cost: CostParameters, x_r: Array) -> LQR:
    """
    Solve the discrete algebraic Riccati equation of the model at a reference state (2n + 2,).

    Raises ParameterError where it has no stabilising solution.
    """
    S = np.diag(cost.state_weights)
    A, B = linearisation(without_dry_friction(model), x_r, 0.0)
    B = B[:, None]
    try:
        P = solve_discrete_are(A, B, S, np.array([[cost.force_weight]]))
        K = np.linalg.solve(cost.force_weight + B.T @ P @ B, B.T @ P @ A)
        radius = np.abs(np.linalg.eigvals(A - B @ K)).max()
    except (LinAlgError, ValueError):
        radius = np.inf
    if radius > SLOWEST:
        raise ParameterError(
            f'parameters reference {tuple(x_r.tolist())} and state_weights '
            f'{cost.state_weights} give no regulator that comes to rest; expected an equilibrium, '
            'a positive weight on the position of the cart, and gravity')
    return LQR((P + P.T) / 2, K[0])


def growth(model: Model) -> float:
    """Return the factor by which a motion about hanging at rest grows in a step of the model."""
    A, _ = linearisation(without_dry_friction(model), hanging(size(model) // 2 - 1), 0.0)
    return float(np.abs(np.linalg.eigvals(A)).max()) if np.all(np.isfinite(A)) else math.inf


@kernel
def is_near(x, x_r, bounds):
    """Return whether a state is within bounds of another, on any turn; shapes: (2n + 2,)."""
    for i in range(len(x)):
        e = x[i] - x_r[i]
        if 0 < i < len(x) // 2:
            e -= TURN * np.rint(e / TURN)
        if not abs(e) <= bounds[i]:   # nor is what is no number
            return False
    return True


@kernel
def regulate(cost, K, bounds, x):
    """Return the force -K (x - x_r) of the regulator, bounded; angles on the nearest turn."""
    u = 0.0
    for i in range(len(K)):
        e = x[i] - cost.x_r[i]
        if is_periodic(cost) and 0 < i < len(K) // 2:
            e -= TURN * math.floor(e / TURN + 0.5)
        u -= K[i] * e
    return min(max(u, bounds.low), bounds.high)


@kernel
def follow_policy(model, cost, lqr_gain, bounds, x_0, X, U, K, horizon):
    """
    Follow the policy u = U[t] + K[t] (x - X[t]), then the regulator up to the horizon.

    Returns the cost, infinite where it is not a number, states, forces and gains. The angles of X
    are brought to the turns of x_0.
    Shapes: x_0 (2n + 2,), X (T or more, 2n + 2), U (T,), K (T, 2n + 2) ->
    (horizon + 1, 2n + 2), (horizon,), (horizon, 2n + 2).
    """
    n = size(model)
    states, forces = np.empty((horizon + 1, n)), np.empty(horizon)
    gains, turns = np.empty((horizon, n)), np.zeros(n)
    if len(X) > 0:
        for i in range(1, n // 2):
            turns[i] = TURN * np.rint((x_0[i] - X[0, i]) / TURN)
    for i in range(n):
        states[0, i] = x_0[i]
    for t in range(horizon):
        x = states[t]
        if t < len(U):
            u = U[t]
            for i in range(n):
                gains[t, i] = K[t, i]
                u += K[t, i] * (x[i] - (X[t, i] + turns[i]))
            u = min(max(u, bounds.low), bounds.high)
        else:
            for i in range(n):
                gains[t, i] = -lqr_gain[i]
            u = regulate(cost, lqr_gain, bounds, x)
        forces[t] = u
        step(model, x, u, states[t + 1])
    J = trajectory_cost(cost, states, forces)
    return J if np.isfinite(J) else np.inf, states, forces, gains


class Rollout(NamedTuple):
    """What came of a policy: cost, states (N + 1, 2n + 2), forces (N,), gains (N, 2n + 2)."""

    J: float
    X: Array
    U: Array
    K: Array


def policy_rollout(problem: Problem, x_0: Array, X: Array, U: Array, K: Array) -> Rollout:
    """Follow a policy, and where it ends the regulator, over the horizon; see follow_policy."""
    return Rollout(*follow_policy(*kernel_arguments(problem), x_0, X, U, K, problem.horizon))


def regulator_rollout(problem: Problem, x_0: Array) -> Rollout:
    """Follow the regulator over the horizon."""
    none = np.empty((0, len(x_0)))
    return policy_rollout(problem, x_0, none, np.empty(0), none)


def kernel_arguments(problem: Problem) -> tuple[Model, Cost, Array, Bounds]:
    """Return what kernels need to follow policies: model, cost, gain of the regulator, bounds."""
    return problem.model, problem.cost, problem.lqr.K, problem.bounds


def plan_of(problem: Problem, X: Array, U: Array, status: Status,
            K: Array | None = None) -> Plan:
    """
    Make a plan that no solver made; without gains, one without feedback.

    Shapes: X (T + 1, 2n + 2), U (T,), K (T, 2n + 2).
    """
    J = trajectory_cost(problem.cost, X, U)
    return Plan(X, U, np.zeros((len(U), X.shape[1])) if K is None else K, problem.dt,
                SolverStats(status, J, 0, 0.0))
