# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The receding horizon: from every state a plan, warm-started by the one before."""

import contextlib
from dataclasses import dataclass, replace
import math
import time

from dp_swing_ros.control.commands import SentCommands, SentVelocity
from dp_swing_ros.control.lookahead import Lookahead
from dp_swing_ros.control.observer import Belief, checked, Observer, ObserverParameters
from dp_swing_ros.control.planner import Planner, PlannerParameters
from dp_swing_ros.control.supervisor import braked, HELD, Supervisor, SupervisorParameters
from dp_swing_ros.parameters import parameter, ParameterError, Parameters
from dp_swing_ros.pendulum.parameters import DIRECT, Drive, VELOCITY
from dp_swing_ros.pendulum.state import Array, hanging, upright
from dp_swing_ros.problem.cost import terms
from dp_swing_ros.problem.plan import IDLE, Plan, Status
from dp_swing_ros.problem.problem import Problem

GAP = 2.0        # steps of a plan, as long as which a first period counts at most
WARMING = 1.0    # [s] at most of a tick that warms up
PARAMETERS, DESCRIPTION = 'parameters', 'description'   # where the bodies are from
LEANING = 0.2    # [rad] of link 1, so far that the regulator would drop it


@dataclass(frozen=True)
class MpcParameters(PlannerParameters, SupervisorParameters, ObserverParameters):
    """The receding horizon in time."""

    time_limit: float = parameter(
        0.04, 'a solve returns its best plan after this time, or four fifths of the time from '
        'state to state (real time only)', unit='s', minimum=1e-4, finite=False)
    clock: str = parameter(
        'announced', 'what the stamps of the states are: stamps, of the clock of the node, so '
        'that they say how old a state is; arrival, of some clock, so that a state is as old as '
        'it came later than others did; lockstep, simulated time that waits for the answer; '
        'announced, what the publisher of the states says on the topic configuration, else '
        'arrival', choices=lambda: ['announced', 'stamps', 'arrival', 'lockstep'], live=False)
    bodies: str = parameter(
        PARAMETERS, 'where bodies, frictions, limits and the names, signs and zeros of the joints '
        'are from: parameters; description, the first robot description on the topic '
        'robot_description (nothing is sent before)',
        choices=lambda: [PARAMETERS, DESCRIPTION], live=False)
    learned_file: str = parameter(
        '', 'with dynamics adaptive, the file into which what was learned is written when the '
        'mpc ends, to plan with (dynamics learned); empty: none')
    time_noise: float = parameter(
        1e-3, 'standard deviation of the time at which a state was measured, by its stamp (real '
        'time only)', unit='s', minimum=0.0)


class RecedingHorizon:
    """Solves at every tick."""

    def __init__(self, problem: Problem, parameters: MpcParameters, solver: Parameters,
                 estimator: Parameters, drive: Drive = DIRECT) -> None:
        """Take problem, parameters, those of solver and estimator, and what the drive does."""
        self.parameters = parameters
        self.lookahead = Lookahead(problem)
        self.observer = Observer(problem, parameters, estimator, drive)
        self.commands = SentCommands(self.nominal.scale)
        self.planner = Planner(self.belief.problem, parameters, solver)
        self.supervisor = Supervisor(parameters)

    def reset(self) -> None:
        """
        Forget everything: the next tick is a first tick, with the same random numbers.

        A drive of velocities is still at the last one, and goes on from there; see commands.begin.
        """
        self.lookahead.reset()
        self.observer.reset()
        self.fit()
        self.commands = SentCommands(self.nominal.scale, self.commands.sent)
        self.planner.reset(self.belief.problem)
        self.supervisor.reset()

    def update(self, t: float, x: Array, delay: float = 0.0, deadline: float = math.inf,
               time_noise: float = 0.0) -> Plan:
        """
        Return the plan that begins with the force to send now.

        t is the time of the measurement x [s], right but for a standard deviation of time_noise
        [s], delay its age when the force will act [s], and deadline in seconds of
        time.perf_counter(). Where the solve fails, it is the fallback. A state that a later one
        overtook adds nothing; a time before the run's first, or long before the last, is a new
        run. Why a state is rejected is in `belief.rejection`. Where it is not enabled, the
        force is zero, and the first after it that of a first tick. Shapes: x (2n + 2,), NaN where
        a velocity is not measured. Raises ValueError where x is not finite.
        """
        began, acts_at = time.perf_counter(), t + delay
        x = checked(x, len(self.nominal.cost.S))
        if self.observer.is_another_run(t):
            self.reset()
        self.lookahead.add(t)
        if self.lookahead.last_period == 0.0:
            self.commands.begin(acts_at, float(x[len(x) // 2]))
        self.fit()
        belief = self.observer.update(t, x, time_noise, self.commands)   # filter, estimator, model
        x_0 = self.commands.compensate(belief, acts_at)                  # delay compensation
        plan, known = None, time.perf_counter()
        if self.supervisor.admits(belief, x_0, acts_at):
            plan = self.planner.plan(belief.problem, x_0, acts_at, deadline)   # starts, solver
            plan = replace(plan, stats=plan.stats.with_estimate(known - began))
        return self.command(plan, x_0, acts_at)                          # limits, fallback, zero

    def fit(self) -> None:
        """Go on in steps that go with the period of the states."""
        prediction = self.lookahead.prediction
        if prediction != self.nominal.parameters.prediction:
            with contextlib.suppress(ParameterError):   # of steps in which nothing can be held
                self.observer.predict_as(prediction)
                self.planner.set_problem(self.belief.problem)

    def fallback(self, acts_at: float) -> Plan:
        """Return a plan from a time on [s] where no state came."""
        return self.command(None, None, acts_at)

    def command(self, plan: Plan | None, x_0: Array | None, acts_at: float) -> Plan:
        """Return the plan to obey in place of one that was found, or not; remember it."""
        belief, commands = self.belief, self.commands
        if plan is None or not plan.usable:
            instead = self.supervisor.fallback(
                belief, x_0, self.planner.warm_start(acts_at), commands, acts_at)
            plan = instead if plan is None else replace(instead, stats=instead.stats._replace(
                candidates=plan.stats.candidates))
        plan = self.supervisor.command(plan, belief, commands, acts_at)
        self.planner.keep(plan, acts_at)
        has_no_goal = plan.stats.status in (*IDLE, Status.STOP)
        self.lookahead.look(acts_at, belief.problem.is_reached(plan.X[-1]),
                            has_no_goal or belief.problem.is_reached(belief.x))
        if belief.problem.physical.drive == VELOCITY:
            return self.as_velocity(plan, acts_at)
        commands.add(acts_at, plan.first_force(self.nominal.u_max))
        if x_0 is None and plan.stats.status in IDLE and belief.problem.physical.is_driven:
            commands.add(acts_at + HELD, 0.0)   # where no more comes the driver stops the cart
        return plan

    def as_velocity(self, plan: Plan, acts_at: float) -> Plan:
        """
        Return a plan with the velocity to send for its first acceleration, and remember that.

        It is the integral of what was planned: a cart that follows its velocity late has the
        acceleration as late. Where there is no plan, it is zero.
        """
        sent, limit = self.commands.sent, self.nominal.parameters.limits.cart_speed_limit
        speed = float(plan.X[0, plan.X.shape[1] // 2]) / self.belief.drive.gain
        before = (speed if math.isfinite(speed) else 0.0) if sent is None else sent.at(acts_at)
        # after a gap in the states it is no acceleration for as long
        lasts, u_max = min(self.lookahead.last_period, GAP * plan.dt), self.nominal.u_max
        v = before + plan.first_force(u_max) * lasts
        v = 0.0 if plan.stats.status in IDLE else min(max(v, -limit), limit)
        self.commands.add_velocity(SentVelocity(acts_at, before, v, lasts, u_max))
        return replace(plan, velocity=v)

    @property
    def belief(self) -> Belief:
        """Return the estimate of state, pendulum and drive."""
        return self.observer.belief

    @property
    def nominal(self) -> Problem:
        """Return the problem as it was given."""
        return self.observer.nominal

    @property
    def enabled(self) -> bool:
        """Return whether forces may act."""
        return self.supervisor.enabled

    @property
    def stopping(self) -> str:
        """Return why the cart is braked; empty where it is not."""
        return self.supervisor.stopping

    def enable(self, enabled: bool) -> bool:
        """Act, from a first plan, or let the force go; return whether that is a change."""
        changes = self.supervisor.enable(enabled)
        if changes:
            self.planner.discard()
        return changes

    def stop(self, why: str) -> None:
        """Brake the cart from now on, and be disabled when that is over."""
        self.supervisor.stop(why)

    def reconfigure(self, other: 'RecedingHorizon') -> None:
        """
        Go on with the parameters of another controller, which is not used any more.

        The last plan, the commands sent and the random numbers go on, these unless the seed is
        another. So does the estimate of state and pendulum, unless the estimator is told
        something else. What `enable` says counts as before, unless `enabled` changes.
        """
        self.parameters = other.parameters
        if self.supervisor.reconfigure(other.supervisor):
            self.planner.discard()
        self.observer.reconfigure(other.observer)
        self.lookahead.reconfigure(other.lookahead)
        self.fit()
        self.planner.reconfigure(other.planner, self.belief.problem)

    def anew(self, problem: Problem, drive: Drive = DIRECT) -> 'RecedingHorizon':
        """Return a controller with these parameters that knows nothing, for problem and drive."""
        return RecedingHorizon(problem, self.parameters, self.planner.solver_parameters,
                               self.observer.estimator_parameters, drive)

    def warm_up(self, most: float = math.inf) -> float:
        """
        Compile all that a tick and its report need, on a copy of the controller.

        Returns how long a tick takes from then on [s], as soon as it is known to be more than
        `most`.
        """
        problem = self.nominal
        twin = self.anew(problem, self.observer.nominal_drive)
        twin.enable(True)
        taken = list[float]()
        # twice, for compiling takes longer than a tick may
        for x in starts_to_warm_up(problem.physical.links) * 2:
            twin.reset()
            for limit in (WARMING, WARMING, min(self.parameters.time_limit, WARMING)):
                n, began = len(taken), time.perf_counter()
                # a state that stands still would be refused, and the estimator left out
                plan = twin.update(n * problem.dt, x + 1e-3 * n, 1e-3, began + limit)
                taken.append(time.perf_counter() - began)
            if min(taken[1:]) > most:   # the first may compile or load
                return min(taken[1:])
        twin.fallback(len(taken) * problem.dt)
        braked(problem, problem.x_r, 0.0, math.inf)
        terms(problem.cost, plan.X - plan.turns, plan.U)
        usual = min(taken[-1], taken[-7])
        if self.observer.adaptive is None:
            return usual
        self.observer.adaptive.warm_up()
        learned = Problem.of(problem.physical, *problem.parameters, self.observer.adaptive.model,
                             problem.scale)
        return max(usual, RecedingHorizon(
            learned, replace(self.parameters, estimator='none'), self.planner.solver_parameters,
            Parameters()).warm_up(most))


def starts_to_warm_up(links: int) -> tuple[Array, Array]:
    """Return two states of which the one needs what the other does not: leaning, and hanging."""
    leaning = upright(links)
    leaning[1] = LEANING
    return leaning, hanging(links)
