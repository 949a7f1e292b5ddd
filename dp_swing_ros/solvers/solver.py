# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a solver is, and where each of them starts."""

import math
from typing import NamedTuple, Protocol, runtime_checkable, TypeAlias

import numpy as np

from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.plan import Plan, Tries
from dp_swing_ros.problem.problem import Problem
from dp_swing_ros.streams import Stream, stream

Seed: TypeAlias = int | np.random.Generator   # of a solver: a number, or one that goes on


class Solver(Protocol):
    """
    Solves a problem from a state; holds no state of its own but a random generator.

    Built as SOLVERS[name](problem, parameters, seed), where parameters are a
    SOLVERS[name].Parameters with a field `iterations`, the most of them in one solve, and the
    same seed gives the same plans.
    """

    def solve(self, x_0: Array, warm_start: Plan | None, deadline: float) -> Plan:
        """
        Return the best plan found from x_0 until the deadline, never worse than the warm start.

        A plan is a trajectory of the problem's model from x_0 with forces within its bound.
        warm_start is followed as a policy from x_0; None stands for zero forces. The deadline is
        in seconds of time.perf_counter() and may be infinite; it is looked at before every
        iteration, and lateness is a status, no error. Where no plan is finite, the status is
        FAILED.
        Shapes: x_0 (2n + 2,). Raises ValueError where x_0 is not finite.
        """


@runtime_checkable
class ShowingSolver(Solver, Protocol):
    """A solver that remembers what it tried, for mpc/tries."""

    def tries(self, count: int) -> Tries:
        """
        Return about so many of the forces that the last solve tried, steps or samples.

        There are none where it was over before it tried any. No random number is used.
        """


def generator(seed: Seed) -> np.random.Generator:
    """Return the random generator of a solver with this seed."""
    return seed if isinstance(seed, np.random.Generator) else stream(seed, Stream.SOLVER)


class Policy(NamedTuple):
    """Where to start, and the policy u = U[t] + K[t] (x - X[t]) to follow from there."""

    x_0: Array   # (2n + 2,)
    X: Array     # (T or more, 2n + 2)
    U: Array     # (T,)
    K: Array     # (T, 2n + 2)


def policy_of(problem: Problem, x_0: Array, warm_start: Plan | None) -> Policy:
    """
    Return the policy to start from: the warm start's; None is zero force.

    Raises ValueError where x_0 is not finite.
    """
    x_0 = np.asarray(x_0, dtype=float)
    size = len(problem.cost.S)
    if x_0.shape != (size,) or not all(map(math.isfinite, x_0.tolist())):
        raise ValueError(f'the state is {x_0}; expected {size} finite numbers')
    if warm_start is None:
        N = problem.horizon
        return Policy(x_0, np.tile(x_0, (N, 1)), np.zeros(N), np.zeros((N, size)))
    return Policy(x_0, warm_start.X, warm_start.U, warm_start.K)
