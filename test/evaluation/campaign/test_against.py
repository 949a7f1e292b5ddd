# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
import pytest
from results import row

from dp_swing_ros.evaluation.campaign.against import compared, rivals
from dp_swing_ros.evaluation.campaign.rows import CampaignError


def test_episodes_are_compared_with_those_of_the_same_seed():
    stored = [row(seed=seed, held=seed != 1, settling_time=2.0, closed_loop_cost=200.0)
              for seed in range(6)]
    now = [row(seed=seed, held=seed not in (2, 3), settling_time=2.5, closed_loop_cost=100.0)
           for seed in range(5)]
    one, = rivals([*now, row(seed=9)], [*stored, row('mppi', seed=0)])
    duel = one.duel
    assert (duel.first, duel.scenario, duel.cases) == ('ilqr', 'hanging', 5)
    assert (duel.first_only, duel.second_only, duel.p) == (1, 2, 1.0)
    settling = duel.differences['settling_time']
    assert (settling.pairs, settling.median) == (2, 0.5)
    assert duel.cost.value == pytest.approx(0.5)
    assert one.identical == 0
    assert '| hanging | `ilqr` | 5 | 0 | 1 | 2 | 1.000 | +0.5 (+0.5 to +0.5)' in compared(
        'there', [one])


def test_what_is_equal_to_the_bit_is_counted():
    rows = [row(seed=seed, level=level, parameter='delay', scenario='delay')
            for seed in range(2) for level in (0.0, 0.1)]
    changed = row(seed=1, level=0.1, parameter='delay', scenario='delay', energy=1e-300)
    one, = rivals([*rows[:3], changed], rows)
    assert (one.duel.cases, one.identical) == (4, 3)


def test_nothing_in_common_is_refused():
    with pytest.raises(CampaignError, match='stored are mppi in hanging'):
        rivals([row()], [row('mppi')])
