# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The receding horizon: from every state a plan, warm-started by the one before.

    state -> message filter -> estimator -> delay compensation -> starts -> solver -> force
                                                                              | failed
                                                                              v
                                                                           fallback

Between plan and force stand the limits of a rig: see safety.py.

The estimated state is predicted, under the forces already sent, to the time at which the new force
will act. From there the last plan is followed as a policy (its gains about its states, the
regulator past its end): forces alone, shifted, diverge on an unstable plant. Where states come
faster than the steps of a plan, the plan of a whole step ago is followed instead if it is cheaper.
Beside it there are other starts; the cheapest plan is obeyed.

A state that is rejected is predicted through; after `carry_over` without one to believe, whatever
the reason, the force is zero.
"""

from collections.abc import Callable, Iterable
import contextlib
from dataclasses import dataclass, replace
import math
import time

import numpy as np

from dp_swing_ros.control.message_filter import MessageFilter
from dp_swing_ros.control.safety import braked, limited, SafetyParameters, violation
from dp_swing_ros.control.sent_forces import SentForces, STEP
from dp_swing_ros.control.starts import solved, StartParameters, Starts
from dp_swing_ros.control.trust import Trust, trust
from dp_swing_ros.estimators import ESTIMATORS
from dp_swing_ros.estimators.estimator import Estimate, Estimator
from dp_swing_ros.parameters import parameter, ParameterError, Parameters
from dp_swing_ros.pendulum.model import hold
from dp_swing_ros.pendulum.parameters import DIRECT, Drive
from dp_swing_ros.pendulum.state import (
    Array, hanging, is_state, is_upright, to_turn_of, upright)
from dp_swing_ros.problem.cost import terms
from dp_swing_ros.problem.parameters import ANALYTIC, LEARNED
from dp_swing_ros.problem.plan import candidates_of, Plan, stats_of_tick, Status
from dp_swing_ros.problem.problem import (
    Bounds, plan_of, policy_rollout, Problem, regulator_rollout)
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.solvers.solver import ShowingSolver, Solver
from dp_swing_ros.streams import Stream, stream

RESOLUTION = 1e-6  # [s] of times since 1970, as they are held
OVERTAKEN = 0.5  # [s] a state older than the last by more than this is none that was overtaken
EARLY = 0.2      # of a solve's period, by which the states' period may fall short of it
NEARLY = 0.01    # of the limit of the force, by which bounds may be off
WARMING = 1.0    # [s] at most of a tick that warms up
LEANING = 0.2    # [rad] of link 1, so far that the regulator would drop it


@dataclass(frozen=True)
class MpcParameters(StartParameters, SafetyParameters):
    """The receding horizon and who solves it."""

    solver: str = parameter('ilqr', 'solver of every tick', choices=lambda: sorted(SOLVERS))
    time_limit: float = parameter(
        0.04, 'a solve returns its best plan after this time, or four fifths of the time from '
        'state to state (real time only)', unit='s', minimum=1e-4, finite=False)
    solve_rate: float = parameter(
        0.0, 'solves a second at most, where states come faster; in between the force is that of '
        'the last plan with its feedback (0: a solve for every state)', unit='Hz', minimum=0.0)
    clock: str = parameter(
        'announced', 'what the stamps of the states are: stamps, of the clock of the node, so '
        'that they say how old a state is; arrival, of some clock, so that a state is as old as '
        'it came later than others did; lockstep, simulated time that waits for the answer; '
        'announced, what the publisher of the states says on the topic configuration, else '
        'arrival', choices=lambda: ['announced', 'stamps', 'arrival', 'lockstep'], live=False)
    enabled: bool = parameter(
        True, 'force from the start on; else it is zero, while states are believed, until the '
        'service mpc/enable says otherwise')
    time_noise: float = parameter(
        1e-3, 'standard deviation of the time at which a state was measured, by its stamp (real '
        'time only)', unit='s', minimum=0.0)
    seed: int = parameter(0, 'seed of the first plan and of random solvers', minimum=0)
    carry_over: float = parameter(
        0.2, 'time without a believed state (none came, or one that is not finite, out of range, '
        'frozen or refused by the estimator) after which the force is zero', unit='s',
        minimum=0.0, finite=False)
    shadow: tuple[str, ...] = parameter(
        ('',), 'solvers that solve each tick too, each in a process of its own; what they would '
        'have done, and the regret of not obeying them, is in /diagnostics (empty: none)',
        choices=lambda: ['', *sorted(SOLVERS)])
    shown_tries: int = parameter(
        0, 'on mpc/tries about so many of the trajectories that led to the plan, of its line '
        'search or its samples; 0: none', minimum=0, maximum=1000)
    estimator: str = parameter(
        'ekf', 'none: a state is taken as it is measured; ekf: an extended Kalman filter on the '
        'model, which also estimates physical parameters and a force bias',
        choices=lambda: sorted(ESTIMATORS))


Search = Callable[['RecedingHorizon', Array, Iterable[Plan], float], list[Plan]]


def search(controller: 'RecedingHorizon', x_0: Array, starts: Iterable[Plan],
           deadline: float) -> list[Plan]:
    """Return a plan from each start while there is time, from one at least."""
    plans, solver, count = list[Plan](), controller.solver, controller.parameters.shown_tries
    for start in starts:
        plan = solved(solver, controller.problem, x_0, start, deadline)
        if count and isinstance(solver, ShowingSolver):
            plan = replace(plan, tries=solver.tries(count))
        plans.append(plan)
        if time.perf_counter() > deadline:
            break
    return plans


class RecedingHorizon:
    """Solves at every tick; remembers the last plans, the last state and the forces sent."""

    def __init__(self, problem: Problem, parameters: MpcParameters, solver: Parameters,
                 estimator: Parameters | None = None, drive: Drive = DIRECT) -> None:
        """Take problem, parameters, those of solver and estimator, and what the drive does."""
        self.nominal, self.parameters, self.solver_parameters = problem, parameters, solver
        self.nominal_drive = drive
        self.search: Search = search
        self.enabled = parameters.enabled
        self.stopping = ''                  # why there is a controlled stop, if there is
        kind = ESTIMATORS[parameters.estimator]
        self.estimator_parameters = estimator or kind.Parameters()
        self.estimator: Estimator = kind(problem, drive, self.estimator_parameters)
        self.message_filter = MessageFilter(problem.physical.links, problem.given[0].track_limit)
        self.reset()

    def reset(self) -> None:
        """Forget everything: the next tick is a first tick, with the same random numbers."""
        self.random = stream(self.parameters.seed, Stream.SOLVER)
        self.drive = self.nominal_drive
        self.problem = driven_by(self.drive, self.nominal)
        self.solver = self.build(self.problem)
        self.starts = Starts(self.problem, self.parameters, self.parameters.seed, self.build)
        self.estimator.reset()
        self.message_filter.reset()
        self.estimate: Estimate | None = None
        self.rejection = ''                 # why the last state was not believed
        self.trust: Trust | None = None     # in a learned model, at the last state
        self.believed = -math.inf           # [s] when the force for the last believed state acts
        self.first = math.inf               # [s] time of the first measurement
        self.latest = -math.inf             # [s] time of the last measurement
        self.t = -math.inf                  # [s] time of the last one that was used
        self.x: Array | None = None         # and what is believed of it
        # of the last step, the newest at the end: [s] time of the first state, and the plan
        self.plans: list[tuple[float, Plan]] = []
        self.forces = SentForces()
        self.stopped_at = math.inf          # [s] when a controlled stop is over

    def build(self, problem: Problem, parameters: Parameters | None = None) -> Solver:
        """Build the solver for a problem; its random numbers go on."""
        solver: Solver = SOLVERS[self.parameters.solver](
            problem, parameters or self.solver_parameters, self.random)
        return solver

    def set_problem(self, problem: Problem) -> None:
        """Solve another problem from now on."""
        self.problem = problem
        self.solver = self.build(problem)
        self.starts.set_problem(problem)

    def reconfigure(self, other: 'RecedingHorizon') -> None:
        """
        Go on with the parameters of another controller, which is not used any more.

        The last plan, the forces sent and the random numbers go on, these unless the seed is
        another. So does what is believed of state and pendulum, unless the estimator is told
        something else. What `enable` says counts as before, unless `enabled` changes.
        """
        if other.parameters.enabled != self.parameters.enabled:
            self.enable(other.parameters.enabled)
        if other.parameters.seed != self.parameters.seed:
            self.random = other.random
        if other.estimator_inputs != self.estimator_inputs:
            self.estimator, self.message_filter = other.estimator, other.message_filter
            self.estimate, self.drive, problem = None, other.drive, other.nominal
        elif other.nominal.learned is not None:
            other.estimator.go_on(self.estimator)
            self.estimator, problem = other.estimator, other.nominal
        else:
            problem = other.nominal.with_physical(self.problem.physical)
        self.nominal, self.nominal_drive = other.nominal, other.nominal_drive
        self.parameters, self.solver_parameters = other.parameters, other.solver_parameters
        self.estimator_parameters = other.estimator_parameters
        self.plans = [(began, plan.resampled(problem.dt)) for began, plan in self.plans]
        self.starts.reconfigure(other.starts)
        self.set_problem(driven_by(self.drive, problem))

    @property
    def estimator_inputs(self) -> tuple[object, ...]:
        """Return what estimator and message filter are built from, but for learned numbers."""
        limits, _, prediction = self.nominal.given
        return (self.parameters.estimator, self.estimator_parameters, self.nominal.physical,
                self.nominal_drive, limits.track_limit, prediction.integrator,
                self.nominal.learned is not None)

    def update(self, t: float, x: Array, delay: float = 0.0, deadline: float = math.inf,
               time_noise: float = 0.0) -> Plan:
        """
        Return the plan that begins with the force to send now.

        t is the time of the measurement x [s], right but for a standard deviation of time_noise
        [s], delay its age when the force will act [s], and deadline in seconds of
        time.perf_counter(). Where the solve fails, it is the fallback. A
        state that a later one overtook adds nothing; a time before the run's first, or long before
        the last, is a new run. Why a state is not believed is in `rejection`. Where it is not
        `enabled`, the force is zero, and the first after it that of a first tick. Shapes: x
        (2n + 2,), NaN where a velocity is not measured. Raises ValueError where x is not finite.
        """
        began, begins = time.perf_counter(), t + delay
        believed = self.observe(t, x, time_noise)
        if not self.rejection:
            self.believed = begins
        if believed is None or not self.acts(begins):
            return self.zero_force(begins)
        x_0, rests = self.when_it_acts(believed, begins), self.rests(begins)
        if not np.all(np.isfinite(x_0)):   # where a learned model is wild
            return self.fallback(begins, believed)
        known = time.perf_counter()
        if self.stopping:
            return self.brake(x_0, begins)
        if rests and not self.is_due(begins):
            return self.feedback(x_0, rests[0], begins)
        plans = self.search(self, x_0, self.starts.of(x_0, rests), deadline)
        best = min(plans, key=lambda plan: plan.stats.cost if plan.usable else math.inf)
        if not best.usable:
            instead = self.fallback(begins, x_0)
            return replace(instead, stats=instead.stats._replace(candidates=candidates_of(plans)))
        return self.send(replace(best, stats=stats_of_tick(
            best, plans, known - began, time.perf_counter() - known)), begins)

    def is_due(self, begins: float) -> bool:
        """Return whether it is time [s] for a solve, where there is a last plan."""
        rate = self.parameters.solve_rate
        return rate == 0 or begins - self.plans[-1][0] > (1 - EARLY) / rate

    def feedback(self, x_0: Array, left: Plan, begins: float) -> Plan:
        """Return what the rest of the last plan makes of a state; that stays the last plan."""
        _, X, U, K = policy_rollout(self.problem, x_0, left.X, left.U, left.K)
        return self.command(plan_of(self.problem, X, U, Status.FEEDBACK, K), begins)

    def enable(self, enabled: bool) -> bool:
        """Act, from a first plan, or let the force go; return whether that is a change."""
        if enabled == self.enabled and not self.stopping:
            return False
        self.enabled, self.stopping, self.stopped_at = enabled, '', math.inf
        self.plans = []
        return True

    def stop(self, why: str) -> None:
        """Brake the cart from now on, and be disabled when that is over."""
        self.stopping = why

    def brake(self, x_0: Array, begins: float) -> Plan:
        """Return the plan that brakes the cart from a state."""
        self.stopped_at = min(self.stopped_at, begins + self.parameters.controlled_stop)
        return self.send(braked(self.problem, x_0, *self.before(begins)), begins)

    def before(self, begins: float) -> tuple[float, float]:
        """Return the force [N] before a time [s], and by how much it may change then."""
        (command, since), rate = self.forces.last(begins), self.parameters.force_rate_limit
        change = math.inf if math.isinf(rate) else rate * min(begins - since, self.problem.dt)
        return self.drive.gain * command + self.drive.bias, self.drive.gain * change

    def acts(self, begins: float) -> bool:
        """Return whether a force may act from a time on [s]."""
        if begins >= self.stopped_at - RESOLUTION:
            self.enable(False)
        return self.enabled and not self.is_blind(begins)

    def is_blind(self, begins: float) -> bool:
        """Return whether a time [s] is too long after the last believed state for a force."""
        return begins - self.believed > self.parameters.carry_over + RESOLUTION

    def observe(self, t: float, x: Array, time_noise: float) -> Array | None:
        """Take a measurement; return the newest believed state, None before one."""
        x = np.array(x, dtype=float)   # a copy: what is remembered is not the caller's
        size = len(self.nominal.cost.S)
        if x.shape != (size,) or not is_state(x):
            raise ValueError(f'the state is {x}; expected {size} finite numbers')
        if t < self.latest and t <= max(self.first, self.latest - OVERTAKEN):
            self.reset()
        if t <= self.latest:
            return self.x
        self.first, self.latest = min(self.first, t), t
        # a pendulum that hangs still would be refused for ever where a bias is believed in that is
        # not there any more, for what is refused cannot correct it
        self.rejection = self.message_filter.rejection(t, x, self.predict, self.predict_nominal)
        if self.rejection:
            return self.x
        if self.x is not None:
            x = to_turn_of(x, self.x)   # where an encoder wraps, the angle goes on
        measured = self.message_filter.with_velocities_measured(x)
        predicted = self.predict_learned(t)
        self.estimate = self.estimator.update(t, measured, self.forces, time_noise)
        if self.estimate is not None:
            x = self.accept(self.estimate)
        elif not np.all(np.isfinite(x)):
            raise ValueError(f'the state is {x}, without velocities; estimator ekf does without')
        self.message_filter.believe(measured, x)
        self.t, self.x = t, x
        self.choose_dynamics(x, measured, predicted)
        return x

    def predict_learned(self, t: float) -> Array | None:
        """Return the state at a time [s] by a learned model, if there is one, and a last state."""
        if self.nominal.learned is None or self.x is None:
            return None
        return self.forces.predict(self.nominal.model, self.drive, self.x, self.t, t)[0]

    def choose_dynamics(self, x: Array, measured: Array, predicted: Array | None) -> None:
        """Judge a learned model, if there is one, and plan with the equations where asked to."""
        nominal = self.nominal
        if nominal.learned is None:
            return
        self.trust = trust(nominal.learned, nominal.model, x, self.before(self.t)[0],
                           measured, predicted)
        known = not self.trust.warning or nominal.given[2].unseen == LEARNED
        if known != (self.problem.learned is not None):
            self.set_problem(driven_by(self.drive, nominal if known else nominal.analytic))

    def predict(self, x: Array, t: float, until: float) -> Array:
        """Return the state at a later time [s] under the commands already sent."""
        return self.forces.predict(self.problem.model, self.drive, x, t, until)[0]

    def predict_nominal(self, x: Array, t: float, until: float) -> Array:
        """Return the same without what has been estimated."""
        return self.forces.predict(self.nominal.model, self.nominal_drive, x, t, until)[0]

    def when_it_acts(self, x: Array, begins: float) -> Array:
        """
        Return the state from which a command of a time on [s] counts as the force on the cart.

        The drive's delay has passed then, and its lag is one more: a force that follows with a
        time constant has in the end the effect of one that stands still for so long, then jumps.
        """
        model, drive = self.problem.model, self.drive
        x, f = self.forces.predict(model, drive, x, self.t, begins + drive.delay)
        return hold(model._replace(h=STEP), x, drive.gain * f + drive.bias, drive.time_constant)

    def accept(self, estimate: Estimate) -> Array:
        """Return the estimated state, and solve for the pendulum as it is believed to be."""
        if not estimate.accepted:
            self.rejection = (f'the state is {estimate.distance:.3g} deviations from its '
                              'prediction; the estimator refuses it')
        self.drive = estimate.drive
        problem = self.problem
        if self.estimator.has_moved(problem.physical):
            with contextlib.suppress(ParameterError):   # of what no pendulum can be held with
                problem = self.nominal.with_physical(
                    replace(self.nominal.physical, **estimate.physical))
        problem = driven_by(self.drive, problem)
        if problem is not self.problem:
            self.set_problem(problem)
        return estimate.x

    def fallback(self, begins: float, x_0: Array | None = None) -> Plan:
        """
        Return a plan without a solve: the last one's policy, else the regulator, else zero force.

        begins is the time at which its first force will act [s]; without a state x_0 (2n + 2,)
        the last plan's own prediction is taken.
        """
        if not self.acts(begins):
            return self.zero_force(begins, x_0)
        problem, rests = self.problem, self.rests(begins)
        if x_0 is None:
            if not rests:
                return self.zero_force(begins)
            x_0 = rests[0].X[0]
        if self.stopping:
            return self.brake(x_0, begins)
        if rests:
            left = rests[0]
            _, X, U, _ = policy_rollout(problem, x_0, left.X, left.U, left.K)
            if np.all(np.isfinite(X)):
                return self.send(plan_of(problem, X, U, Status.LAST_POLICY), begins)
        _, X, U, _ = regulator_rollout(problem, x_0)
        # Far from the reference the regulator would only drive the cart into the end stop.
        if is_upright(X[-1] - problem.x_r):
            return self.send(plan_of(problem, X, U, Status.REGULATOR), begins)
        return self.zero_force(begins, x_0)

    def zero_force(self, begins: float, x_0: Array | None = None) -> Plan:
        """Return a plan of zero force from a time on [s]."""
        N = self.problem.horizon
        X = np.tile(self.problem.x_r if x_0 is None else x_0, (N + 1, 1))
        self.forces.add(begins, 0.0)
        self.plans = []    # it predicts nothing, so the next tick is a first one
        return plan_of(self.problem, X, np.zeros(N),
                       Status.ZERO if self.enabled else Status.DISABLED)

    def rests(self, begins: float) -> list[Plan]:
        """
        Return the rest of the last plan from a time on [s], if any, and of one a whole step older.

        Between its steps the forces of a plan are interpolated, which blurs them, and with every
        tick more so; after a whole step they are not.
        """
        if not self.plans:
            return []
        began, last = self.plans[-1]
        step_ago, older = min(
            self.plans, key=lambda each: abs(begins - each[0] - self.problem.dt))
        rests = [last.shifted(begins - began)]
        if older is not last:
            rests.append(older.shifted(begins - step_ago))
        return rests if len(rests[0].U) > 0 else []

    def send(self, plan: Plan, begins: float) -> Plan:
        """Remember the plan for the next tick, and the command that it begins with."""
        step_ago, plan = begins - self.problem.dt, self.command(plan, begins)
        self.plans = [each for each in self.plans if each[0] >= step_ago] + [(begins, plan)]
        return plan

    def command(self, plan: Plan, begins: float) -> Plan:
        """Return the plan within the limits of the rig; remember the command it begins with."""
        u, change = self.before(begins)
        plan = limited(self.problem, plan, Bounds(u - change, u + change))
        if self.parameters.controlled_stop > 0 and not self.stopping:
            self.stop(self.cannot_keep(plan, change))
            if self.stopping:
                self.stopped_at = begins + self.parameters.controlled_stop
                plan = replace(braked(self.problem, plan.X[0], u, change),
                               stats=plan.stats._replace(status=Status.STOP))
        plan = replace(plan, drive=self.drive)
        self.forces.add(begins, plan.first_force(self.nominal.u_max))
        return plan

    def cannot_keep(self, plan: Plan, change: float) -> str:
        """Return which limit neither the plan keeps nor, after its first step, the brake."""
        def not_kept(X: Array) -> str:
            return violation(self.problem, X)
        return not_kept(plan.X[:1]) or (not_kept(plan.X) and not_kept(
            braked(self.problem, plan.X[1], plan.U[0], change).X))

    def warm_up(self, most: float = math.inf) -> float:
        """
        Compile all that a tick and its report need, on a copy of the controller.

        Returns how long a tick takes from then on [s], as soon as it is known to be more than
        `most`.
        """
        nominal = self.nominal
        if nominal.learned is not None and nominal.given[2].unseen == ANALYTIC:
            RecedingHorizon(nominal.analytic, self.parameters, self.solver_parameters,
                            drive=self.nominal_drive).warm_up()
        twin = RecedingHorizon(nominal, self.parameters, self.solver_parameters,
                               drive=self.nominal_drive)
        twin.enabled = True
        taken = list[float]()
        # twice, for compiling takes longer than a tick may
        for x in starts_to_warm_up(nominal.physical.links) * 2:
            twin.reset()
            for limit in (WARMING, WARMING, min(self.parameters.time_limit, WARMING)):
                n, began = len(taken), time.perf_counter()
                # a state that stands still would be refused, and the estimator left out
                plan = twin.update(n * self.problem.dt, x + 1e-3 * n, 1e-3, began + limit)
                taken.append(time.perf_counter() - began)
            if min(taken[1:]) > most:   # the first may compile or load
                return min(taken[1:])
        twin.fallback(len(taken) * self.problem.dt)
        braked(self.problem, self.problem.x_r, 0.0, math.inf)
        terms(self.problem.cost, plan.X - plan.turns, plan.U)
        return min(taken[-1], taken[-7])


def driven_by(drive: Drive, problem: Problem) -> Problem:
    """Return a problem within what a drive can do; the same where that is nearly what it has."""
    u_max = problem.given[0].force_limit
    bounds = Bounds(drive.bias - drive.gain * u_max, drive.bias + drive.gain * u_max)
    near = all(abs(b - old) <= NEARLY * u_max for b, old in zip(bounds, problem.bounds))
    return problem if near else replace(problem, bounds=bounds)


def starts_to_warm_up(links: int) -> tuple[Array, Array]:
    """Return two states of which the one needs what the other does not: leaning, and hanging."""
    leaning = upright(links)
    leaning[1] = LEANING
    return leaning, hanging(links)
