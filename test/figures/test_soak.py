# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import dataclasses
import math

import numpy as np
import pytest
from synthetic import soaked

from dp_swing_ros.evaluation.soak import Usage
from dp_swing_ros.figures import soak
from dp_swing_ros.figures.soak import binned, BINS


def with_a_late_answer(found):
    latency = found.latency.copy()
    latency[3] = 0.07
    return dataclasses.replace(found, latency=latency)


def of_label(axes, label):
    line, = [line for line in axes.lines if line.get_label() == label]
    return line


def test_answers_are_drawn_by_their_share_and_over_time():
    found = with_a_late_answer(soaked(100))
    distribution, latency, memory, deviation = soak(found).axes
    curve = of_label(distribution, 'state to force')
    assert curve.get_xdata().tolist() == pytest.approx([4.0] * 99 + [70.0])
    assert curve.get_ydata()[[0, -1]] == pytest.approx([1.0, 0.01])
    np.testing.assert_allclose(of_label(latency, 'state to force').get_ydata(),
                               1e3 * found.latency)
    assert of_label(latency, 'late (1, 1 by itself)').get_xydata().tolist() == [
        pytest.approx([found.t[3], 70.0])]
    assert [line.get_label() for line in memory.lines] == [
        f'{name} (200 MB)' for name in ('plant', 'mpc', 'echo')]
    assert memory.lines[0].get_ydata().tolist() == [0.0] * len(found.usage['plant'].t)
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
    {}, {'latency': np.full(100, math.nan), 'solve_time': np.array([])},
    {'usage': {'mpc': Usage(*[np.array([])] * 4)}}, {'deviation': np.zeros(100)}],
    ids=['usual', 'no answer', 'unseen', 'exact'])
def test_odd_soaks_are_drawn_without_a_warning(change, tmp_path):
    soak(dataclasses.replace(soaked(100), **change)).savefig(tmp_path / 'soak.png', dpi=30)
    assert (tmp_path / 'soak.png').stat().st_size > 1000
