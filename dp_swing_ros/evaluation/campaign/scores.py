# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The two scores of the DFKI double-pendulum leaderboards, for this plant.

    performance = success (1 - 1/5 Σ tanh(π c / n)),    robustness = mean of six passed fractions

Source: the RealAIGym leaderboards, version 2; docs/evaluation.md derives the n.
"""

from collections.abc import Iterable, Mapping, Sequence
import math
from typing import NamedTuple

import numpy as np

from dp_swing_ros.evaluation.campaign.rows import grouped, Row
from dp_swing_ros.evaluation.metrics import Metrics, reduced
from dp_swing_ros.evaluation.scenarios import SCENARIOS

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


def performance(metrics: Metrics) -> float:
    """Return the performance score of a run."""
    if not metrics.success:
        return 0.0
    costs = [math.tanh(math.pi * getattr(metrics, name) / norm) for name, norm in NORMS.items()]
    return 1 - sum(costs) / len(costs)


def levels(rows: Iterable[Row]) -> dict[str, list[Level]]:
    """Return the levels of a contestant in one scenario, in order, by what is swept."""
    swept = grouped((row for row in rows if row.key.level is not None),
                    lambda row: row.key.parameter)
    return {parameter: [Level(value, sum(row.metrics.success for row in runs), len(runs))
                        for value, runs in sorted(grouped(of, _level).items())]
            for parameter, of in swept.items()}


def _level(row: Row) -> float:
    return row.key.level or 0.0


def passed_fraction(rows: Sequence[Row]) -> float:
    """Return the share of levels that pass, of all that is swept together."""
    return float(np.mean([level.passed for swept in levels(rows).values() for level in swept]))


def robustness(fractions: Mapping[str, float]) -> float:
    """Return the mean over the six criteria, NaN where one is missing."""
    return float(np.mean([fractions.get(name, math.nan) for name in CRITERIA]))


class Score(NamedTuple):
    """The scores of a contestant; NaN where their scenarios were not run."""

    contestant: str
    performance: float
    robustness: float
    criteria: dict[str, float]


def score(contestant: str, groups: Mapping[tuple[str, str], Sequence[Row]]) -> Score:
    """Score a contestant on its rows, by contestant and scenario, of the scenarios that ran."""
    runs = [performance(row.metrics) for row in groups.get((contestant, SCORED), ())]
    criteria = {name: passed_fraction(groups[contestant, name]) for name in CRITERIA
                if (contestant, name) in groups}
    return Score(contestant, reduced(np.mean, np.array(runs)), robustness(criteria), criteria)
