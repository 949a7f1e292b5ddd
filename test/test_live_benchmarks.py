# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is done to running nodes by the hundred for docs/results, here a few times."""

from itertools import pairwise, permutations
import json
import math

import live_busy
import live_changes
import live_faults
from live_operator import Operator
import live_rates
import live_soak
import numpy as np
import pandas as pd
import pytest

from dp_swing_ros.control import controllers
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.state import equilibria
from dp_swing_ros.tools.processes import Crew, isolated


def full(values):
    """Return parameters by their full names."""
    return {name.replace('__', '.'): value for name, value in values.items()}


@pytest.mark.parametrize('name', sorted(live_changes.CHANGES))
def test_each_change_is_one_that_an_mpc_can_take(name, rng):
    drawn = [live_changes.CHANGES[name](rng) for _ in range(20)]
    assert len(set(map(str, drawn))) > 1
    for value in drawn:
        controllers.controller(full({name: value}))


@pytest.mark.parametrize('values', live_changes.WRONG, ids=str)
def test_each_wrong_change_is_wrong(values):
    """But for those that are wrong while it runs alone."""
    if not set(values) & {'links', 'clock'}:
        with pytest.raises(ParameterError):
            controllers.controller(full(values))


def test_the_tour_goes_each_way_once():
    places = live_changes.circuit(list(equilibria()))
    assert sorted(pairwise(places)) == sorted(permutations(equilibria(), 2))


def test_what_is_not_held_at_the_end_of_a_way_has_not_settled():
    t, X = np.arange(0, 7, 0.05), np.tile(equilibria()['up_down'], (140, 1))
    X[:60, 1] = 1.0
    assert live_changes.settled(t, X, 'up_down') == pytest.approx(3.0)
    assert math.isnan(live_changes.settled(t, X, 'up_up'))
    X[-10:, 2] += 0.2
    assert math.isnan(live_changes.settled(t, X, 'up_down'))


def test_pages_say_what_was_missed():
    changed = pd.DataFrame([{'asked': 10, **live_changes.Changed(
        'ilqr', 9, 10, 10, 0.12, 1, 0, 19, 1.5, 60.0)._asdict()}])
    legs = pd.DataFrame([
        {'solver': 'ilqr', 'way': 'up_up to down_up', 'began': 1.0, 'settled': settled, 'late': 2,
         'skipped': 0} for settled in (2.5, math.nan)])
    text = live_changes.page(changed, legs, 'made\n')
    assert '| `ilqr` | 9 of 10 | 10 of 10 | 10 of 10 | 0.1200 | 1 | 0 | 1.5 | 60 |' in text
    assert '`ilqr` 1 of 2, late ticks 2' in text
    rows = pd.DataFrame([live_faults.Recovery('ddp', 'plant reset', run, largest, again, 0, 1)
                         for run, largest, again in ((0, 0.1, 0.0), (1, 3.1, math.nan))])
    assert '| plant reset | `ddp` | 1 of 2 (9.5-90.5 %) | 1 | 0.0 | - | 3.10 | 0 | 2 |' in (
        live_faults.page(rows, 'made\n'))


def rows_of(runs, **values):
    """Return the rows of runs that went alike."""
    row = {'in_time': 95, 'states': 100, 'late': 5, 'late_by_itself': 1, 'unanswered': 0,
           'late_total': 0, 'success': True, 'mpc_p50': 1.0, 'mpc_p99': 5.0, 'echo_p99': 2.0,
           'solve_p99': 1.5, 'bound': 4.5, 'mpc_share': 50.0, 'plant_share': 20.0,
           'echo_share': 10.0, 'echo_in_time': 99, 'largest': 0.05, **values}
    return pd.DataFrame([{**run._asdict(), **row} for run in runs])


def test_the_page_of_rates_says_what_was_met_and_missed():
    rows = rows_of(live_rates.runs())
    rows.loc[(rows.rate > 300) & (rows.solver == 'mppi'), 'in_time'] = 94
    text = live_rates.page(rows, 'made\n')
    assert ('| `ddp` | 500 | 50 | 3 of 3 | 95.00 % | 99.00 % | 1.00 | 5.00 | 50 | 20 | 10 |'
            in text)
    assert 'without a priority: `ilqr` 500 Hz, `ddp` 500 Hz, `mppi` 300 Hz.' in text
    rows.loc[rows.solver == 'ddp', 'in_time'] = 90
    assert '`ilqr` 500 Hz, `ddp` none, `mppi` 300 Hz.' in live_rates.page(rows, 'made\n')


def test_the_page_of_busy_cores_says_who_was_held():
    rows = rows_of(live_busy.runs())
    rows.loc[rows.solver.eq('mppi') & rows.seed.eq(2), 'success'] = False
    text = live_busy.page(rows, 'made\n')
    assert '| `ilqr` | 3 of 3 (43.9-100.0 %) | 0 | 95.00 % | 5.0 | 0.05 |' in text
    assert '| `mppi` | 2 of 3 (20.8-93.9 %) | 0 | 95.00 % | 5.0 | 0.05 |' in text


@pytest.mark.real_time
def test_a_few_changes_are_taken_in_time(tmp_path):
    with isolated():
        found = live_changes.changes('ilqr', tmp_path / 'run', count=2)
    assert (found.changes, found.switches, found.refused, found.revisions) == (2, 2, 2, 4)
    assert found.largest < 0.2 and found.late == 0


@pytest.mark.real_time
def test_states_of_nan_are_survived(tmp_path):
    with isolated(), Crew() as crew, Operator() as operator:
        bench = live_faults.Bench(crew, operator, 'ilqr', tmp_path)
        found = live_faults.befall(bench, 'states of NaN, 0.3 s', 0, 20.0)
    assert found.again <= live_faults.ALLOWED
    assert (found.not_finite, found.beyond) == (0, 0)


@pytest.mark.real_time
def test_a_short_soak_makes_the_page(tmp_path):
    live_soak.main(['--duration', '6', '--docs', str(tmp_path)])
    text = (tmp_path / 'results' / 'live_soak.md').read_text()
    assert '`ilqr` was up to the end' in text
    assert (tmp_path / 'figures' / 'live_soak.png').stat().st_size > 10_000
    summary = json.loads((tmp_path / 'results' / 'live_soak.json').read_text())
    assert summary['answers']['mpc']['states'] == pytest.approx(120, abs=10)
