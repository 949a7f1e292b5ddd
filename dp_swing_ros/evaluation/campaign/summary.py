# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Summary of a campaign's rows: standings, scores, comparisons, failures.

The two scores are those of the DFKI double-pendulum leaderboards, for this plant:

    performance = success (1 - 1/5 Σ tanh(π c / n)),    robustness = mean of six passed fractions

Source: the RealAIGym leaderboards, version 2; docs/evaluation.md derives the n.
"""

from collections.abc import Iterable, Mapping, Sequence
import itertools
import math
from typing import Any, NamedTuple

import numpy as np

from dp_swing_ros.evaluation.campaign.rows import (
    CampaignError, ERROR, grouped, identical, Key, Row, solves)
from dp_swing_ros.evaluation.comparison import (
    Paired, paired, paired_ratio, Rate, rate, Ratio, same_held, sign_test)
from dp_swing_ros.evaluation.metrics import Metrics, Outcome, quantile, reduced
from dp_swing_ros.evaluation.scenarios import PROFILE, SCENARIOS
from dp_swing_ros.pendulum.parameters import FORCE
from dp_swing_ros.pendulum.state import Array, LINKS

OF_HELD = ('settling_time', 'rest_offset', 'hold_error', 'smoothness', 'roughness', 'energy',
           'impulse', 'squared_force', 'squared_speed', 'closed_loop_cost', 'settling_offset',
           'settling_time_with_cart')
OF_ALL = ('largest_force', 'largest_position', 'largest_angle')
OF_SOLVES = {'median': 0.5, 'p99': 0.99, 'largest': 1.0}
# in the order of reports
SWEPT = ['', PROFILE, *(sweep.parameter for scenario in SCENARIOS.values()
                        for sweep in scenario.sweeps),
         *(way for scenario in SCENARIOS.values() for links in LINKS
           for way in scenario.ways(links))]
NEAR_GOAL, DROP = 'near_goal', 0.4  # [rad] who gets further from upright has dropped the pendulum
COMPARED = ('settling_time', 'smoothness', 'roughness')
# n of each measure c, by which a TVLQR about one offline swing-up scores about as on theirs
NORMS = {'settling_time': 20.0, 'energy': 360.0, 'squared_force': 6500.0, 'roughness': 36.0,
         'squared_speed': 290.0}
SCORED = 'hanging'  # the scenario whose runs give the performance
CRITERIA = [name for name, scenario in SCENARIOS.items() if scenario.criterion]


class Level(NamedTuple):
    """One level of a sweep: how many of its runs were held; it passes with more than half."""

    value: float
    held: int
    runs: int

    @property
    def passed(self) -> bool:
        """Return whether more than half were."""
        return 2 * self.held > self.runs


class Way(NamedTuple):
    """What became of one way of several, and how long it took where it was held [s], median."""

    held: Rate
    settling_time: float


class Standing(NamedTuple):
    """
    How a contestant did in a scenario.

    Medians are over the runs that were held, extremes over all; solve times over all solves [s];
    strikes are the track strikes of all runs together, uptime is the mean share of their time
    upright.
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
    uptime: float
    deadline_misses: int
    stand_ins: int
    sweeps: dict[str, list[Level]]
    ways: dict[str, Way]
    dropped: list[int]


class Score(NamedTuple):
    """The scores of a contestant; NaN where their scenarios were not run."""

    contestant: str
    performance: float
    robustness: float
    criteria: dict[str, float]


class Duel(NamedTuple):
    """
    Two contestants on the same cases: who held what the other did not, and by how much.

    p is of the test that they differ in that, same of the one that they do not.
    """

    scenario: str
    first: str
    second: str
    cases: int
    first_only: int
    second_only: int
    p: float
    same: float
    differences: dict[str, Paired]  # first less second
    cost: Ratio                     # of the closed-loop costs, first over second


class Failure(NamedTuple):
    """An episode that was not held to the end, and why."""

    contestant: str
    scenario: str
    parameter: str
    level: float | None
    seed: int
    why: str


class Summary(NamedTuple):
    """All of it; lists are in the order of the campaign's description."""

    campaign: dict[str, Any]
    episodes: int
    missing: int
    standings: list[Standing]
    scores: list[Score]
    duels: list[Duel]
    failures: list[Failure]

    @property
    def drives(self) -> list[str]:
        """Return the drive of each contestant."""
        contestants = self.campaign['contestants'].values()
        return [about['mpc'].get('drive', FORCE) for about in contestants]


def summarise(campaign: dict[str, Any], rows: Sequence[Row], expected: int) -> Summary:
    """Summarise the rows of a campaign as described, of as many as are expected."""
    scenarios, contestants = list(campaign['scenarios']), list(campaign['contestants'])
    rows = sorted(rows, key=lambda row: (
        scenarios.index(row.key.scenario), contestants.index(row.key.contestant),
        SWEPT.index(row.key.parameter), row.key.level or 0.0, row.key.seed))
    groups = grouped(rows, lambda row: row.key[:2])
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
        {name: reduced(np.median, _known(held, name)) for name in OF_HELD},
        {name: reduced(np.max, _known(rows, name)) for name in OF_ALL},
        {name: quantile(times, part) for name, part in OF_SOLVES.items()},
        len(times), sum(row.metrics.strikes for row in rows),
        reduced(np.mean, _known(rows, 'uptime')),
        sum(row.metrics.deadline_misses for row in rows),
        sum(row.metrics.stand_ins for row in rows), levels(rows), ways(rows),
        [row.key.seed for row in rows if scenario == NEAR_GOAL
         and not row.metrics.largest_angle <= DROP])


def _values(rows: Sequence[Row], name: str) -> Array:
    return np.array([getattr(row.metrics, name) for row in rows], dtype=float)


def _known(rows: Sequence[Row], name: str) -> Array:
    values = _values(rows, name)
    return values[~np.isnan(values)]


def levels(rows: Iterable[Row]) -> dict[str, list[Level]]:
    """Return the levels of a contestant in one scenario, in order, by what is swept."""
    swept: dict[str, list[Level]] = {}
    for (parameter, value), runs in grouped(rows, lambda row: row.key[2:4]).items():
        if value is not None:
            held = sum(row.metrics.success for row in runs)
            swept.setdefault(parameter, []).append(Level(value, held, len(runs)))
    return {parameter: sorted(found) for parameter, found in swept.items()}


def ways(rows: Iterable[Row]) -> dict[str, Way]:
    """Return the ways of a contestant in one scenario, in order, where there are several."""
    return {way: Way(rate([row.metrics.success for row in runs]), reduced(np.median, _known(
        [row for row in runs if row.metrics.success], 'settling_time')))
        for (way, value), runs in grouped(rows, lambda row: row.key[2:4]).items()
        if way and value is None}


def score(contestant: str, groups: Mapping[tuple[str, str], Sequence[Row]]) -> Score:
    """Score a contestant on its rows, by contestant and scenario, of the scenarios that ran."""
    runs = [performance(row.metrics) for row in groups.get((contestant, SCORED), ())]
    criteria = {name: passed_fraction(groups[contestant, name]) for name in CRITERIA
                if (contestant, name) in groups}
    robustness = float(np.mean([criteria.get(name, math.nan) for name in CRITERIA]))
    return Score(contestant, reduced(np.mean, np.array(runs)), robustness, criteria)


def performance(metrics: Metrics) -> float:
    """Return the performance score of a run."""
    if not metrics.success:
        return 0.0
    costs = [math.tanh(math.pi * getattr(metrics, name) / norm) for name, norm in NORMS.items()]
    return 1 - sum(costs) / len(costs)


def passed_fraction(rows: Iterable[Row]) -> float:
    """Return the share of levels that pass, of all that is swept together."""
    return float(np.mean([level.passed for swept in levels(rows).values() for level in swept]))


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
        same_held(won, lost, len(pairs)),
        {name: paired(_values(one, name), _values(other, name)) for name in COMPARED},
        paired_ratio(_values(one, 'closed_loop_cost'), _values(other, 'closed_loop_cost')))


def rivals(now: Sequence[Row], stored: Sequence[Row]) -> list[tuple[Duel, int]]:
    """
    Compare the rows of two campaigns, in the order of the first.

    Beside each duel, now against stored, stands how many of its rows are equal to the bit. Raises
    CampaignError where they have no episode in common.
    """
    refuse_strangers([row.key for row in now], stored)
    before = {row.key: row for row in stored}
    pairs = [(row, before[row.key]) for row in now if row.key in before]
    return [(duel(scenario, contestant, 'stored', group), sum(identical(*pair) for pair in group))
            for (contestant, scenario), group in
            grouped(pairs, lambda pair: pair[0].key[:2]).items()]


def refuse_strangers(keys: Iterable[Key], stored: Sequence[Row]) -> None:
    """Raise CampaignError where none of these episodes is stored."""
    if not {row.key for row in stored} & set(keys):
        names = dict.fromkeys(f'{row.key.contestant} in {row.key.scenario}' for row in stored)
        raise CampaignError('no episode of this campaign is stored; stored are '
                            f'{", ".join(names) or "none"}')


def why(row: Row) -> str:
    """Return why an episode was not held."""
    if row.outcome == ERROR:
        return row.detail
    met = row.metrics.strikes and row.outcome != Outcome.STRUCK.name
    return Outcome[row.outcome].value + (', after it met an end stop' if met else '')


def plain(value: Any) -> Any:
    """Return a summary as JSON has it: no tuples, no NaN, no infinity."""
    if hasattr(value, '_asdict'):
        value = value._asdict()
    if isinstance(value, dict):
        return {key: plain(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
