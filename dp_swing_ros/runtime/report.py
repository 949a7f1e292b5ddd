# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the mpc reports of a tick: of plan, problem and estimate, as numbers."""

import math
from typing import Any

import numpy as np

from dp_swing_ros.estimators.estimator import Estimate
from dp_swing_ros.messages.ticks import keys_of_state, TickReport
from dp_swing_ros.pendulum.geometry import joint_positions
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.pendulum.state import Array, links_of
from dp_swing_ros.problem.cost import terms
from dp_swing_ros.problem.plan import Plan, Tries
from dp_swing_ros.problem.problem import Problem


def tick_report(plan: Plan, problem: Problem, estimate: Estimate | None,
                **others: Any) -> TickReport:
    """Return the report of a plan for a problem, by an estimate, and of all that is beside."""
    stats = plan.stats
    costs = sorted(each.cost for each in stats.candidates if math.isfinite(each.cost))
    return TickReport(
        status=stats.status.name, cost=stats.cost, step=plan.dt,
        cost_terms=terms(problem.cost, plan.X - plan.turns, plan.U)._asdict(),
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
            'actuation_delay': estimate.drive.delay,
            'motor_time_constant': estimate.drive.time_constant,
            'force_gain': estimate.drive.gain, 'force_bias': estimate.drive.bias,
            **estimate.physical}


def tip_paths(x_0: Array, tries: Tries, problem: Problem) -> Array:
    """
    Return where the tip [m] goes from a state under each of some tries, x and z.

    Shapes: x_0 (2n + 2,) -> (M, N + 1, 2).
    """
    X = [rollout(problem.model, x_0, U) for U in tries.U]
    return joint_positions(np.reshape(X, (len(X), problem.horizon + 1, len(x_0))),
                           problem.physical.lengths)[..., -1, :]
