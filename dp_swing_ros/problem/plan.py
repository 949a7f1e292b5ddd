# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The result of a solve: a plan is a trajectory with the policy around it."""

from collections.abc import Mapping, Sequence
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
    LAST_POLICY = 'this is the last plan, followed as a policy'
    REGULATOR = 'this is the regulator at the reference'
    STOP = 'a controlled stop: the cart is braked, then the force is zero'
    ZERO = 'there is no plan to follow; the force is zero'
    DISABLED = 'disabled: the force is zero; call mpc/enable'


IDLE = (Status.ZERO, Status.DISABLED)   # of a plan that does nothing
FALLBACK = (Status.LAST_POLICY, Status.REGULATOR, Status.ZERO)   # of a tick without a solve


class Candidate(NamedTuple):
    """One of the solves of a tick."""

    start: str   # where it began
    cost: float
    iterations: int


class SolverStats(NamedTuple):
    """What a solve cost and found."""

    status: Status
    cost: float
    iterations: int
    solve_time: float  # [s] of a tick, with the estimate and all starts
    phases: Mapping[str, float] = {}   # [s] of that, by what it was spent on
    candidates: tuple[Candidate, ...] = ()   # of a tick, in the order of their solves

    @property
    def solves(self) -> tuple[int, ...]:
        """Return the iterations of each solve of a tick."""
        return tuple(candidate.iterations for candidate in self.candidates)

    def with_estimate(self, duration: float) -> 'SolverStats':
        """Return what a tick with a solve cost whose estimate took a time [s]."""
        return self if not self.candidates else self._replace(
            solve_time=duration + self.solve_time, phases={'estimate': duration, **self.phases})


class Tries(NamedTuple):
    """
    Some of the forces that a solver tried in a solve, as they were tried, and what each counted.

    Shapes: U (M, N) [N], weights (M,), the largest of which is 1.
    """

    U: Array
    weights: Array


NO_TRIES = Tries(np.empty((0, 0)), np.empty(0))


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
    turns: Array | float = 0.0   # [rad] from the reference to its goal, (2n + 2,)
    start: str = ''         # what a solve began from, where it was one of several
    tries: Tries | None = None   # where they were asked for
    velocity: float | None = None   # [m/s] that a drive of velocities is sent for its first force

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

    def command(self, limit: float) -> float:
        """Return what to send: the first force within its limit, or the velocity for it."""
        return self.first_force(limit) if self.velocity is None else self.velocity

    def resampled(self, dt: float) -> 'Plan':
        """Return the plan in steps of another duration [s], as `shifted` interpolates it."""
        if dt == self.dt:
            return self
        places = [max(round(n * dt / self.dt, 6), 0.0)
                  for n in range(int(self.duration / dt + 1e-6) + 1)]
        t, last = np.array(places, dtype=int), len(self.U)   # all at once: they may be thousands
        weight = np.where(t < last, places - t, 0.0)[:, None]
        X = between(self.X[t], self.X[np.minimum(t + 1, last)], weight, self.dt)
        t, weight = t[:-1], weight[:-1]
        following = np.minimum(t + 1, last - 1)
        U = (1 - weight[:, 0]) * self.U[t] + weight[:, 0] * self.U[following]
        K = (1 - weight) * self.K[t] + weight * self.K[following]
        return replace(self, X=X, U=U, K=K, dt=dt)

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


def candidates_of(plans: Sequence[Plan]) -> tuple[Candidate, ...]:
    """Return what came of each solve of a tick."""
    return tuple(Candidate(plan.start, plan.stats.cost, plan.stats.iterations) for plan in plans)


def stats_of_tick(best: Plan, plans: Sequence[Plan], search_time: float) -> SolverStats:
    """Return what a search cost whose best plan is this one, out of several; time in seconds."""
    phases = dict[str, float]()
    for plan in plans:
        for name, seconds in plan.stats.phases.items():
            phases[name] = phases.get(name, 0.0) + seconds
    starts = search_time - sum(plan.stats.solve_time for plan in plans)
    return best.stats._replace(
        iterations=sum(plan.stats.iterations for plan in plans),
        solve_time=search_time, candidates=candidates_of(plans),
        phases={'starts': starts, **phases})
