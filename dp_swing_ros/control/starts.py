# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Where the solves of a tick start: the last plan first, then others.

A local solver ends in the optimum that its start leads to, and MPPI draws about its start. So the
first tick solves from several starts and, until the pendulum is up, every later one from two more
than the last plan, taken in turn; the cheapest plan is obeyed.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain, cycle, islice, repeat
import math

import numpy as np

from dp_swing_ros.control.bounded_lqr import BoundedLQR
from dp_swing_ros.parameters import parameter, Parameters
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.plan import Plan, Status
from dp_swing_ros.problem.problem import (
    plan_of, policy_rollout, Problem, regulator_rollout, turns_of)
from dp_swing_ros.solvers.solver import ShowingSolver, Solver
from dp_swing_ros.streams import Stream, stream

SHORT = 30  # steps; over more, a start that is not yet good diverges, and solves end anywhere


@dataclass(frozen=True)
class StartParameters(Parameters):
    """Where the solves of a tick start."""

    initial_force: float = parameter(
        10.0, 'bound of the random forces of a start', unit='N', minimum=0.0, scaled=True)
    warm_start: str = parameter(
        'policy', 'policy: the last plan with its gains, then the regulator; forces: the last '
        'forces, then zero, as in the paper',
        choices=lambda: ['policy', 'forces'])
    first_starts: int = parameter(
        6, 'starts solved from at the first tick; 1: the first plan alone, as in the paper',
        minimum=1, maximum=1000)
    other_starts: int = parameter(
        2, 'starts solved from beside the last plan at later ticks, until upright; 0 as in the '
        'paper', minimum=0, maximum=1000)


Build = Callable[[Problem], Solver]


def solved(solver: Solver, problem: Problem, x_0: Array, start: Plan, deadline: float,
           build: Build, tries: int = 0) -> Plan:
    """
    Solve from a named start, the goal on the turn where it ends; see Solver.solve.

    `build` makes the solver of another problem, which it may be there. The plan comes with about
    so many tries, where the solver shows any.
    """
    turns = turns_of(problem, start.X[-1])
    if not turns.any() or not np.all(np.isfinite(start.X)):   # what diverges ends on no turn
        plan = solver.solve(x_0, start, deadline)
    else:
        there, back = problem.with_goal_on(turns)
        solver = solver if there is problem else build(there)
        plan = solver.solve(x_0 - back, replace(start, X=start.X - back), deadline)
        plan = replace(plan, X=plan.X + back, turns=turns)
    if tries and isinstance(solver, ShowingSolver):
        plan = replace(plan, tries=solver.tries(tries))
    return replace(plan, start=start.start)


class Starts:
    """The starts of every tick; holds the random generator, and whose turn it is."""

    def __init__(self, problem: Problem, parameters: StartParameters, seed: int,
                 build: Build) -> None:
        """Take what is to be solved, and how to build its solver for a shorter horizon."""
        self.parameters, self.seed, self.build = parameters, seed, build
        self.set_problem(problem)
        self.random_forces = stream(seed, Stream.STARTS)
        self.first_kinds = self.bounded_lqr, self.regulator, self.rest
        self.later_kinds = cycle((self.bounded_lqr, self.random, self.regulator))

    def reconfigure(self, other: 'Starts') -> None:
        """Go on with the parameters of others, and with their random numbers if seeds differ."""
        if other.seed != self.seed:
            self.seed, self.random_forces = other.seed, other.random_forces
        self.parameters = other.parameters

    def set_problem(self, problem: Problem) -> None:
        """Start for another problem from now on."""
        self.problem = problem
        self.short = replace(problem, horizon=min(problem.horizon, SHORT))
        self.scout = self.build(self.short) if problem.horizon > SHORT else None
        # made when needed, for they take a millisecond: one for each turn with springs
        self.bounded = dict[tuple[float, ...], BoundedLQR]()

    def of(self, x_0: Array, left: Plan | None) -> Iterator[Plan]:
        """
        Yield the starts of a tick from what is left of the last plan, none at a first tick.

        Shapes: x_0 (2n + 2,).
        """
        if left is None:
            yield self.first(x_0)
            yield from self.plans(chain(self.first_kinds, repeat(self.random)), x_0,
                                  self.parameters.first_starts - 1)
            return
        yield self.last(x_0, left)
        yield from self.others(x_0, self.count(x_0, left) - 1)

    def count(self, x_0: Array, left: Plan | None) -> int:
        """Return how many starts `of` yields."""
        if left is None:
            return self.parameters.first_starts
        return 1 if self.problem.is_reached(x_0) else 1 + self.parameters.other_starts

    def others(self, x_0: Array, count: int) -> Iterator[Plan]:
        """Yield so many starts beside the last plan, in turn; springs wound up are let go."""
        if self.problem.on_turn_of(x_0) is None:
            return self.plans(chain((self.rest,), repeat(self.random)), x_0, count)
        return self.plans(self.later_kinds, x_0, count)

    def plans(self, kinds: Iterable[Callable[[Array], Plan | None]], x_0: Array,
              count: int) -> Iterator[Plan]:
        """Yield so many plans of these kinds; wild ones only in a state where others are, too."""
        # always so many, so that how many were solved tells which were made
        patience = count + len(self.first_kinds) - 1
        made = ((kind.__name__, kind(x_0)) for kind in kinds)
        return islice((replace(plan, start=name) for n, (name, plan) in enumerate(made)
                       if plan is not None and (n >= patience or np.all(np.isfinite(plan.X)))),
                      count)

    def first(self, x_0: Array) -> Plan:
        """Return the start of a run: random forces."""
        U = self.draw(self.problem.horizon)
        plan = plan_of(self.problem, rollout(self.problem.model, x_0, U), U, Status.COMPLETE)
        return replace(plan, start='random')

    def last(self, x_0: Array, left: Plan) -> Plan:
        """Return the cheaper of what is left of the last plan and the regulator."""
        problem = self.problem
        problem, back = problem.with_goal_on(turns_of(problem, left.X[-1]))
        if self.parameters.warm_start == 'forces':
            U = np.append(left.U, np.zeros(problem.horizon))[:problem.horizon]
            return replace(plan_of(problem, rollout(problem.model, x_0, U), U, Status.COMPLETE),
                           start='last_forces')
        cost = policy_rollout(problem, x_0 - back, left.X, left.U, left.K).J
        regulator = regulator_rollout(problem, x_0 - back)
        return replace(left, start='last_plan') if cost <= regulator.J else replace(
            left, X=regulator.X + back, U=regulator.U, K=regulator.K, start='regulator')

    def bounded_lqr(self, x_0: Array) -> Plan | None:
        """Follow the regulator for a bounded force; None out of its reach."""
        problem, _ = self.short.with_goal_on(turns_of(self.short, x_0))
        if problem.cost.x_r not in self.bounded:
            self.bounded[problem.cost.x_r] = BoundedLQR(problem)
        found = self.bounded[problem.cost.x_r].start(x_0)
        return None if found is None else plan_of(
            self.short, found.X, found.U, Status.COMPLETE, found.K)

    def regulator(self, x_0: Array) -> Plan:
        """Follow the regulator."""
        problem, _ = self.short.with_goal_on(turns_of(self.short, x_0))
        return self.scouted(x_0, regulator_rollout(problem, x_0).U)

    def rest(self, x_0: Array) -> Plan:
        """Send no force."""
        return self.scouted(x_0, np.zeros(self.short.horizon))

    def random(self, x_0: Array) -> Plan:
        """Send random forces."""
        return self.scouted(x_0, self.draw(self.short.horizon))

    def draw(self, steps: int) -> Array:
        """Draw random forces (steps,)."""
        bound = self.parameters.initial_force
        low, high = np.clip((-bound, bound), *self.problem.bounds)
        return self.random_forces.uniform(low, high, steps)

    def scouted(self, x_0: Array, U: Array) -> Plan:
        """Follow forces over the short horizon; if it is shorter than the real one, solve it."""
        plan = plan_of(self.short, rollout(self.short.model, x_0, U), U, Status.COMPLETE)
        if self.scout is None or not np.all(np.isfinite(plan.X)):
            return plan
        # some milliseconds at most, so the deadline is looked at after it
        return solved(self.scout, self.short, x_0, plan, math.inf, self.build)
