# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the mpc reports of a tick: its figures, and in words what is wrong."""

import math
from typing import Any

import numpy as np

from dp_swing_ros.control.observer import Belief
from dp_swing_ros.control.receding_horizon import RecedingHorizon
from dp_swing_ros.estimators.estimator import Estimate
from dp_swing_ros.messages.fields import ERROR, OK, Report, WARN
from dp_swing_ros.messages.ticks import keys_of_state, TickReport
from dp_swing_ros.pendulum.geometry import joint_positions
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.pendulum.state import Array, links_of, turned
from dp_swing_ros.problem.cost import terms
from dp_swing_ros.problem.parameters import ANALYTIC, LEARNED
from dp_swing_ros.problem.plan import FALLBACK, Plan, Status, Tries
from dp_swing_ros.problem.problem import Problem
from dp_swing_ros.runtime.sent import Log

HORIZONS = 3       # without a plan that comes to the goal
IN_VAIN = 8        # horizons of plans that come there, and the pendulum does not
UNEXPLAINED = ('the states are not those of a chain of rigid links, whatever is estimated of '
               'it; expected no stop, magnet or cable that is no spring in a joint, no belt that '
               'slips, and each encoder at the joint that is told')


class Reporter:
    """Reports the ticks of a controller, one after the other."""

    def __init__(self, controller: RecedingHorizon, log: Log) -> None:
        """Take the controller, and a log for what is wrong for long."""
        self.controller, self.log = controller, log
        self.reset()

    def reset(self) -> None:
        """Count anew."""
        self.late_total = 0     # ticks
        self.goal_watch = GoalWatch()

    def report(self, stamp: int, plan: Plan, complaint: str, warning: str, *, time: float,
               late: bool = False, **figures: Any) -> Report:
        """
        Return the report of a tick for the state of a stamp [ns], measured at a time [s].

        Complaint and warning say what else is wrong with it; figures are as TickReport names them.
        """
        controller, stats = self.controller, plan.stats
        problem, stopping = controller.belief.problem, controller.stopping
        # what is disabled is not expected to arrive
        is_there, arrives = (not controller.enabled or problem.is_reached(x) for x in (
            controller.belief.x, plan.X[-1]))
        astray = self.goal_watch.warning(time, is_there, arrives, problem.horizon * problem.dt)
        if astray:
            self.log.say(WARN, astray, 'goal', 10.0)
        estimate = controller.belief.estimate
        unexplained = ''   # of what is disabled a hand may move the links
        if controller.enabled and estimate is not None and not estimate.explained:
            unexplained = UNEXPLAINED
            self.log.say(WARN, unexplained, 'model', 10.0)
        warning = '; '.join(filter(None, (
            warning, astray, unexplained,
            'the solve failed' if stats.candidates and stats.status in FALLBACK else '')))
        adaptive = controller.observer.adaptive
        drives = '' if adaptive is None else adaptive.words(time)
        if drives:
            self.log.say(OK, drives, 'dynamics', 10.0)
        self.late_total += late
        level = OK
        if complaint or stopping or stats.status is Status.ZERO:
            level = ERROR
        elif warning or late or stats.status in (*FALLBACK, Status.DISABLED):
            level = WARN
        tick = tick_report(
            plan, problem, estimate, solver=controller.parameters.solver,
            time=time, late=late, late_total=self.late_total, enabled=controller.enabled,
            stopping=bool(stopping), **figures)
        words = filter(None, (complaint, stopping, warning, drives, stats.status.value))
        return Report(stamp, level, '; '.join(words), tick.values())


class GoalWatch:
    """Whether the pendulum comes to the goal, or has not for so long that it may never."""

    def __init__(self) -> None:
        """Begin without any tick."""
        self.planned = self.there = math.inf   # [s] when a plan came there last, and the pendulum

    def warning(self, t: float, is_there: bool, arrives: bool, horizon: float) -> str:
        """
        Return what is wrong, if anything, after a tick at a time t [s].

        Then the pendulum was at the goal, or not, and the plan came there within a horizon [s].
        """
        if is_there or t < self.there:
            self.there = t
        if is_there or arrives or t < self.planned:
            self.planned = t
        if t - self.planned > HORIZONS * horizon:
            return (f'no plan has come to the goal for {t - self.planned:.1f} s, more than '
                    f"{HORIZONS} horizons; expected a longer 'horizon', or a goal that can be "
                    'reached')
        return '' if t - self.there <= IN_VAIN * horizon else (
            f'plans come to the goal, but the pendulum has not for {t - self.there:.1f} s; '
            'expected bodies and drive near those that the mpc is told, and a force that is '
            'enough')


def tick_report(plan: Plan, problem: Problem, estimate: Estimate | None,
                **others: Any) -> TickReport:
    """Return the report of a plan for a problem, by an estimate, and of all that is beside."""
    stats, (there, back) = plan.stats, problem.with_goal_on(plan.turns)
    costs = sorted(each.cost for each in stats.candidates if math.isfinite(each.cost))
    return TickReport(
        dynamics=ANALYTIC if problem.learned is None else LEARNED,
        status=stats.status.name, cost=stats.cost, step=plan.dt,
        cost_terms=terms(there.cost, plan.X - back, plan.U)._asdict(),
        iterations=stats.iterations, solve_time=stats.solve_time, phases=stats.phases,
        start=plan.start, lead=costs[1] - costs[0] if len(costs) > 1 else math.inf,
        starts=' '.join(candidate.start for candidate in stats.candidates),
        costs=' '.join(f'{candidate.cost:.6g}' for candidate in stats.candidates),
        solves=' '.join(map(str, stats.solves)),
        estimate={} if estimate is None else of_estimate(estimate), **others)


def of_estimate(estimate: Estimate) -> dict[str, float]:
    """Return the figures of an estimate by their keys."""
    links = links_of(estimate.x)
    return {**dict(zip(keys_of_state('estimate', links), estimate.x.tolist())),
            **dict(zip(keys_of_state('innovation', links), estimate.innovation.tolist())),
            'innovation_distance': estimate.distance, 'refused': estimate.refused,
            'explained': estimate.explained,
            'actuation_delay': estimate.drive.delay,
            'motor_time_constant': estimate.drive.time_constant,
            'force_gain': estimate.drive.gain, 'force_bias': estimate.drive.bias,
            **{f'link{i + 1}_balance': float(angle)
               for i, angle in enumerate(np.broadcast_to(estimate.balance, links))},
            **estimate.physical}


def tip_paths(x_0: Array, tries: Tries, belief: Belief) -> Array:
    """
    Return where the tip [m] goes from a state of a plan under each of some tries, x and z.

    Shapes: x_0 (2n + 2,) -> (M, N + 1, 2).
    """
    problem = belief.problem
    X = [rollout(problem.model, x_0, U) for U in tries.U]
    return joint_positions(
        turned(np.reshape(X, (len(X), problem.horizon + 1, len(x_0))), belief.balance),
        problem.physical.lengths)[..., -1, :]
