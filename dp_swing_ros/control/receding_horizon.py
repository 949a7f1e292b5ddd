# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The receding horizon: from every state a plan, warm-started by the one before.

The measured state is first rolled forward, under the forces already sent, to the time at which
the new force will act; an estimator filters it before, and tells the bodies that the problem is
then solved for. From there the last plan is followed as a policy (its gains about its states, the
regulator past its end): forces alone, shifted, diverge on an unstable plant. Where states come
faster than the steps of a plan, the plan of a whole step ago is followed instead if it is cheaper.
Beside it there are other starts; the cheapest plan is obeyed.

A state that cannot be is predicted through; after `carry_over` without a state to believe,
whatever the reason, the force is zero.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain
import math
import time

import numpy as np

from dp_swing_ros.control.estimator import Estimate, Estimator, EstimatorParameters, Force
from dp_swing_ros.control.message_filter import Plausibility
from dp_swing_ros.control.starts import plan_of, solved, StartParameters, Starts
from dp_swing_ros.parameters import parameter, Parameters
from dp_swing_ros.pendulum.state import Array, HANGING, is_upright, LEANING, to_turn_of
from dp_swing_ros.pendulum.trajectory import hold
from dp_swing_ros.problem.plan import Plan, Status
from dp_swing_ros.problem.problem import policy_rollout, Problem, regulator_rollout
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.solvers.solver import Solver
from dp_swing_ros.streams import Stream, stream

REMEMBERED = 64  # forces sent, for the roll forward
RESOLUTION = 1e-6  # [s] of times since 1970, as they are held
OVERTAKEN = 0.5  # [s] a state older than the last by more than this is none that was overtaken


@dataclass(frozen=True)
class MpcParameters(StartParameters):
    """The receding horizon and who solves it."""

    solver: str = parameter('ilqr', 'solver of every tick', choices=lambda: sorted(SOLVERS))
    time_limit: float = parameter(
        0.04, 'a solve returns its best plan after this time (real time only)', unit='s',
        minimum=1e-4, finite=False)
    clock: str = parameter(
        'announced', 'what the stamps of the states are: stamps, of the clock of the node, so '
        'that they say how old a state is; arrival, of some clock, so that a state is as old as '
        'it came later than others did; lockstep, simulated time that waits for the answer; '
        'announced, what the publisher of the states says on the topic configuration, else '
        'arrival', choices=lambda: ['announced', 'stamps', 'arrival', 'lockstep'])
    seed: int = parameter(0, 'seed of the first plan and of random solvers', minimum=0)
    carry_over: float = parameter(
        0.2, 'time without a believed state (none came, or one that is not finite, out of range, '
        'frozen or refused by the estimator) after which the force is zero', unit='s',
        minimum=0.0, finite=False)
    estimator: str = parameter(
        'ekf', 'none: a state is taken as it is measured; ekf: an extended Kalman filter on the '
        'model, which also estimates bodies and a force bias', choices=lambda: ['none', 'ekf'])


class RecedingHorizon:
    """Solves at every tick; remembers the last plan, the last state and the forces sent."""

    def __init__(self, problem: Problem, parameters: MpcParameters, solver: Parameters,
                 estimator: EstimatorParameters = EstimatorParameters()) -> None:
        """Take the problem, how it is solved, and the parameters of solver and estimator."""
        self.nominal, self.parameters, self.solver_parameters = problem, parameters, solver
        self.estimator = Estimator(type(problem.model), problem.bodies, estimator)
        self.plausibility = Plausibility(problem.given[0].track_limit)
        self.reset()

    def reset(self) -> None:
        """Forget everything: the next tick is a first tick, with the same random numbers."""
        self.random = stream(self.parameters.seed, Stream.SOLVER)
        self.problem = self.nominal
        self.solver = self.build(self.problem)
        self.starts = Starts(self.problem, self.parameters, self.parameters.seed, self.build)
        self.estimator.reset()
        self.plausibility.reset()
        self.estimate: Estimate | None = None
        self.rejection = ''                 # why the last state was not believed
        self.believed = -math.inf           # [s] when the force for the last believed state acts
        self.first = math.inf               # [s] time of the first measurement
        # of the last step, the newest at the end: [s] time of the first state, and the plan
        self.plans: list[tuple[float, Plan]] = []
        self.latest = -math.inf             # [s] time of the last measurement
        self.t = -math.inf                  # [s] time of the last one that was used
        self.x: Array | None = None         # and what was measured
        self.sent: deque[tuple[float, float]] = deque(maxlen=REMEMBERED)  # (from when, force)

    def build(self, problem: Problem) -> Solver:
        """Build the solver for a problem; its random numbers go on."""
        solver: Solver = SOLVERS[self.parameters.solver](
            problem, self.solver_parameters, self.random)
        return solver

    def pose(self, problem: Problem) -> None:
        """Solve another problem from now on."""
        self.problem = problem
        self.solver = self.build(problem)
        self.starts.pose(problem)

    def update(self, t: float, x: Array, delay: float = 0.0, deadline: float = math.inf,
               solves: Sequence[int] | None = None) -> Plan:
        """
        Return the plan that begins with the force to send now.

        t is the time of the measurement x [s], delay its age when the force will act [s], and
        deadline in seconds of time.perf_counter(). To repeat a tick that a deadline cut short,
        solves are its iterations, solve by solve. Where the solve fails, `stand_in` does. A state
        that a later one overtook adds nothing; a time before the run's first, or long before the
        last, is a new run. A state that is not believed is told by `rejection`. Shapes: x (6,).
        Raises ValueError where x is not finite.
        """
        began, begins = time.perf_counter(), t + delay
        measured = self.observe(t, x)
        if not self.rejection:
            self.believed = begins
        if measured is None or self.is_blind(begins):
            return self.let_go(begins)
        x_0 = self.roll_forward(measured, self.t, begins)
        plan = self.solve(x_0, self.rests(begins), deadline, solves)
        if not plan.usable:
            instead = self.stand_in(begins, x_0)
            return replace(instead, stats=instead.stats._replace(solves=plan.stats.solves))
        return self.remember(replace(plan, stats=plan.stats._replace(
            solve_time=time.perf_counter() - began)), begins)

    def solve(self, x_0: Array, rests: Sequence[Plan], deadline: float,
              solves: Sequence[int] | None = None) -> Plan:
        """Solve from each start while there is time; return the cheapest usable plan."""
        plans = list[Plan]()
        for start in self.starts.of(x_0, rests):
            if solves is None:
                plan = solved(self.solver, self.problem, x_0, start, deadline)
            else:
                plan = self.solved_in(solves[len(plans)], x_0, start)
            plans.append(plan)
            if time.perf_counter() > deadline or solves is not None and len(plans) == len(solves):
                break
        best = min(plans, key=lambda plan: plan.stats.cost if plan.usable else math.inf)
        iterations = tuple(plan.stats.iterations for plan in plans)
        return replace(best, stats=best.stats._replace(
            iterations=sum(iterations), solves=iterations))

    def solved_in(self, iterations: int, x_0: Array, start: Plan) -> Plan:
        """Solve from a start in so many iterations at most."""
        if iterations == 0:
            return solved(self.solver, self.problem, x_0, start, -math.inf)
        limited = replace(self.solver_parameters, iterations=iterations)  # type: ignore[call-arg]
        solver = SOLVERS[self.parameters.solver](self.problem, limited, self.random)
        return solved(solver, self.problem, x_0, start, math.inf)

    def is_blind(self, begins: float) -> bool:
        """Tell whether a force from a time on [s] comes too long after the last believed state."""
        return begins - self.believed > self.parameters.carry_over + RESOLUTION

    def observe(self, t: float, x: Array) -> Array | None:
        """Take a measurement; return the state at the time of the newest, None before one."""
        x = np.asarray(x, dtype=float)
        if x.shape != (6,) or not np.all(np.isfinite(x)):
            raise ValueError(f'the state is {x}; expected six finite numbers')
        if t < self.latest and t <= max(self.first, self.latest - OVERTAKEN):
            self.reset()
        if t <= self.latest:
            return self.x
        self.first, self.latest = min(self.first, t), t
        self.rejection = self.plausibility.rejection(t, x, self.roll_forward)
        if self.rejection:
            return self.x
        if self.x is not None:
            x = to_turn_of(x, self.x)   # where an encoder wraps, the angle goes on
        if self.parameters.estimator == 'ekf':
            x = self.estimated(t, x)
        self.t, self.x = t, x
        return x

    def estimated(self, t: float, x: Array) -> Array:
        """Return the state as it is estimated, and solve for the bodies as they are."""
        self.estimate = self.estimator.update(t, x, self.forces_between(self.t, t))
        if not self.estimate.accepted:
            self.rejection = (f'the state is {self.estimate.distance:.3g} deviations from its '
                              'prediction; the estimator refuses it')
        if self.estimator.moved(self.problem.bodies):
            self.pose(self.nominal.with_bodies(replace(
                self.nominal.bodies, **self.estimate.bodies)))
        return self.estimate.x

    def warm_up(self) -> float:
        """Compile all that a tick needs, on a copy of the controller, and return the time [s]."""
        began = time.perf_counter()
        twin = RecedingHorizon(self.nominal, self.parameters, self.solver_parameters)
        for x in (LEANING, HANGING):    # the catch is for the one, random starts for the other
            twin.reset()
            for n in range(3):
                # a state that stands still would be refused, and the estimator left out
                twin.update(n * self.problem.dt, np.array(x) + 1e-3 * n, delay=1e-3)
        twin.stand_in(3 * self.problem.dt)
        return time.perf_counter() - began

    def stand_in(self, begins: float, x_0: Array | None = None) -> Plan:
        """
        Return a plan without a solve: the last one's policy, else the regulator, else zero force.

        begins is the time at which its first force will act [s]; without a state x_0 (6,) the
        last plan's own prediction stands in for it.
        """
        if self.is_blind(begins):
            return self.let_go(begins, x_0)
        problem = self.problem
        left = self.left_over(begins)
        if x_0 is None and left is not None:
            x_0 = left.X[0]
        if x_0 is not None and left is not None:
            _, X, U, _ = policy_rollout(problem, x_0, left.X, left.U, left.K)
            if np.all(np.isfinite(X)):
                return self.remember(plan_of(problem, X, U, Status.LAST_POLICY), begins)
        if x_0 is not None:
            _, X, U, _ = regulator_rollout(problem, x_0)
            # Far from the reference the regulator would only drive the cart into the end stop.
            if is_upright(X[-1] - problem.cost.x_r):
                return self.remember(plan_of(problem, X, U, Status.REGULATOR), begins)
        return self.let_go(begins, x_0)

    def let_go(self, begins: float, x_0: Array | None = None) -> Plan:
        """Return a plan of zero force from a time on [s]."""
        N = self.problem.horizon
        X = np.tile(self.problem.cost.x_r if x_0 is None else x_0, (N + 1, 1))
        self.sent.append((begins, 0.0))
        self.plans = []    # it predicts nothing, so the next tick is a first one
        return plan_of(self.problem, X, np.zeros(N), Status.ZERO)

    def roll_forward(self, x: Array, t: float, until: float) -> Array:
        """Predict the state at a later time under the forces already sent."""
        for force in self.forces_between(t, until):
            x = hold(self.problem.model, x, force.u, force.duration)
        return x

    def forces_between(self, t: float, until: float) -> list[Force]:
        """Return the forces that act between two times [s]; before the first sent it is zero."""
        forces: list[Force] = []
        for begins, u in chain(reversed(self.sent), [(t, 0.0)]):   # what was sent later replaces
            if until - t <= RESOLUTION:
                break
            begins = max(begins, t)
            if until - begins > RESOLUTION:
                forces.insert(0, Force(u, until - begins))
                until = begins
        return forces

    def obeyed(self, force: float) -> None:
        """Tell that at the last tick another force [N] was sent than that of its plan."""
        self.sent[-1] = (self.sent[-1][0], force)

    def rests(self, begins: float) -> list[Plan]:
        """
        Return the rest of the last plan from a time on [s], if any, and of one a whole step older.

        Between its steps a plan is interpolated, which blurs its forces, and with every tick more
        so; after a whole step it is not.
        """
        left = self.left_over(begins)
        if left is None:
            return []
        began, plan = min(self.plans, key=lambda each: abs(begins - each[0] - self.problem.dt))
        return [left] if plan is self.plans[-1][1] else [left, plan.shifted(begins - began)]

    def left_over(self, begins: float) -> Plan | None:
        """Return the rest of the last plan from a time on [s], None where nothing is left."""
        if not self.plans:
            return None
        began, plan = self.plans[-1]
        left = plan.shifted(begins - began)
        return left if len(left.U) > 0 else None

    def remember(self, plan: Plan, begins: float) -> Plan:
        """Keep the plan for the next tick, and the force that it begins with."""
        step_ago = begins - self.problem.dt
        self.plans = [each for each in self.plans if each[0] >= step_ago] + [(begins, plan)]
        self.sent.append((begins, float(plan.U[0])))
        return plan
