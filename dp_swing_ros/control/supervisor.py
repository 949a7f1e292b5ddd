# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What stands between a plan and its force: limits, brake, fallback, zero.

The force of a command changes by as much as the drive may be asked for; the rest of the plan
follows from it. Cart and speed stay within their limits where the plan or, after its first step,
the brake keeps them there: as long as the brake does, the next tick may find something better.

A state that is rejected is predicted through; after `carry_over` without one to believe, whatever
the reason, the force is zero.
"""

from dataclasses import dataclass, replace
import math

import numpy as np

from dp_swing_ros.control.commands import RESOLUTION, SentCommands
from dp_swing_ros.control.observer import Belief
from dp_swing_ros.kernels import kernel
from dp_swing_ros.parameters import parameter, Parameters
from dp_swing_ros.pendulum.model import size, step
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.plan import IDLE, Plan, Status
from dp_swing_ros.problem.problem import (
    Bounds, plan_of, policy_rollout, Problem, regulator_rollout, turns_of)

ROUNDING = 1e-9    # [m, m/s]
HELD = 0.25        # [s] for which a driver obeys a last command, at most; see docs/rig.md


@dataclass(frozen=True)
class SupervisorParameters(Parameters):
    """When there is no force, and what a rig asks for beside the limits of force and track."""

    enabled: bool = parameter(
        True, 'force from the start on; else it is zero, while states are believed, until the '
        'service mpc/enable says otherwise')
    carry_over: float = parameter(
        0.2, 'time without a believed state (none came, or one that is not finite, out of range, '
        'frozen or refused by the estimator) after which the force is zero', unit='s',
        minimum=0.0, finite=False, scaled=True)
    force_rate_limit: float = parameter(
        math.inf, 'largest change of the command in a second; the zero that ends a stream comes '
        'at once', unit='N/s', minimum=1.0, finite=False)
    controlled_stop: float = parameter(
        0.0, 'time for which the cart is braked, until the force is zero and the mpc disabled, '
        'where a plan would not keep track_limit or cart_speed_limit, and where the process ends '
        '(0: no such stop)', unit='s', minimum=0.0, maximum=10.0)


class Supervisor:
    """Holds whether there may be a force, and a controlled stop."""

    def __init__(self, parameters: SupervisorParameters) -> None:
        """Take the limits."""
        self.parameters = parameters
        self.enabled = parameters.enabled
        self.stopping = ''              # why there is a controlled stop, if there is
        self.reset()

    def reset(self) -> None:
        """Forget when states were believed; whether it is enabled, or stops, stays."""
        self.believed = -math.inf       # [s] when the force for the last believed state acts
        self.measured = -math.inf       # [s] when that was measured
        self.stopped_at = math.inf      # [s] when a controlled stop is over

    def reconfigure(self, other: 'Supervisor') -> bool:
        """Go on with the parameters of another one; return whether it is enabled or disabled."""
        changes = other.parameters.enabled != self.parameters.enabled
        self.parameters = other.parameters
        return changes and self.enable(other.parameters.enabled)

    def enable(self, enabled: bool) -> bool:
        """Let forces act, or none; return whether that is a change."""
        if enabled == self.enabled and not self.stopping:
            return False
        self.enabled, self.stopping, self.stopped_at = enabled, '', math.inf
        return True

    def stop(self, why: str) -> None:
        """Brake the cart from now on, and be disabled when that is over."""
        self.stopping = why

    def admits(self, belief: Belief, x_0: Array, acts_at: float) -> bool:
        """Take what is believed; return whether a solve from x_0 (2n + 2,) may tell the force."""
        if not belief.rejection and belief.t > self.measured:   # else it says nothing new
            self.believed, self.measured = acts_at, belief.t
        return self.acts(acts_at) and not self.stopping and is_finite(x_0)

    def acts(self, acts_at: float) -> bool:
        """Return whether a force may act from a time on [s]."""
        if acts_at >= self.stopped_at - RESOLUTION:
            self.enable(False)
        # a clock that has gone back tells as little as one that has gone on
        blind = abs(acts_at - self.believed) > self.parameters.carry_over + RESOLUTION
        return self.enabled and not blind

    def fallback(self, belief: Belief, x_0: Array | None, last: Plan | None,
                 commands: SentCommands, acts_at: float) -> Plan:
        """
        Return a plan without a solve: the last one's policy, else the regulator, else zero force.

        Without a state x_0 (2n + 2,) the last plan's own prediction is taken.
        """
        problem, is_last = belief.problem, x_0 is None
        if x_0 is None and last is not None:
            x_0 = last.X[0]
        if x_0 is None or np.isnan(belief.x[0]):
            return self.zero(problem, problem.x_r)
        if not self.acts(acts_at):
            plan = self.zero(problem, x_0 if problem.physical.is_driven else problem.x_r)
            most = abs(x_0[len(x_0) // 2]) / HELD   # with more the cart would turn round
            return limited(problem, plan, Bounds(-most, most)) if is_last else plan
        if not is_finite(x_0):   # where a learned model is wild
            x_0 = belief.x
        if self.stopping:
            self.stopped_at = min(self.stopped_at, acts_at + self.parameters.controlled_stop)
            return braked(problem, x_0, *self.reach(belief, commands, acts_at))
        if last is not None:
            _, X, U, _ = policy_rollout(problem, x_0, last.X, last.U, last.K)
            if is_finite(X):
                return plan_of(problem, X, U, Status.LAST_POLICY)
        _, X, U, _ = regulator_rollout(problem.with_goal_on(turns_of(problem, x_0))[0], x_0)
        # Far from the reference the regulator would only drive the cart into the end stop.
        return plan_of(problem, X, U, Status.REGULATOR) if problem.is_reached(X[-1]) \
            else self.zero(problem, x_0)

    def zero(self, problem: Problem, x_0: Array) -> Plan:
        """Return a plan of zero force, of a cart that is driven one of zero speed."""
        status = Status.ZERO if self.enabled else Status.DISABLED
        if problem.physical.is_driven and is_finite(x_0):
            plan = braked(problem, x_0, 0.0, math.inf)
            return replace(plan, stats=plan.stats._replace(status=status))
        return plan_of(problem, np.tile(x_0, (problem.horizon + 1, 1)), np.zeros(problem.horizon),
                       status)

    def command(self, plan: Plan, belief: Belief, commands: SentCommands, acts_at: float) -> Plan:
        """Return the plan as it may be sent: within the limits of the rig, or braked."""
        if plan.stats.status in IDLE:
            return plan
        problem, (u, change) = belief.problem, self.reach(belief, commands, acts_at)
        plan = limited(problem, plan, Bounds(u - change, u + change))
        if self.parameters.controlled_stop > 0 and not self.stopping:
            self.stop(cannot_keep(problem, plan, change))
            if self.stopping:
                self.stopped_at = acts_at + self.parameters.controlled_stop
                plan = replace(braked(problem, plan.X[0], u, change),
                               stats=plan.stats._replace(status=Status.STOP))
        return replace(plan, drive=belief.drive)

    def reach(self, belief: Belief, commands: SentCommands,
              acts_at: float) -> tuple[float, float]:
        """Return the force [N] before a time [s], and by how much it may change then."""
        (command, since), rate = commands.last(acts_at), self.parameters.force_rate_limit
        change = math.inf if math.isinf(rate) else rate * min(acts_at - since, belief.problem.dt)
        drive = belief.drive
        return drive.gain * command + drive.bias, drive.gain * change


@kernel
def brake(model, bounds, u, change, x_0, horizon):
    """
    Bring the cart to rest as fast as the force can, and hold it there.

    u is the force before [N], change what it may change by in a step. Returns states and forces.
    Shapes: x_0 (2n + 2,) -> (horizon + 1, 2n + 2), (horizon,).
    """
    n = size(model)
    v = n // 2
    X, U = np.empty((horizon + 1, n)), np.empty(horizon)
    free, forced = np.empty(n), np.empty(n)
    for i in range(n):
        X[0, i] = x_0[i]
    for t in range(horizon):
        # over a step, the speed is very nearly a straight line of the force
        step(model, X[t], 0.0, free)
        step(model, X[t], 1.0, forced)
        low, high = max(bounds.low, u - change), min(bounds.high, u + change)
        u = min(max(free[v] / (free[v] - forced[v]), low), high)
        U[t] = u
        step(model, X[t], u, X[t + 1])
    return X, U


def braked(problem: Problem, x_0: Array, u: float, change: float) -> Plan:
    """Return the plan that brakes the cart from a state under a force u [N]; see `brake`."""
    X, U = brake(problem.model, problem.bounds, u, change, x_0, problem.horizon)
    return plan_of(problem, X, U, Status.STOP)


def limited(problem: Problem, plan: Plan, within: Bounds) -> Plan:
    """Return the plan with its first force within bounds [N], and what follows from that."""
    first = min(max(plan.U[0], within.low), within.high)
    if first == plan.U[0]:
        return plan
    U, K = plan.U.copy(), plan.K.copy()
    U[0], K[0] = first, 0.0
    _, X, U, K = policy_rollout(problem, plan.X[0], plan.X, U, K)
    return replace(plan, X=X, U=U, K=K)


def violation(problem: Problem, X: Array) -> str:
    """Return in words which limit states do not keep; empty where they keep them."""
    limits = problem.parameters.limits
    for i, limit, name, unit in (
            (0, limits.track_limit, 'track_limit', 'm'),
            (X.shape[1] // 2, limits.cart_speed_limit, 'cart_speed_limit', 'm/s')):
        largest = np.abs(X[:, i]).max()
        if not largest <= limit + ROUNDING:
            return f'{largest:.3g} {unit} instead of {name} {limit:g} {unit} at most'
    return ''


def is_finite(X: Array) -> bool:
    """Return whether all numbers are."""
    return bool(np.all(np.isfinite(X)))


def cannot_keep(problem: Problem, plan: Plan, change: float) -> str:
    """Return which limit neither the plan keeps nor, after its first step, the brake."""
    return violation(problem, plan.X[:1]) or (violation(problem, plan.X) and violation(
        problem, braked(problem, plan.X[1], plan.U[0], change).X))
