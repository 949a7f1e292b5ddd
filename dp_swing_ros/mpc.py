# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The receding horizon: from every state a plan, warm-started by the one before.

The measured state is first rolled forward, under the forces already sent, to the time at which
the new force will act. The last plan is then followed from there as a policy (its gains about its
states, the regulator past its end): forces alone, shifted, diverge on an unstable plant.
"""

from collections import deque
from dataclasses import dataclass, replace
import math
import time

import numpy as np

from dp_swing_ros.cost import trajectory_cost
from dp_swing_ros.dynamics.trajectory import hold, rollout
from dp_swing_ros.parameters import parameter, Parameters
from dp_swing_ros.plan import Plan, SolverStats, Status
from dp_swing_ros.problem import policy_rollout, Problem, regulator_rollout
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.solvers.solver import regulator_start, start
from dp_swing_ros.state import ANGLES, Array, HANGING, is_upright, to_turn_of

REMEMBERED = 64  # forces sent, for the roll forward


@dataclass(frozen=True)
class MpcParameters(Parameters):
    """The receding horizon and who solves it."""

    solver: str = parameter('ilqr', 'solver of every tick', choices=lambda: sorted(SOLVERS))
    time_limit: float = parameter(
        0.04, 'a solve returns its best plan after this time (real time only)', unit='s',
        minimum=1e-4, finite=False)
    initial_plan: str = parameter(
        'random', 'forces of the first plan: random, as in the paper, or zero',
        choices=lambda: ['random', 'zero'])
    initial_force: float = parameter(
        10.0, 'bound of the random forces of the first plan', unit='N', minimum=0.0)
    warm_start: str = parameter(
        'policy', 'policy: the last plan with its gains, then the regulator, or the regulator '
        'from here if that is cheaper; forces: the last forces, then zero, as in the paper',
        choices=lambda: ['policy', 'forces'])
    seed: int = parameter(0, 'seed of the first plan and of random solvers', minimum=0)


class RecedingHorizon:
    """Solves at every tick; remembers the last plan, the last state and the forces sent."""

    def __init__(self, problem: Problem, parameters: MpcParameters, solver: Parameters) -> None:
        """Take the problem, how it is solved, and the parameters of the solver named there."""
        self.problem, self.parameters, self.solver_parameters = problem, parameters, solver
        self.reset()

    def reset(self) -> None:
        """Forget everything: the next tick is a first tick, with the same random numbers."""
        self.solver = SOLVERS[self.parameters.solver](
            self.problem, self.solver_parameters, self.parameters.seed)
        self.plan: Plan | None = None
        self.began = 0.0                    # [s] time of the plan's first state
        self.t = -math.inf                  # [s] time of the last measurement
        self.x: Array | None = None         # and what was measured
        self.sent: deque[tuple[float, float]] = deque(maxlen=REMEMBERED)  # (from when, force)
        self.random = np.random.default_rng(self.parameters.seed)

    def update(self, t: float, x: Array, delay: float = 0.0,
               deadline: float = math.inf) -> Plan:
        """
        Return the plan that begins with the force to send now.

        t is the time of the measurement x [s], delay its age when the force will act [s], and
        deadline in seconds of time.perf_counter(). Where the solve fails, `stand_in` does. A time
        before the last measurement's is a new run. Shapes: x (6,). Raises ValueError where x is
        not finite.
        """
        if t < self.t:
            self.reset()
        x = np.asarray(x, dtype=float)
        if x.shape != (6,) or not np.all(np.isfinite(x)):
            raise ValueError(f'the state is {x}; expected six finite numbers')
        # Where an encoder wraps, the angle goes on from its last turn.
        self.t, self.x = t, x if self.x is None else to_turn_of(x, self.x)
        begins = t + delay
        x_0 = self.roll_forward(self.x, t, begins)
        left = self.left_over(begins)
        turns = self.turns_of(x_0 if left is None else left.X[-1])
        plan = self.solver.solve(x_0 - turns, self.warm_start(x_0 - turns, left), deadline)
        if not plan.usable:
            return self.stand_in(begins, x_0)
        return self.remember(replace(plan, X=plan.X + turns), begins)

    def warm_up(self) -> float:
        """Compile all that a tick needs, on a copy of the controller, and return the time [s]."""
        began = time.perf_counter()
        twin = RecedingHorizon(self.problem, self.parameters, self.solver_parameters)
        for n in range(3):
            twin.update(n * self.problem.dt, np.array(HANGING), delay=1e-3)
        twin.stand_in(3 * self.problem.dt)
        return time.perf_counter() - began

    def stand_in(self, begins: float, x_0: Array | None = None) -> Plan:
        """
        Return a plan without a solve: the last one's policy, else the regulator, else zero force.

        begins is the time at which its first force will act [s]; without a state x_0 (6,) the
        last plan's own prediction stands in for it.
        """
        problem = self.problem
        left = self.left_over(begins)
        if x_0 is None and left is not None:
            x_0 = left.X[0]
        if x_0 is not None and left is not None:
            X, U = policy_rollout(problem, x_0, left.X, left.U, left.K)
            if np.all(np.isfinite(X)):
                return self.remember(self.plan_of(X, U, Status.LAST_POLICY), begins)
        if x_0 is not None:
            U = regulator_rollout(problem, x_0)
            X = rollout(problem.model, x_0, U)
            # Far from the reference the regulator would only drive the cart into the end stop.
            if is_upright(X[-1] - problem.cost.x_r):
                return self.remember(self.plan_of(X, U, Status.REGULATOR), begins)
        X = np.tile(problem.cost.x_r if x_0 is None else x_0, (problem.horizon + 1, 1))
        plan = self.plan_of(X, np.zeros(problem.horizon), Status.ZERO)
        self.sent.append((begins, 0.0))
        self.plan = None    # it predicts nothing, so the next tick is a first one
        return plan

    def roll_forward(self, x: Array, t: float, until: float) -> Array:
        """Predict the state at a later time under the forces already sent."""
        changes = [change for change in self.sent if change[0] < until]
        for n, (since, u) in enumerate(changes):
            end = changes[n + 1][0] if n + 1 < len(changes) else until
            duration = end - max(since, t)
            if duration > 0:
                x = hold(self.problem.model, x, u, duration)
        return x

    def turns_of(self, x: Array) -> Array:
        """
        Return how far the goal on the turn of a state is from the reference: whole turns [rad].

        The goal of a solve is the one where the last plan ended; there the terminal cost is right.
        Shapes: x (6,) -> (6,). Where angles count as they are, as in the paper, there is one goal.
        """
        x_r, turns = self.problem.cost.x_r, np.zeros(6)
        if self.problem.cost.chord:
            turns[ANGLES] = 2 * np.pi * np.round((x - x_r)[ANGLES] / (2 * np.pi))
        return turns

    def warm_start(self, x_0: Array, left: Plan | None) -> Plan:
        """Return the plan to start the solve from: what is left of the last, or a first one."""
        problem = self.problem
        if left is None:
            return self.first_plan(x_0)
        if self.parameters.warm_start == 'forces':
            U = np.append(left.U, np.zeros(problem.horizon - len(left.U)))
            return self.plan_of(rollout(problem.model, x_0, U), U, Status.COMPLETE)
        last, regulator = start(problem, x_0, left), regulator_start(problem, x_0)
        return left if last.J <= regulator.J else replace(
            left, X=regulator.X, U=regulator.U, K=regulator.K)

    def first_plan(self, x_0: Array) -> Plan:
        """Return the start of a run: random forces, or none."""
        U: Array = np.zeros(self.problem.horizon)
        if self.parameters.initial_plan == 'random':
            bound = min(self.parameters.initial_force, self.problem.u_max)
            U = self.random.uniform(-bound, bound, len(U))
        return self.plan_of(rollout(self.problem.model, x_0, U), U, Status.COMPLETE)

    def left_over(self, begins: float) -> Plan | None:
        """Return the rest of the last plan from a time on [s], None where nothing is left."""
        if self.plan is None:
            return None
        left = self.plan.shifted(begins - self.began)
        return left if len(left.U) > 0 else None

    def plan_of(self, X: Array, U: Array, status: Status) -> Plan:
        """Make a plan that no solver made, so without feedback."""
        J = trajectory_cost(self.problem.cost, X, U)
        return Plan(X, U, np.zeros((len(U), 6)), self.problem.dt, SolverStats(status, J, 0, 0.0))

    def remember(self, plan: Plan, begins: float) -> Plan:
        """Keep the plan for the next tick, and the force that it begins with."""
        self.plan, self.began = plan, begins
        self.sent.append((begins, float(plan.U[0])))
        return plan
