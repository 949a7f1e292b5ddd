# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The figures of a soak, of samples that are made up, and a short one."""

from collections import Counter
from contextlib import nullcontext
import dataclasses
import json
import math
import os
import signal

import numpy as np
import pytest
from resources import Resources, Usage
import soak
from soak import before, Forces, match, quantiles, Soak
from soak_figures import binned, BINS, draw

from dp_swing_ros.tools.processes import isolated

PERIOD = 0.05   # [s]


def soaked(count: int, rise: float = 2.0) -> Soak:
    """Return a soak of so many states, hanging for `rise` seconds, in which nothing is late."""
    t = PERIOD * np.arange(count)
    seen = np.arange(0.0, t[-1], 1.0)
    usage = Usage(seen, np.full(len(seen), 2e8), np.full(len(seen), 1e8), 0.1 * seen)
    return Soak(
        solver='ddp', period=PERIOD, t=t, latency=np.full(count, 0.004),
        echo=np.full(count, 0.001), deviation=np.where(t < rise - PERIOD / 2, np.pi, 0.01),
        solve_time=np.full(count, 0.002), statuses=Counter(CONVERGED=count), late_total=0,
        skipped_ticks=0, forces=Forces(count + 1, 0, 0, 20.0), missed=0,
        usage=dict.fromkeys(('plant', 'mpc', 'echo', 'watcher'), usage))


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


def of_label(axes, label):
    line, = [line for line in axes.lines if line.get_label() == label]
    return line


def test_answers_are_drawn_by_their_share_and_over_time():
    found = soaked(100)
    found.latency[3] = 0.07
    distribution, latency, memory, deviation = draw(found).axes
    curve = of_label(distribution, 'state to force')
    assert curve.get_xdata().tolist() == pytest.approx([4.0] * 99 + [70.0])
    assert curve.get_ydata()[[0, -1]] == pytest.approx([1.0, 0.01])
    np.testing.assert_allclose(of_label(latency, 'state to force').get_ydata(),
                               1e3 * found.latency)
    assert of_label(latency, 'late (1, 1 by itself)').get_xydata().tolist() == [
        pytest.approx([found.t[3], 70.0])]
    assert [line.get_label() for line in memory.lines] == [
        f'{name} (200 MB)' for name in ('plant', 'mpc', 'echo')]
    assert deviation.lines[0].get_ydata().tolist() == pytest.approx(found.deviation)


def test_of_many_the_largest_of_each_bin_is_drawn():
    t, values = np.arange(10.0 * BINS), np.zeros(10 * BINS)
    values[17], values[30:40] = 5.0, math.nan
    at, largest = binned(t, values)
    assert at[:4].tolist() == [0.0, 10.0, 20.0, 30.0]
    assert largest[:3].tolist() == [0.0, 5.0, 0.0]
    assert math.isnan(largest[3])


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize('change', [
    {'latency': np.full(100, math.nan), 'solve_time': np.array([])},
    {'usage': {'mpc': Usage(*[np.array([])] * 4)}}, {'deviation': np.zeros(100)}],
    ids=['no answer', 'unseen', 'exact'])
def test_odd_soaks_are_drawn_without_a_warning(change, tmp_path):
    draw(dataclasses.replace(soaked(100), **change)).savefig(tmp_path / 'soak.png', dpi=30)


@pytest.fixture
def patient(monkeypatch):
    """Let a busy machine take longer."""
    monkeypatch.setattr('dp_swing_ros.tools.processes.GRACE', 120.0)
    monkeypatch.setattr(soak, 'SILENCE', 120.0)


def test_a_soak_counts_every_state_once_and_watches_each_process(tmp_path, patient, monkeypatch):
    duration, rate, busy = 5.0, 50.0, []   # what busy processes do, test_resources.py shows
    monkeypatch.setattr(soak, 'burning', lambda count: busy.append(count) or nullcontext())
    monkeypatch.setattr(soak, 'SAMPLE', 0.1)   # so that each is looked at twice, if late
    with isolated():
        found = soak.soak(tmp_path / 'soak', 'ddp', duration, rate, seed=3, burn=1)
    assert found.failure == '' and busy == [1]
    answers, times, ticks = soak.answers(found), soak.times(found), soak.ticks(found)
    for who, name in (('mpc', 'mpc, state to force'), ('echo', 'echo, state to answer')):
        row = answers[who]
        assert 0 < row['states'] <= duration * rate + 1
        assert row['states'] == row['answered in time'] + row['late'] + row['unanswered']
        assert row['answered in time'] > 0
        assert times[name]['count'] == row['answered in time'] + row['late']
    for row in times.values():
        assert 0 < row['p50'] <= row['p99'] <= row['p99.9'] <= row['max']
    assert ticks['messages not heard'] == 0
    answered = answers['mpc']['states'] - answers['mpc']['unanswered']
    assert ticks['of the mpc'] >= answered
    assert found.forces.total > answered   # a last zero
    assert found.forces.not_finite == found.forces.beyond_limit == 0
    assert 10.0 < found.forces.largest <= 20.0
    processes = soak.processes(found)
    assert list(processes) == ['plant', 'mpc', 'echo', 'watcher']
    for row in processes.values():
        assert 0.0 < row['processor [%]'] < 100.0 * os.cpu_count()
        assert 1.0 < row['private [MB]'] < row['resident [MB]'] < 2000.0


def test_a_process_that_dies_is_named_and_the_rest_reported(tmp_path, patient, monkeypatch):
    watchers, make = [], soak.Watcher

    class Deadly(Resources):

        def sample(self, t):
            super().sample(t)
            if len(watchers[0].answers) > 40:
                os.kill(self.pids['mpc'], signal.SIGKILL)

    monkeypatch.setattr(soak, 'Resources', Deadly)
    monkeypatch.setattr(
        soak, 'Watcher', lambda *given: watchers.append(make(*given)) or watchers[0])
    with isolated():
        found = soak.soak(tmp_path / 'soak', 'ddp', 3600.0)
    assert found.failure.startswith('mpc ended early with exit code')
    assert soak.answers(found)['mpc']['answered in time'] > 0
    assert not found.success
