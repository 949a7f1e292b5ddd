# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Why a force is what it is: what the mpc reports of a tick, by its names in /diagnostics."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, MISSING
import math
from typing import Any

import numpy as np

from dp_swing_ros.estimators.estimator import Estimate
from dp_swing_ros.pendulum.geometry import joint_positions
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.pendulum.state import Array, joints, links_of
from dp_swing_ros.problem.cost import terms
from dp_swing_ros.problem.plan import Plan, Tries
from dp_swing_ros.problem.problem import Problem

Figures = Mapping[str, float | int | str]


@dataclass(frozen=True, kw_only=True)
class TickReport:
    """
    What a tick of the mpc did, and what it takes to repeat it.

    Each field is a value of the status `mpc` on /diagnostics, by its name; those with a default
    are not in the oldest bags.
    """

    solver: str = ''
    status: str                # a name of Status
    cost: float                # of the plan
    cost_terms: Figures = field(default_factory=dict)   # cost_NAME
    step: float = math.nan     # [s] of it, which goes with the period of the states
    iterations: int = 0        # of the solve that led to it
    solve_time: float = math.nan       # [s] of the tick, with the estimate and all starts
    phases: Figures = field(default_factory=dict)       # NAME_time [s]
    start: str = ''            # where that solve began
    lead: float = math.inf     # by how much another start was dearer
    starts: str = ''           # of all solves of the tick, one after the other
    costs: str = ''
    solves: str                # their iterations
    age: float = 0.0           # [s] of the state when it came
    latency: float = math.nan  # [s] from its measurement until the force was sent
    delay: float               # [s] and until it was to act
    late: bool = False         # it took longer than the period of the states
    late_total: int = 0
    missed_total: int = 0      # states that others overtook
    force: float               # [N]
    real_time: bool
    time: float | None = None  # [s] of the measurement, by the clock of the controller
    time_noise: float = 0.0    # [s] by which that may be off
    carried: int               # periods without a state
    resets: int
    revision: int | None = None        # how often the parameters had changed
    number: int                # of the force
    enabled: bool = True
    stopping: bool = False
    sent: int = 0              # [ns] by its sender; which state it was where stamps stand still
    clock: str = ''            # what the stamps are
    estimate: Figures = field(default_factory=dict)

    @classmethod
    def of(cls, plan: Plan, problem: Problem, estimate: Estimate | None,
           **others: Any) -> 'TickReport':
        """Return the report of a plan for a problem, by an estimate, and of all that is beside."""
        stats = plan.stats
        costs = sorted(each.cost for each in stats.candidates if math.isfinite(each.cost))
        return cls(
            status=stats.status.name, cost=stats.cost, step=plan.dt,
            cost_terms=terms(problem.cost, plan.X - plan.turns, plan.U)._asdict(),
            iterations=stats.iterations, solve_time=stats.solve_time, phases=stats.phases,
            start=plan.start, lead=costs[1] - costs[0] if len(costs) > 1 else math.inf,
            starts=' '.join(candidate.start for candidate in stats.candidates),
            costs=' '.join(f'{candidate.cost:.6g}' for candidate in stats.candidates),
            solves=' '.join(map(str, stats.solves)),
            estimate={} if estimate is None else of_estimate(estimate), **others)

    @classmethod
    def read(cls, values: Figures) -> 'TickReport':
        """
        Return the report that has these values, of which those NEEDED must be there.

        Costs by terms, phases and the estimate stay in the values.
        """
        return cls(**{name: kind(values[name]) for name, kind in KINDS.items() if name in values})

    def values(self) -> dict[str, float | int | str]:
        """Return all values by their names."""
        found: dict[str, float | int | str] = {}
        for name in NAMES:
            value = getattr(self, name)
            match name:
                case 'cost_terms':
                    found.update((f'cost_{term}', cost) for term, cost in value.items())
                case 'phases':
                    found.update((f'{phase}_time', taken) for phase, taken in value.items())
                case 'estimate':
                    found.update(value)
                case _:
                    found[name] = value
        return found


NAMES = tuple(each.name for each in fields(TickReport))
NEEDED = tuple(each.name for each in fields(TickReport)
               if each.default is MISSING and each.default_factory is MISSING)
KINDS: dict[str, Any] = {
    each.name: kind for each in fields(TickReport)
    for kind in (bool, int, str, float) if each.type in (kind, kind | None)}


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
