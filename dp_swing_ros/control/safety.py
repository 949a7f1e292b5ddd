# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Limits that a plan must keep before it is sent, whatever the solver thinks of it.

The force of a command changes by as much as the drive may be asked for; the rest of the plan
follows from it. Cart and speed stay within their limits where the plan or, after its first step,
the brake keeps them there: as long as the brake does, the next tick may find something better.
"""

from dataclasses import dataclass, replace
import math

import numpy as np

from dp_swing_ros.kernels import kernel
from dp_swing_ros.parameters import parameter, Parameters
from dp_swing_ros.pendulum.model import size, step
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.plan import Plan, Status
from dp_swing_ros.problem.problem import Bounds, plan_of, policy_rollout, Problem

ROUNDING = 1e-9   # [m, m/s]


@dataclass(frozen=True)
class SafetyParameters(Parameters):
    """What a rig asks for beside the limits of force and track."""

    force_rate_limit: float = parameter(
        math.inf, 'largest change of the command in a second; the zero that ends a stream comes '
        'at once', unit='N/s', minimum=1.0, finite=False)
    controlled_stop: float = parameter(
        0.0, 'time for which the cart is braked, until the force is zero and the mpc disabled, '
        'where a plan would not keep track_limit or cart_speed_limit, and where the process ends '
        '(0: no such stop)', unit='s', minimum=0.0, maximum=10.0)


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
    limits, cost, _ = problem.given
    for i, limit, name, unit in (
            (0, limits.track_limit, 'track_limit', 'm'),
            (X.shape[1] // 2, cost.cart_speed_limit, 'cart_speed_limit', 'm/s')):
        largest = np.abs(X[:, i]).max()
        if not largest <= limit + ROUNDING:
            return f'{largest:.3g} {unit} instead of {name} {limit:g} {unit} at most'
    return ''
