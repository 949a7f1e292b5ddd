# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import dataclasses
import math

import numpy as np
import pytest
from synthetic import first, PERIOD, swing_up, without_ticks

from dp_swing_ros.metrics import (
    measure, settling_time, spread, summary, table, wilson)


def with_state(episode, place, values):
    X = episode.X.copy()
    X[place] = values
    return dataclasses.replace(episode, X=X)


def test_swing_up_is_a_success_that_settles_before_the_rise_ends():
    metrics = measure(swing_up())
    assert metrics.success
    assert 1.5 < metrics.settling_time < 2.0
    assert metrics.states == 81
    assert metrics.ticks == 80
    assert metrics.duration == pytest.approx(4.0)
    assert metrics.late_ticks == 0
    assert metrics.hold_error == pytest.approx(0.0, abs=1e-9)


def test_what_is_largest_counts_either_way():
    episode = with_state(swing_up(), 3, [-1.7, 0, 0, 0, 0, 0])
    episode.U[5] = -19.5
    metrics = measure(dataclasses.replace(episode, U=np.clip(episode.U, -19.5, 19.0)))
    assert metrics.largest_position == 1.7
    assert metrics.largest_force == 19.5


@pytest.mark.parametrize('state', [
    [0, 0.11, 0, 0, 0, 0], [0, 0, -0.11, 0, 0, 0],
    [0, 0, 0, 1.1, 0, 0], [0, 0, 0, 0, -1.1, 0], [0, 0, 0, 0, 0, 1.1], [0, math.nan, 0, 0, 0, 0]])
def test_one_fallen_state_moves_the_settling_time_behind_it(state):
    episode = with_state(swing_up(), 50, state)
    assert measure(episode).settling_time == pytest.approx(51 * PERIOD)


def test_whole_turns_are_upright():
    assert measure(with_state(swing_up(), 50, [2, 4 * np.pi, -2 * np.pi, 0, 0, 0])).success


def test_falling_at_the_end_is_no_success():
    metrics = measure(with_state(swing_up(), -1, [0, 0.2, 0, 0, 0, 0]))
    assert not metrics.success
    assert math.isnan(metrics.settling_time)


def test_passing_by_upright_at_the_end_is_no_success():
    assert not measure(first(swing_up(rise=2.0), 45)).success


def test_a_run_that_starts_upright_settles_at_once():
    episode = swing_up()
    assert settling_time(episode.t[:5], np.zeros((5, 6))) == 0.0


def test_hold_error_is_that_of_both_angles_in_the_last_two_seconds():
    episode = swing_up()
    X = episode.X.copy()
    X[-41:, 1] = 0.03
    X[-41:, 2] = 2 * np.pi - 0.04
    metrics = measure(dataclasses.replace(episode, X=X))
    assert metrics.hold_error == pytest.approx(math.sqrt((0.03 ** 2 + 0.04 ** 2) / 2))


def test_smoothness_is_the_spread_of_the_steps_of_the_force():
    episode = swing_up()
    forces = np.where(np.arange(80) % 2, 1.0, -1.0)
    assert measure(dataclasses.replace(episode, U=np.full(80, 7.0))).smoothness == 0.0
    assert measure(dataclasses.replace(episode, U=forces)).smoothness == pytest.approx(2, rel=1e-2)


def test_times_of_the_solver_are_quantiles():
    metrics = measure(swing_up())
    assert metrics.median_solve_time == pytest.approx(0.002)
    assert metrics.p99_solve_time == pytest.approx(0.00298)
    assert metrics.largest_solve_time == pytest.approx(0.003)
    assert metrics.median_latency == pytest.approx(0.003)
    assert metrics.p99_latency == pytest.approx(0.00398)


def test_late_ticks_are_counted():
    episode = swing_up()
    episode.ticks.late[[3, 7]] = True
    assert measure(episode).late_ticks == 2


def test_latencies_that_are_unknown_are_left_out():
    episode = swing_up()
    episode.ticks.latency[:] = math.nan
    episode.ticks.latency[4] = 0.006
    assert measure(episode).p99_latency == 0.006


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('states', [0, 1, 2, 3])
def test_short_runs_are_measured(states):
    metrics = measure(first(swing_up(), states))
    assert not metrics.success
    assert metrics.states == states


@pytest.mark.filterwarnings('error')
def test_runs_without_a_controller_are_measured():
    metrics = measure(without_ticks(swing_up()))
    assert metrics.ticks == 0
    assert math.isnan(metrics.median_solve_time)


def test_table_has_a_column_a_run_and_a_row_a_metric():
    metrics = measure(swing_up())
    failed = measure(first(swing_up(), 10))
    lines = table({'good': metrics, 'bad': failed}).splitlines()
    assert len(lines) == 2 + len(dataclasses.fields(metrics))
    assert len({len(line) for line in lines}) == 1
    assert all(line.count('|') == 5 for line in lines)
    cells = {line.split('|')[1].strip(): [cell.strip() for cell in line.split('|')[2:-1]]
             for line in lines}
    assert cells['upright to the end'] == ['', 'yes', 'no']
    assert cells['settling time'] == ['s', f'{metrics.settling_time:.2f}', '-']
    assert cells['solve time, median'] == ['ms', '2.00', f'{1e3 * failed.median_solve_time:.2f}']


def test_wilson_interval_is_the_textbook_s():
    """Agresti and Coull, The American Statistician 52 (1998), give 0 of 10 as 0 to 0.278."""
    assert wilson(0, 10) == pytest.approx((0.0, 0.2775), abs=1e-4)
    assert wilson(5, 5)[1] == 1.0
    assert wilson(5, 5)[0] == pytest.approx(0.5655, abs=1e-4)


def test_spread_is_that_of_the_runs_that_tell():
    good = measure(swing_up())
    fell = dataclasses.replace(good, success=False, settling_time=math.nan, largest_force=30.0)
    columns = spread([good, fell, good])
    assert list(columns) == ['smallest', 'median', 'largest']
    assert columns['largest'].largest_force == 30.0
    assert columns['median'].settling_time == good.settling_time
    assert not columns['smallest'].success
    assert columns['smallest'].ticks == good.ticks


def test_summary_names_successes_late_ticks_and_the_worst_median():
    good = measure(swing_up())
    slow = dataclasses.replace(good, success=False, late_ticks=3, median_solve_time=0.0123)
    text = summary('mppi', [good, good, slow])
    assert 'mppi: upright in 2 of 3 runs' in text
    assert '21-94 %' in text
    assert 'late ticks 3' in text
    assert '12.30 ms' in text
