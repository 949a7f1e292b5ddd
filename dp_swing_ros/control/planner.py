# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
From the state when the force acts to a plan: warm start, other starts, solver.

The last plan is followed as a policy (its gains about its states, the regulator past its end):
forces alone, shifted, diverge on an unstable plant. Beside it there are other starts; the cheapest
plan is obeyed.

Where states come faster than the steps of a plan, a solve is due once a step: a plan that is
shifted by parts of one has its forces interpolated, which blurs them, and with every tick more so.
For the states in between its first force is held as it was planned, and its feedback added. They
make up for other starts that there was no time for: a plan from one of them is obeyed at once
where it is cheaper.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
import math
import time

import numpy as np

from dp_swing_ros.control.starts import solved, StartParameters, Starts
from dp_swing_ros.parameters import parameter, Parameters
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.plan import FALLBACK, Plan, stats_of_tick, Status
from dp_swing_ros.problem.problem import plan_of, policy_rollout, Problem
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.solvers.solver import Solver
from dp_swing_ros.streams import Stream, stream

ROUNDING = 1e-6   # [s] of times since 1970, as they are held


@dataclass(frozen=True)
class PlannerParameters(StartParameters):
    """Who solves."""

    solver: str = parameter('ilqr', 'solver of every tick', choices=lambda: sorted(SOLVERS))
    seed: int = parameter(0, 'seed of the first plan and of random solvers', minimum=0)
    shown_tries: int = parameter(
        0, 'on mpc/tries about so many of the trajectories that led to the plan, of its line '
        'search or its samples; 0: none', minimum=0, maximum=1000)


Search = Callable[['Planner', Array, Iterable[Plan], float], list[Plan]]


def search(planner: 'Planner', x_0: Array, starts: Iterable[Plan], deadline: float) -> list[Plan]:
    """Return a plan from each start while there is time, from one at least."""
    plans = list[Plan]()
    for start in starts:
        plans.append(solved(planner.solver, planner.problem, x_0, start, deadline, planner.build,
                            planner.parameters.shown_tries))
        if time.perf_counter() > deadline:
            break
    return plans


def best_of(problem: Problem, plans: Iterable[Plan]) -> Plan:
    """
    Return the plan that costs least, a usable one if there is any.

    One that ends with springs wound up, where no goal is, comes after all that do not.
    """
    return min(plans, key=lambda plan: (
        not plan.usable, problem.on_turn_of(plan.X[-1]) is None, plan.stats.cost))


class Planner:
    """Holds the solver with its random numbers, the other starts, and the last plan."""

    def __init__(self, problem: Problem, parameters: PlannerParameters,
                 solver: Parameters) -> None:
        """Take what is to be solved, and the parameters of the solver."""
        self.parameters, self.solver_parameters = parameters, solver
        self.search: Search = search
        self.reset(problem)

    def reset(self, problem: Problem) -> None:
        """Forget everything: the next plan is a first one, with the same random numbers."""
        self.problem = problem
        self.random = stream(self.parameters.seed, Stream.SOLVER)
        self.solver = self.build(problem)
        self.starts = Starts(problem, self.parameters, self.parameters.seed, self.build)
        self.last: Plan | None = None
        self.since = self.before = -math.inf   # [s] when its force acts, and that of the last tick
        self.skipped = 0   # starts that there was no time for

    def build(self, problem: Problem, parameters: Parameters | None = None) -> Solver:
        """Build the solver for a problem; its random numbers go on."""
        solver: Solver = SOLVERS[self.parameters.solver](
            problem, parameters or self.solver_parameters, self.random)
        return solver

    def reconfigure(self, other: 'Planner', problem: Problem) -> None:
        """Plan on with the parameters of another one; random numbers go on but for a new seed."""
        if other.parameters.seed != self.parameters.seed:
            self.random = other.random
        self.parameters, self.solver_parameters = other.parameters, other.solver_parameters
        self.starts.reconfigure(other.starts)
        self.set_problem(problem)

    def set_problem(self, problem: Problem) -> None:
        """Solve another problem from now on."""
        self.problem = problem
        if self.last is not None:
            self.last = self.last.resampled(problem.dt)
        self.solver = self.build(problem)
        self.starts.set_problem(problem)

    def plan(self, problem: Problem, x_0: Array, acts_at: float, deadline: float) -> Plan:
        """
        Return the best plan found from a state x_0 (2n + 2,) at which its force will act [s].

        It may be one that is not usable. The deadline is in seconds of time.perf_counter().
        """
        if problem is not self.problem:
            self.set_problem(problem)
        began, left, passed = time.perf_counter(), self.warm_start(acts_at), acts_at - self.before
        self.before = acts_at
        if left is not None and not self.is_due(acts_at, passed):
            plan = self.feedback(x_0, left)
            if self.skipped == 0 or problem.is_reached(x_0):
                return plan
            plans = self.search(self, x_0, self.starts.others(x_0, 1), deadline)
            self.skipped -= 1
            best = best_of(problem, [plan, *plans])
        else:
            plans = self.search(self, x_0, self.starts.of(x_0, left), deadline)
            self.skipped = self.starts.count(x_0, left) - len(plans)
            best = best_of(problem, plans)
        return replace(best, stats=stats_of_tick(best, plans, time.perf_counter() - began))

    def is_due(self, acts_at: float, passed: float) -> bool:
        """
        Return whether it is time [s] for a solve, a time [s] after the tick before.

        So it is where no later state is nearer to a step after the last solve.
        """
        return self.last is None or self.last.stats.status in FALLBACK or (
            acts_at + passed / 2 >= self.since + self.last.dt - ROUNDING)

    def feedback(self, x_0: Array, left: Plan) -> Plan:
        """Return what is left of the last plan, its first force held, with its feedback."""
        assert self.last is not None
        now = len(self.last.U) - len(left.U)
        U, K = (np.concatenate((of_last[now:now + 1], rest[1:])) for of_last, rest in (
            (self.last.U, left.U), (self.last.K, left.K)))
        turns = self.last.turns   # the goal is on these
        problem, back = self.problem.with_goal_on(turns)
        _, X, U, K = policy_rollout(problem, x_0 - back, left.X - back, U, K)
        plan = plan_of(problem, X, U, Status.FEEDBACK, K)
        return replace(plan, X=plan.X + back, turns=turns)

    def warm_start(self, acts_at: float) -> Plan | None:
        """Return what is left of the last plan from a time on [s], if any."""
        left = None if self.last is None else self.last.shifted(acts_at - self.since)
        return None if left is None or len(left.U) == 0 else left

    def keep(self, plan: Plan, acts_at: float) -> None:
        """Take the plan that is obeyed from a time on [s] for the last one."""
        if plan.stats.status in (Status.ZERO, Status.DISABLED):
            self.discard()   # it predicts nothing, so the next tick is a first one
        elif plan.stats.status is not Status.FEEDBACK:
            self.last, self.since = plan, acts_at

    def discard(self) -> None:
        """Have no last plan."""
        self.last = None
