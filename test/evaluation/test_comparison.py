# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import dataclasses
import math

import numpy as np
import pytest
from synthetic import first, swing_up

from dp_swing_ros.evaluation.comparison import (
    median, paired, paired_ratio, rate, rows, same_held, sign_test, spread, summary, table)
from dp_swing_ros.evaluation.metrics import measure


def test_table_has_a_column_a_run_and_a_row_a_metric():
    metrics = measure(swing_up())
    failed = measure(first(swing_up(), 10))
    lines = table({'good': metrics, 'bad': failed}).splitlines()
    assert len(lines) == 2 + len(dataclasses.fields(metrics))
    assert len({len(line) for line in lines}) == 1
    assert all(line.count('|') == 5 for line in lines)
    cells = {line.split('|')[1].strip(): [cell.strip() for cell in line.split('|')[2:-1]]
             for line in lines}
    assert cells['upright to the end, no strike'] == ['', 'yes', 'no']
    assert cells['settling time'] == ['s', f'{metrics.settling_time:.2f}', '-']
    assert cells['solve time, median'] == ['ms', '2.00', f'{1e3 * failed.median_solve_time:.2f}']


@pytest.mark.parametrize('drives, largest, over_time, squared, energy', [
    (['force'], ['largest force u', 'N'], 'N s', 'N² s', ['J']),
    (['voltage'], ['largest force u', 'N'], 'N s', 'N² s', ['J']),
    (['acceleration', 'velocity'], ['largest acceleration u', 'm/s²'], 'm/s', 'm²/s³', []),
    (['force', 'velocity'], ['largest force or acceleration u', 'N or m/s²'], 'N s or m/s',
     'N² s or m²/s³', ['J'])])
def test_units_are_those_of_what_acts(drives, largest, over_time, squared, energy):
    found = rows([measure(swing_up())] * len(drives), drives)
    assert found['largest_force'][:2] == largest
    assert found['impulse'][1] == over_time and found['squared_force'][1] == squared
    assert [found[name][1] for name in found if name == 'energy'] == energy
    assert found['smoothness'][1] == found['roughness'][1] == largest[1]
    assert found['largest_position'][1] == 'm'


def test_rate_counts_successes():
    assert rate([True, False, True])[:2] == (2, 3)
    assert math.isnan(rate([]).low)


def test_the_interval_of_a_median_is_that_of_95_percent(rng):
    covered = 0
    for _ in range(100):
        found = median(np.append(rng.exponential(1.0, 40), math.nan))
        covered += found.low <= math.log(2) <= found.high
        assert found.runs == 40
    assert 88 <= covered <= 100


def test_paired_differences_leave_out_what_one_does_not_know():
    a, b = np.array([2.0, 3.0, math.nan, 5.0, 1.0]), np.array([1.0, 2.5, 1.0, 4.0, math.nan])
    compared = paired(a, b)
    assert (compared.pairs, compared.median) == (3, 1.0)
    assert compared.low <= 1.0 <= compared.high
    assert compared.p == pytest.approx(0.25)


def test_interval_of_a_paired_difference_covers_it(rng):
    covered = 0
    for _ in range(40):
        b = rng.normal(0.0, 3.0, 60)
        compared = paired(b + rng.normal(0.5, 1.0, 60), b)
        covered += compared.low <= 0.5 <= compared.high
    assert covered >= 35


def test_pairs_that_are_equal_speak_for_neither():
    assert paired(np.array([2.0, 3.0, 4.0, 1.0, 1.0]), np.ones(5)).p == sign_test(3, 0)


@pytest.mark.parametrize('values', [[], [1.0], [math.nan, math.nan]])
def test_too_few_pairs_have_no_interval(values):
    assert math.isnan(paired(np.array(values), np.zeros(len(values))).low)


def test_a_paired_ratio_is_that_of_the_cases_whatever_their_size(rng):
    b = np.append(np.exp(rng.normal(0, 3, 60)), math.nan)
    found = paired_ratio(0.9 * b * np.exp(rng.normal(0, 0.1, 61)), b)
    assert found.pairs == 60
    assert found.low < 0.9 < found.high < found.low + 0.1
    assert paired_ratio(b, b)[1:] == (1.0, 1.0, 1.0, 0.0)
    assert math.isnan(paired_ratio(b[:1], b[:1]).low)


def test_equivalence_is_shown_by_many_close_pairs_and_not_by_few(rng):
    """A large p of a test for a difference shows nothing; this one has to be small."""
    close = np.exp(rng.normal(0, 0.2, 1000))
    assert paired_ratio(close, np.ones(1000)).same < 1e-3
    assert paired_ratio(close[:10], np.ones(10)).same > 0.05
    assert paired_ratio(1.1 * close, np.ones(1000)).same > 0.5
    assert paired_ratio(np.full(3, 1.06), np.ones(3)).same == 1.0


def test_the_equivalence_of_costs_is_rejected_at_its_edge_in_one_of_twenty(rng):
    p = [paired_ratio(1.05 * np.exp(rng.normal(0, 0.1, 50)), np.ones(50)).same
         for _ in range(400)]
    assert 0.02 < np.mean(np.array(p) < 0.05) < 0.09


def test_the_same_is_held_where_few_of_many_cases_differ():
    """Rule of three: none of n shows less than 3 / n with 95 %."""
    assert same_held(0, 0, 300) < 0.05 < same_held(0, 0, 295)
    assert same_held(2, 3, 1000) < 0.05 < same_held(2, 30, 1000)
    assert math.isnan(same_held(0, 0, 0))


def test_the_interval_of_a_ratio_is_that_of_95_percent(rng):
    a = np.exp(rng.normal(0, 0.1, 200))
    found = paired_ratio(a, np.ones(200))
    assert math.log(found.high / found.low) == pytest.approx(
        2 * 1.96 * np.std(np.log(a)) / math.sqrt(200), rel=0.05)


def test_sign_test_counts_what_is_as_unequal():
    """Of the 2 ** 9 ways that nine coins fall, 2 * (9 + 1) are at least as unequal as 8 to 1."""
    assert sign_test(8, 1) == pytest.approx(20 / 512)
    assert sign_test(0, 0) == 1.0


def test_wilson_interval_is_the_textbook_s():
    """Agresti and Coull, The American Statistician 52 (1998), give 0 of 10 as 0 to 0.278."""
    assert rate([False] * 10)[2:] == pytest.approx((0.0, 0.2775), abs=1e-4)
    assert rate([True] * 5).high == 1.0
    assert rate([True] * 5).low == pytest.approx(0.5655, abs=1e-4)


def test_spread_is_that_of_the_values_that_are_known():
    good = measure(swing_up())
    fell = dataclasses.replace(good, success=False, settling_time=math.nan, largest_force=30.0)
    columns = spread([good, fell, good])
    assert list(columns) == ['smallest', 'median', 'largest']
    assert columns['largest'].largest_force == 30.0
    assert columns['median'].settling_time == good.settling_time
    assert not columns['smallest'].success
    assert columns['smallest'].ticks == good.ticks
    assert columns['median'].success
    assert spread([good, fell])['median'].success is False   # as many are held as are not
    more = dataclasses.replace(good, ticks=good.ticks + 3)
    assert spread([good, more, more])['median'].ticks == more.ticks


def test_summary_names_successes_late_ticks_and_the_worst_median():
    good = measure(swing_up())
    slow = dataclasses.replace(good, success=False, late_ticks=3, median_solve_time=0.0123)
    text = summary('mppi', [good, good, slow])
    assert 'mppi: upright in 2 of 3 runs' in text
    assert '21-94 %' in text
    assert 'late ticks 3' in text
    assert '12.30 ms' in text
    unsolved = dataclasses.replace(good, median_solve_time=math.nan)
    assert '12.30 ms' in summary('mppi', [unsolved, slow])   # whichever comes first
    assert summary('nothing', [unsolved]).endswith('median solve - ms')
