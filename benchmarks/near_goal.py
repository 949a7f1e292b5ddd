# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Who holds the pendulum near the goal, of the starts of which a trajectory is known that does.

Such a trajectory is a run that was held, or a plan by the bounded LQR. That none is known
does not say that there is none.
"""

from collections.abc import Sequence

import numpy as np

from dp_swing_ros import configuration
from dp_swing_ros.control.bounded_lqr import BoundedLQR
from dp_swing_ros.evaluation.campaign.contestants import Contestant, parse_all
from dp_swing_ros.evaluation.campaign.report import share, spans
from dp_swing_ros.evaluation.campaign.rows import Row
from dp_swing_ros.evaluation.comparison import rate
from dp_swing_ros.evaluation.scenarios import Case, SCENARIOS
from dp_swing_ros.pendulum.state import angles, Array
from dp_swing_ros.problem.problem import Problem
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.tables import compact

DROPPED = 0.4   # [rad]
STEPS = 60      # of the plan that might hold it
SCENARIO = 'near_goal'
DURATION = 10.0  # [s]


def cases() -> list[Case]:
    """Return the starts."""
    return list(SCENARIOS[SCENARIO].cases(SCENARIO, None, None, DURATION))


def episodes() -> list[tuple[Contestant, Case]]:
    """Return the runs of all solvers."""
    contestants = parse_all(SOLVERS)
    return [(contestant, case) for case in cases() for contestant in contestants]


def planned_angle(problem: Problem, x_0: Array) -> float:
    """Return the largest angle [rad] of a plan by the bounded LQR."""
    plan = BoundedLQR(problem).start(x_0)
    return np.inf if plan is None else float(np.abs(plan.X[:, angles(x_0)]).max())


def page(rows: Sequence[Row], made: str) -> str:
    """Return the page from the rows of all runs."""
    seeds = [case.seed for case in cases()]
    problem = configuration.problem({'horizon': STEPS})
    planned = {case.seed for case in cases()
               if planned_angle(problem, np.array(case.plant['initial_state'])) <= DROPPED}
    held = {name: {row.key.seed for row in rows if row.key.contestant == name
                   and row.metrics.success and row.metrics.largest_angle <= DROPPED}
            for name in SOLVERS}
    known = planned.union(*held.values())
    unknown = sorted(set(seeds) - known)
    return '\n'.join([
        '# Near the goal\n', made,
        "Starts at rest with both angles within ±0.3 rad (the paper's Figs. 8-10), seeds "
        f'{seeds[0]} to {seeds[-1]}, {DURATION:g} s, defaults, so 20 N at most; the rows: '
        '[near_goal.csv.gz](near_goal.csv.gz). Held is what stays within '
        f'{DROPPED:g} rad, and upright to the end; dropped what leaves {DROPPED:g} rad.\n',
        f'Of {len(known)} of the {len(seeds)} starts a trajectory is known that holds them: a run '
        f'below, or a plan by the bounded LQR. The other {len(unknown)} are open'
        + (f' (seeds {spans(unknown)})' if unknown else '') +
        ': with 20 N they are not known to be possible; a later nonlinear program may tell.\n',
        compact([('solver', 'held, of those known to be possible', 'dropped though possible'),
                 *((f'`{name}`', share(rate([seed in held[name] for seed in sorted(known)])),
                    spans(known - held[name]) or 'none') for name in SOLVERS)]), ''])
