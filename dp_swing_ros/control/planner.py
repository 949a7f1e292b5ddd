# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
From the state when the force acts to a plan: warm starts, other starts, solver.

The last plan is followed as a policy (its gains about its states, the regulator past its end):
forces alone, shifted, diverge on an unstable plant. Where states come faster than the steps of a
plan, the plan of a whole step ago is followed instead if it is cheaper. Beside it there are other
starts; the cheapest plan is obeyed.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
import math
import time

from dp_swing_ros.control.starts import solved, StartParameters, Starts
from dp_swing_ros.parameters import parameter, Parameters
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.plan import Plan, stats_of_tick, Status
from dp_swing_ros.problem.problem import plan_of, policy_rollout, Problem
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.solvers.solver import ShowingSolver, Solver
from dp_swing_ros.streams import Stream, stream

EARLY = 0.2      # of a solve's period, by which the states' period may fall short of it


@dataclass(frozen=True)
class PlannerParameters(StartParameters):
    """Who solves, and how often."""

    solver: str = parameter('ilqr', 'solver of every tick', choices=lambda: sorted(SOLVERS))
    solve_rate: float = parameter(
        0.0, 'solves a second at most, where states come faster; in between the force is that of '
        'the last plan with its feedback (0: a solve for every state)', unit='Hz', minimum=0.0)
    seed: int = parameter(0, 'seed of the first plan and of random solvers', minimum=0)
    shown_tries: int = parameter(
        0, 'on mpc/tries about so many of the trajectories that led to the plan, of its line '
        'search or its samples; 0: none', minimum=0, maximum=1000)


Search = Callable[['Planner', Array, Iterable[Plan], float], list[Plan]]


def search(planner: 'Planner', x_0: Array, starts: Iterable[Plan], deadline: float) -> list[Plan]:
    """Return a plan from each start while there is time, from one at least."""
    plans, solver, count = list[Plan](), planner.solver, planner.parameters.shown_tries
    for start in starts:
        plan = solved(solver, planner.problem, x_0, start, deadline)
        if count and isinstance(solver, ShowingSolver):
            plan = replace(plan, tries=solver.tries(count))
        plans.append(plan)
        if time.perf_counter() > deadline:
            break
    return plans


class Planner:
    """Holds the solver with its random numbers, the other starts, and the last plans."""

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
        # of the last step, the newest at the end: [s] since when each acts, and the plan
        self.last: list[tuple[float, Plan]] = []

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
        self.last = [(acts_at, plan.resampled(problem.dt)) for acts_at, plan in self.last]
        self.starts.reconfigure(other.starts)
        self.set_problem(problem)

    def set_problem(self, problem: Problem) -> None:
        """Solve another problem from now on."""
        self.problem = problem
        self.solver = self.build(problem)
        self.starts.set_problem(problem)

    def plan(self, problem: Problem, x_0: Array, acts_at: float, deadline: float) -> Plan:
        """
        Return the best plan found from a state x_0 (2n + 2,) at which its force will act [s].

        It may be one that is not usable. The deadline is in seconds of time.perf_counter().
        """
        if problem is not self.problem:
            self.set_problem(problem)
        began, warm_starts = time.perf_counter(), self.warm_starts(acts_at)
        if warm_starts and not self.is_due(acts_at):
            return self.feedback(x_0, warm_starts[0])
        plans = self.search(self, x_0, self.starts.of(x_0, warm_starts), deadline)
        best = min(plans, key=lambda plan: plan.stats.cost if plan.usable else math.inf)
        return replace(best, stats=stats_of_tick(best, plans, time.perf_counter() - began))

    def is_due(self, acts_at: float) -> bool:
        """Return whether it is time [s] for a solve, where there is a last plan."""
        rate = self.parameters.solve_rate
        return rate == 0 or acts_at - self.last[-1][0] > (1 - EARLY) / rate

    def feedback(self, x_0: Array, left: Plan) -> Plan:
        """Return what the rest of the last plan makes of a state; that stays the last plan."""
        _, X, U, K = policy_rollout(self.problem, x_0, left.X, left.U, left.K)
        return plan_of(self.problem, X, U, Status.FEEDBACK, K)

    def warm_starts(self, acts_at: float) -> list[Plan]:
        """
        Return what is left of the last plan from a time on [s], if any, and of one a step older.

        Between its steps the forces of a plan are interpolated, which blurs them, and with every
        tick more so; after a whole step they are not.
        """
        if not self.last:
            return []
        since, last = self.last[-1]
        step_ago, older = min(
            self.last, key=lambda each: abs(acts_at - each[0] - self.problem.dt))
        found = [last.shifted(acts_at - since)]
        if older is not last:
            found.append(older.shifted(acts_at - step_ago))
        return found if len(found[0].U) > 0 else []

    def keep(self, plan: Plan, acts_at: float) -> None:
        """Take the plan that is obeyed from a time on [s] for the last one."""
        if plan.stats.status in (Status.ZERO, Status.DISABLED):
            self.forget()   # it predicts nothing, so the next tick is a first one
        elif plan.stats.status is not Status.FEEDBACK:
            step_ago = acts_at - self.problem.dt
            self.last = [each for each in self.last if each[0] >= step_ago] + [(acts_at, plan)]

    def forget(self) -> None:
        """Have no last plan."""
        self.last = []
