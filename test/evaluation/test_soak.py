# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The figures of a soak, of samples that are made up."""

from collections import Counter
import dataclasses
import json
import math

import numpy as np
import pytest
from synthetic import soaked

from dp_swing_ros.evaluation import soak
from dp_swing_ros.evaluation.soak import before, Forces, match, quantiles, Usage

PERIOD = 0.05


def with_times(latency=(), echo=(), **others):
    """Return a soak of twelve states with other latencies [s] at some places, from the first."""
    usual = soaked(count=12)
    columns = {'latency': usual.latency.copy(), 'echo': usual.echo.copy()}
    for name, values in (('latency', latency), ('echo', echo)):
        for place, value in dict(values).items():
            columns[name][place] = value
    return dataclasses.replace(usual, **columns, **others)


def test_answers_are_matched_by_the_stamp_and_the_first_counts():
    stamps, sent = np.array([10, 20, 30, 40]), np.array([1000, 2000, 3000, 4000])
    answered, answers = np.array([30, 10, 10, 40, 40]), np.array([3500, 1100, 1900, 4200, 9999])
    np.testing.assert_allclose(match(stamps, sent, answered, answers),
                               np.array([100, math.nan, 500, 200]) / 1e9)


def test_without_answers_every_latency_is_unknown():
    none = np.array([], dtype=int)
    assert np.isnan(match(np.array([1, 2]), np.array([5, 6]), none, none)).all()


def test_the_force_is_the_last_before_its_stamped_copy():
    found = before(np.array([5, 10, 11, 30]), np.array([9, 10, 25]))
    assert found.tolist() == [5, 10, 10, 25]


def test_quantiles_are_in_milliseconds_and_of_what_is_known():
    times = np.append(np.arange(1, 1001) / 1e3, math.nan)
    found = quantiles(times)
    assert found['count'] == 1000
    assert [found[name] for name in ('p50', 'p99', 'p99.9', 'max')] == pytest.approx(
        [500.5, 990.01, 999.001, 1000.0])
    assert math.isnan(quantiles(np.array([math.nan]))['p99'])


def test_states_are_answered_in_time_late_or_never():
    found = soak.answers(with_times({2: PERIOD + 1e-3, 3: math.nan, 11: PERIOD + 1e-3},
                                    {5: math.nan}))
    assert found['mpc'] == {'states': 12, 'answered in time': 9, 'late': 2, 'late by itself': 2,
                            'unanswered': 1}
    assert found['echo']['unanswered'] == 1
    assert found['echo']['answered in time'] == 11


@pytest.mark.parametrize('echo, by_itself', [
    ({}, True), ({5: 0.012}, False), ({4: 0.012}, False), ({6: 0.012}, False),
    ({7: 0.012}, True), ({5: 0.010}, True), ({5: math.nan}, False)])
def test_a_late_answer_is_the_machine_s_where_the_echo_lost_as_much(echo, by_itself):
    """It is 10 ms too late; the echo usually takes 1 ms."""
    found = with_times({5: PERIOD + 0.010}, echo)
    assert np.flatnonzero(found.late).tolist() == [5]
    assert found.late_by_itself.tolist() == [n == 5 and by_itself for n in range(12)]


def test_a_late_state_leaves_less_time_which_is_the_machine_s_doing():
    t = soaked(count=12).t
    t[5] += 0.02
    found = with_times({5: 0.04}, t=t)
    assert np.flatnonzero(found.late).tolist() == [5]
    assert not found.late_by_itself.any()


def test_the_pendulum_is_judged_from_its_swing_up_on():
    found = soaked(count=400)
    assert found.success
    assert found.swung_up == pytest.approx(2.0)
    deviation = found.deviation.copy()
    deviation[200:210] = 0.3
    t = found.t + np.where(np.arange(400) > 205, PERIOD, 0.0)   # a state was skipped
    leaning = dataclasses.replace(found, deviation=deviation, t=t)
    assert leaning.success
    assert soak.pendulum(leaning) == {
        'up after [s]': pytest.approx(2.0), 'largest angle since [rad]': pytest.approx(0.3),
        'out of 0.2 rad [s]': pytest.approx(0.55), 'falls': 0}
    deviation[205] = 3.0
    fallen = dataclasses.replace(found, deviation=deviation)
    assert (fallen.success, fallen.falls) == (False, 1)
    deviation[205:] = 3.0
    assert dataclasses.replace(found, deviation=deviation).falls == 1


@pytest.mark.parametrize('count, swung_up', [(59, None), (61, 2.0), (400, 2.0)])
def test_to_be_up_takes_a_second(count, swung_up):
    found = soaked(count)
    found.deviation[10:25] = 0.1   # in passing
    assert found.swung_up == pytest.approx(swung_up) if swung_up else math.isnan(found.swung_up)


@pytest.mark.parametrize('change', [
    {'failure': 'mpc ended'}, {'forces': Forces(5, 1, 0, 20.0)}, {'forces': Forces(5, 0, 1, 21.0)},
    {'deviation': np.full(400, 3.0)}, {'deviation': np.append(np.zeros(399), 0.3)}])
def test_whoever_fails_falls_or_pushes_too_hard_has_no_success(change):
    found = dataclasses.replace(soaked(count=400), **change)
    assert not found.success


def usage(duration, grown):
    t = np.arange(0.0, duration)
    memory = 1e8 + np.where(t > 70, grown, 0.0) + np.where(t < 60, -3e7, 0.0)
    return Usage(t, memory, 0.5 * memory, 0.25 * t)


@pytest.mark.parametrize('duration, growth', [(600.0, 2e6), (79.0, 2e6), (77.0, None)])
def test_memory_grows_from_the_first_minute_on(duration, growth):
    found = usage(duration, 2e6)
    assert found.growth == growth if growth else math.isnan(found.growth)
    assert found.share == pytest.approx(0.25)


def test_of_a_process_that_was_never_seen_nothing_is_known():
    nothing = Usage(*[np.array([])] * 4)
    assert math.isnan(nothing.growth) and math.isnan(nothing.share)


def test_ticks_without_a_solve_are_counted():
    found = dataclasses.replace(
        soaked(count=12), statuses=Counter(CONVERGED=9, LAST_POLICY=2, ZERO=1, FEEDBACK=4))
    assert soak.ticks(found)['of the mpc'] == 16
    assert soak.ticks(found)['without a solve'] == 3


def test_the_bound_is_made_of_echo_and_solve():
    found = with_times()
    assert found.bound == pytest.approx(1e-3 + 2e-3 + 1e-3)


def test_the_summary_is_plain():
    assert json.loads(json.dumps(soak.summary(with_times())))['answers']['mpc']['states'] == 12
