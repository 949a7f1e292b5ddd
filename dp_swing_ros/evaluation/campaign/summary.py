# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Summary of a campaign's rows: standings, scores, comparisons, failures."""

from collections.abc import Sequence
import dataclasses
import itertools
import math
from typing import Any

import numpy as np

from dp_swing_ros.evaluation.campaign.rows import ERROR, Row, solves
from dp_swing_ros.evaluation.campaign.scores import (
    CRITERIA, Level, levels, passed_fraction, performance, robustness, SCORED)
from dp_swing_ros.evaluation.comparison import (
    Paired, paired, paired_ratio, Rate, rate, Ratio, sign_test)
from dp_swing_ros.evaluation.metrics import Outcome
from dp_swing_ros.evaluation.scenarios import PROFILE, SCENARIOS
from dp_swing_ros.pendulum.state import Array

OF_HELD = ('settling_time', 'hold_error', 'smoothness', 'roughness', 'energy', 'impulse',
           'squared_force', 'squared_speed', 'closed_loop_cost', 'settling_offset')
OF_ALL = ('largest_force', 'largest_position', 'largest_angle')
SWEPT = ['', PROFILE, *(sweep.parameter for scenario in SCENARIOS.values()
                        for sweep in scenario.sweeps)]  # in the order of reports
NEAR_GOAL, DROP = 'near_goal', 0.4  # [rad] who gets further from upright has dropped the pendulum
COMPARED = ('settling_time', 'smoothness', 'roughness')


@dataclasses.dataclass(frozen=True)
class Standing:
    """
    How a contestant did in a scenario.

    Medians are over the runs that were held, extremes over all; solve times over all solves [s];
    strikes are the track strikes of all runs together.
    Dropped are the seeds of a start near the goal from which an angle went beyond DROP.
    """

    contestant: str
    scenario: str
    held: Rate
    errors: int
    medians: dict[str, float]
    extremes: dict[str, float]
    solve_time: dict[str, float]
    solves: int
    strikes: int
    deadline_misses: int
    stand_ins: int
    sweeps: dict[str, list[Level]]
    dropped: list[int]


@dataclasses.dataclass(frozen=True)
class Score:
    """The scores of a contestant; NaN where their scenarios were not run."""

    contestant: str
    performance: float
    robustness: float
    criteria: dict[str, float]


@dataclasses.dataclass(frozen=True)
class Duel:
    """Two contestants on the same cases: who held what the other did not, and by how much."""

    scenario: str
    first: str
    second: str
    cases: int
    first_only: int
    second_only: int
    p: float
    differences: dict[str, Paired]  # first less second
    cost: Ratio                     # of the closed-loop costs, first over second


@dataclasses.dataclass(frozen=True)
class Failure:
    """An episode that was not held to the end, and why."""

    contestant: str
    scenario: str
    parameter: str
    level: float | None
    seed: int
    why: str


@dataclasses.dataclass(frozen=True)
class Summary:
    """All of it; lists are in the order of the campaign's description."""

    campaign: dict[str, Any]
    episodes: int
    missing: int
    standings: list[Standing]
    scores: list[Score]
    duels: list[Duel]
    failures: list[Failure]


def summarise(campaign: dict[str, Any], rows: Sequence[Row], expected: int) -> Summary:
    """Summarise the rows of a campaign as described, of as many as are expected."""
    scenarios, contestants = list(campaign['scenarios']), list(campaign['contestants'])
    rows = sorted(rows, key=lambda row: (
        scenarios.index(row.key.scenario), contestants.index(row.key.contestant),
        SWEPT.index(row.key.parameter), row.key.level or 0.0, row.key.seed))
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        groups.setdefault((row.key.contestant, row.key.scenario), []).append(row)
    return Summary(
        campaign, len(rows), expected - len(rows),
        [standing(*names, group) for names, group in groups.items()],
        [score(contestant, groups) for contestant in contestants],
        [duel(scenario, first, second, common(groups[first, scenario], groups[second, scenario]))
         for scenario in scenarios for first, second in itertools.combinations(contestants, 2)
         if (first, scenario) in groups and (second, scenario) in groups],
        [Failure(*row.key, why(row)) for row in rows if not row.metrics.success])


def standing(contestant: str, scenario: str, rows: Sequence[Row]) -> Standing:
    """Sum up the rows of a contestant in a scenario."""
    held = [row for row in rows if row.metrics.success]
    times = solves(rows)
    return Standing(
        contestant, scenario, rate([row.metrics.success for row in rows]),
        sum(row.outcome == ERROR for row in rows),
        {name: _reduced(np.median, held, name) for name in OF_HELD},
        {name: _reduced(np.max, rows, name) for name in OF_ALL},
        {name: float(np.quantile(times, share)) if len(times) else math.nan
         for name, share in (('median', 0.5), ('p99', 0.99), ('largest', 1.0))},
        len(times), sum(row.metrics.strikes for row in rows),
        sum(row.metrics.deadline_misses for row in rows),
        sum(row.metrics.stand_ins for row in rows), levels(rows),
        [row.key.seed for row in rows if scenario == NEAR_GOAL
         and not row.metrics.largest_angle <= DROP])


def _reduced(reduce: Any, rows: Sequence[Row], name: str) -> float:
    values = _values(rows, name)
    values = values[~np.isnan(values)]
    return float(reduce(values)) if len(values) else math.nan


def _values(rows: Sequence[Row], name: str) -> Array:
    return np.array([getattr(row.metrics, name) for row in rows], dtype=float)


def score(contestant: str, groups: dict[tuple[str, str], list[Row]]) -> Score:
    """Score a contestant on the scenarios that were run."""
    hanging = groups.get((contestant, SCORED), [])
    criteria = {name: passed_fraction(groups[contestant, name]) for name in CRITERIA
                if (contestant, name) in groups}
    return Score(contestant, float(np.mean([performance(row.metrics) for row in hanging]))
                 if hanging else math.nan, robustness(criteria), criteria)


def common(a: Sequence[Row], b: Sequence[Row]) -> list[tuple[Row, Row]]:
    """Pair the rows of two contestants on the cases that both were given."""
    of_b = {row.key[2:]: row for row in b}
    return [(row, of_b[row.key[2:]]) for row in a if row.key[2:] in of_b]


def duel(scenario: str, first: str, second: str, pairs: Sequence[tuple[Row, Row]]) -> Duel:
    """Compare two contestants case by case."""
    won = sum(one.metrics.success and not other.metrics.success for one, other in pairs)
    lost = sum(other.metrics.success and not one.metrics.success for one, other in pairs)
    # how it settled and held is compared on those cases alone that both held
    held = [pair for pair in pairs if pair[0].metrics.success and pair[1].metrics.success]
    one, other = [pair[0] for pair in held], [pair[1] for pair in held]
    return Duel(
        scenario, first, second, len(pairs), won, lost, sign_test(won, lost),
        {name: paired(_values(one, name), _values(other, name)) for name in COMPARED},
        paired_ratio(_values(one, 'closed_loop_cost'), _values(other, 'closed_loop_cost')))


def why(row: Row) -> str:
    """Return why an episode was not held."""
    if row.outcome == ERROR:
        return row.detail
    stop = ', after it met an end stop' if row.metrics.strikes else ''
    return Outcome[row.outcome].value + stop


def plain(value: Any) -> Any:
    """Return a summary as JSON has it: no tuples, no NaN, no infinity."""
    if dataclasses.is_dataclass(value):
        return {field.name: plain(getattr(value, field.name))
                for field in dataclasses.fields(value)}
    if hasattr(value, '_asdict'):
        return plain(value._asdict())
    if isinstance(value, dict):
        return {key: plain(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
