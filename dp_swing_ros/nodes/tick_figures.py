# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Why a force is what it is: the figures of a tick of the mpc, by their names in /diagnostics."""

import math

import numpy as np

from dp_swing_ros.estimators.estimator import Estimate
from dp_swing_ros.pendulum.geometry import joint_positions
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.pendulum.state import Array, joints, links_of
from dp_swing_ros.problem.cost import terms
from dp_swing_ros.problem.plan import Plan, Tries
from dp_swing_ros.problem.problem import Problem


def of_plan(plan: Plan, problem: Problem) -> dict[str, float | int | str]:
    """Return what a plan costs by terms, what each solve of the tick led to, and how long."""
    stats = plan.stats
    costs = sorted(candidate.cost for candidate in stats.candidates)
    by_term = terms(problem.cost, plan.X - plan.turns, plan.U)
    return {
        'status': stats.status.name, 'cost': stats.cost,
        **{f'cost_{term}': value for term, value in by_term._asdict().items()},
        'iterations': stats.iterations, 'solve_time': stats.solve_time,
        **{f'{phase}_time': value for phase, value in stats.phases.items()},
        'start': plan.start, 'lead': costs[1] - costs[0] if len(costs) > 1 else math.inf,
        'starts': ' '.join(candidate.start for candidate in stats.candidates),
        'costs': ' '.join(f'{candidate.cost:.6g}' for candidate in stats.candidates),
        'solves': ' '.join(map(str, stats.solves))}


def of_estimate(estimate: Estimate) -> dict[str, float]:
    """Name the figures of an estimate for the diagnostics."""
    names = joints(links_of(estimate.x))
    places = [f'{joint}_{kind}' for kind in ('position', 'velocity') for joint in names]
    return {**{f'estimate_{place}': value for place, value in zip(places, estimate.x.tolist())},
            **{f'innovation_{place}': value
               for place, value in zip(places, estimate.innovation.tolist())},
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
