# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The result of a solve: a plan is a trajectory with the policy around it."""

from dataclasses import dataclass, replace
import enum
import math
from typing import NamedTuple

import numpy as np

from dp_swing_ros.pendulum.parameters import DIRECT, Drive
from dp_swing_ros.pendulum.state import Array, between


class Status(enum.Enum):
    """How a solve ended; the value says what it means and what to do about it."""

    CONVERGED = 'a further iteration would not lower the cost'
    COMPLETE = 'all samples were drawn, or more would hardly lower the cost'
    ITERATION_LIMIT = 'stopped at the iteration limit; the next tick goes on from here'
    DEADLINE = 'stopped by the deadline with the best plan so far'
    STALLED = 'no step lowered the cost; raise the largest regularisation or change the start'
    FAILED = 'no finite plan was found; look at the state and the weights'
    FEEDBACK = 'no solve was due; this is the last plan, with its feedback from the newest state'
    LAST_POLICY = 'the solve failed; this is the last plan, followed as a policy'
    REGULATOR = 'the solve failed; this is the regulator at the reference'
    STOP = 'a controlled stop: the cart is braked, then the force is zero'
    ZERO = 'the solve failed, and so did the fallback; the force is zero'
    DISABLED = 'disabled: the force is zero; call mpc/enable'


class SolverStats(NamedTuple):
    """What a solve cost and found."""

    status: Status
    cost: float
    iterations: int
    solve_time: float  # [s] of a tick, with the estimate and all starts
    solves: tuple[int, ...] = ()  # the iterations of each solve of a tick


@dataclass(frozen=True)
class Plan:
    """
    Predicted states and forces, and the feedback about them.

    Shapes: X (N + 1, 2n + 2), U (N,) [N], K (N, 2n + 2); dt is the duration of a step [s].
    """

    X: Array
    U: Array
    K: Array
    dt: float
    stats: SolverStats
    drive: Drive = DIRECT   # from a command to the force on the cart, which U is

    @property
    def usable(self) -> bool:
        """Return whether the plan may be obeyed."""
        return self.stats.status is not Status.FAILED

    @property
    def duration(self) -> float:
        """Return the time that the plan covers [s]."""
        return len(self.U) * self.dt

    def first_force(self, limit: float) -> float:
        """Return the command [N] to send, within its limit; whatever happened, a finite one."""
        force = (float(self.U[0]) - self.drive.bias) / self.drive.gain
        return min(max(force, -limit), limit) if math.isfinite(force) else 0.0

    def resampled(self, dt: float) -> 'Plan':
        """Return the plan in steps of another duration [s], as `shifted` interpolates it."""
        if dt == self.dt:
            return self
        steps = [self.shifted(n * dt) for n in range(int(self.duration / dt + 1e-6))]
        if not steps:
            return replace(self, X=self.X[:1], U=self.U[:0], K=self.K[:0], dt=dt)
        last = self.shifted(len(steps) * dt)
        return replace(self, dt=dt, X=np.array([each.X[0] for each in (*steps, last)]),
                       U=np.array([each.U[0] for each in steps]),
                       K=np.array([each.K[0] for each in steps]))

    def shifted(self, elapsed: float) -> 'Plan':
        """
        Return what is left of the plan after a time [s], as a policy from then on.

        Between two steps, forces and gains are interpolated linearly, and states by cubics: the
        gains multiply what a straight line would be off by.
        """
        place = max(round(elapsed / self.dt, 6), 0.0)  # so that whole steps stay whole
        t, weight = int(place), place - int(place)
        X, U, K = self.X[t:], self.U[t:], self.K[t:]
        if weight > 0 and len(U) > 0:
            X = between(X[:-1], X[1:], weight, self.dt)
            U = (1 - weight) * U + weight * np.append(U[1:], U[-1])
            K = (1 - weight) * K + weight * np.vstack((K[1:], K[-1:]))
        return replace(self, X=X, U=U, K=K)
