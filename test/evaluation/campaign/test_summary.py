# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
import json
import math

import numpy as np
import pytest
from results import campaign, error_row, row

from dp_swing_ros.evaluation.campaign.report import compared, markdown
from dp_swing_ros.evaluation.campaign.rows import CampaignError
from dp_swing_ros.evaluation.campaign.summary import (
    common, duel, plain, rivals, standing, summarise, why)
from dp_swing_ros.evaluation.metrics import Outcome


def test_standing_takes_medians_of_what_was_held_and_extremes_of_all():
    rows = [row(settling_time=1.0, energy=1.0, largest_position=1.0),
            row(settling_time=3.0, energy=3.0),
            row(held=False, energy=9.0, largest_position=2.4, deadline_misses=2), error_row()]
    one = standing('ilqr', 'hanging', rows)
    assert (one.held.successes, one.held.runs, one.errors) == (2, 4, 1)
    assert (one.medians['settling_time'], one.medians['energy']) == (2.0, 2.0)
    assert one.extremes['largest_position'] == 2.4
    assert one.deadline_misses == 2


def test_solve_times_are_pooled_over_all_solves():
    rows = [row(solve_times=np.full(99, 0.001)), row(solve_times=(0.5,))]
    one = standing('ilqr', 'hanging', rows)
    assert one.solves == 100
    assert one.solve_time['median'] == 0.001
    assert 0.001 < one.solve_time['p99'] < 0.5
    assert one.solve_time['largest'] == 0.5


def test_who_drops_the_pendulum_near_the_goal_is_counted():
    rows = [row('ilqr', 'near_goal', seed, largest_angle=angle)
            for seed, angle in enumerate((0.2, 0.41, 3.1, 0.4))]
    assert standing('ilqr', 'near_goal', [*rows, error_row(seed=9)]).dropped == [1, 2, 9]
    assert standing('ilqr', 'hanging', rows).dropped == []
    page = markdown(summarise(campaign(scenarios=('near_goal',)), rows, 4))
    assert 'Went beyond ±0.4 rad: `ilqr` 2 of 4 (seeds 1-2).' in page


def test_a_duel_is_over_the_same_cases():
    first = [row('ilqr', seed=seed, held=seed != 3, settling_time=2.0) for seed in range(6)]
    second = [row('mppi', seed=seed, held=seed not in (0, 1), settling_time=2.5)
              for seed in range(1, 7)]
    one = duel('hanging', 'ilqr', 'mppi', common(first, second))
    assert one.cases == 5
    assert (one.first_only, one.second_only) == (1, 1)
    assert one.p == 1.0
    settling = one.differences['settling_time']
    assert (settling.pairs, settling.median) == (3, -0.5)


def test_why_an_episode_was_not_held():
    assert why(row(held=False)) == Outcome.NEVER_UP.value
    assert 'end stop' in why(row(held=False, strikes=3))
    assert why(error_row()) == 'ValueError: no, "never"'


def test_a_summary_has_every_failure_and_what_is_missing():
    rows = [row('mppi', seed=1), row('ilqr', seed=1, held=False), row('ilqr', seed=0),
            error_row('mppi', seed=0)]
    summary = summarise(campaign(), rows, expected=6)
    assert (summary.episodes, summary.missing) == (4, 2)
    assert [one.contestant for one in summary.standings] == ['ilqr', 'mppi']
    assert [(one.contestant, one.seed) for one in summary.failures] == [('ilqr', 1), ('mppi', 0)]
    assert [(one.first, one.second, one.cases) for one in summary.duels] == [('ilqr', 'mppi', 2)]


def test_scores_are_those_of_their_scenarios():
    rows = [row('ilqr', seed=seed, held=seed < 2) for seed in range(4)] + [
        row('ilqr', 'delay', parameter='delay', level=level, held=level < 0.1)
        for level in (0.0, 0.05, 0.1, 0.15)]
    score, other = summarise(campaign(scenarios=('hanging', 'delay')), rows, 8).scores
    assert 0.0 < score.performance < 0.5
    assert score.criteria == {'delay': 0.5}
    assert math.isnan(score.robustness)
    assert math.isnan(other.performance)


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('rows', [[], [error_row()], [row()], [row(held=False)]])
def test_what_is_plain_is_strict_json(rows):
    summary = plain(summarise(campaign(), rows, 5))
    text = json.dumps(summary, allow_nan=False)
    assert json.loads(text)['missing'] == 5 - len(rows)


def test_episodes_are_compared_with_those_of_the_same_seed():
    stored = [row(seed=seed, held=seed != 1, settling_time=2.0, closed_loop_cost=200.0)
              for seed in range(6)]
    now = [row(seed=seed, held=seed not in (2, 3), settling_time=2.5, closed_loop_cost=100.0)
           for seed in range(5)]
    (duel, equal), = rivals([*now, row(seed=9)], [*stored, row('mppi', seed=0)])
    assert (duel.first, duel.scenario, duel.cases) == ('ilqr', 'hanging', 5)
    assert (duel.first_only, duel.second_only, duel.p) == (1, 2, 1.0)
    settling = duel.differences['settling_time']
    assert (settling.pairs, settling.median) == (2, 0.5)
    assert duel.cost.value == pytest.approx(0.5)
    assert equal == 0
    assert '| hanging | `ilqr` | 5 | 0 | 1 | 2 | 1.000 | +0.5 (+0.5 to +0.5)' in compared(
        'there', [(duel, equal)])


def test_what_is_equal_to_the_bit_is_counted():
    rows = [row(seed=seed, level=level, parameter='delay', scenario='delay')
            for seed in range(2) for level in (0.0, 0.1)]
    changed = row(seed=1, level=0.1, parameter='delay', scenario='delay', energy=1e-300)
    (duel, equal), = rivals([*rows[:3], changed], rows)
    assert (duel.cases, equal) == (4, 3)


def test_nothing_in_common_is_refused():
    with pytest.raises(CampaignError, match='stored are mppi in hanging'):
        rivals([row()], [row('mppi')])
