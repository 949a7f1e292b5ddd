# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
import csv
import dataclasses
import math
import re
import resource

import numpy as np
import pandas as pd
import pytest
from results import error_row, row, same

from dp_swing_ros.evaluation.campaign.rows import (
    CampaignError, identical, read, solves, store, Table, untimed)


def write(path, *rows):
    table = Table(path)
    for one in rows:
        table.append(one)


def assert_same(found, expected):
    assert (found.key, found.outcome, found.detail) == (
        expected.key, expected.outcome, expected.detail)
    assert all(map(same, vars(found.metrics).values(), vars(expected.metrics).values()))
    assert isinstance(found.metrics.ticks, int)
    np.testing.assert_allclose(found.solve_times, expected.solve_times, atol=1e-6)


def test_rows_come_back_as_they_were(tmp_path):
    rows = [row(settling_time=1 / 3), row(held=False, parameter='delay', level=0.1, seed=4),
            error_row()]
    write(tmp_path / 'episodes.csv', *rows)
    found = read(tmp_path / 'episodes.csv')
    assert len(found) == 3
    for one, other in zip(found, rows):
        assert_same(one, other)


def test_a_row_of_a_long_episode_comes_back(tmp_path):
    limit, ticks = csv.field_size_limit(), np.full(36_000, 0.012)
    write(tmp_path / 'episodes.csv', row(solve_times=ticks), row())
    store(tmp_path / 'rows.csv.gz', [row(solve_times=ticks), row()])
    for name in ('episodes.csv', 'rows.csv.gz'):
        long, short = read(tmp_path / name)
        np.testing.assert_allclose(long.solve_times, ticks)
        assert_same(short, row())
    assert csv.field_size_limit() == limit   # anyone else's is as it was


def test_stored_rows_come_back_as_they_were_from_the_same_bytes(tmp_path):
    rows = [row(settling_time=1 / 3), row(held=False, parameter='delay', level=0.1), error_row()]
    for name in ('one', 'two'):
        store(tmp_path / f'{name}.csv.gz', rows)
    for one, other in zip(read(tmp_path / 'one.csv.gz'), rows, strict=True):
        assert_same(one, other)
        assert identical(one, other)
    assert (tmp_path / 'one.csv.gz').read_bytes() == (tmp_path / 'two.csv.gz').read_bytes()


def test_a_stored_table_that_is_torn_is_refused(tmp_path):
    path = tmp_path / 'rows.csv.gz'
    store(path, [row(seed=seed) for seed in range(9)])
    path.write_bytes(path.read_bytes()[:-9])
    with pytest.raises(CampaignError, match='decompressed'):
        read(path)


@pytest.mark.parametrize('name', [
    'median_solve_time', 'p99_solve_time', 'largest_solve_time', 'median_latency', 'p99_latency',
    'late_ticks', 'deadline_misses'])
def test_what_a_clock_decides_makes_no_other_row(name):
    assert identical(row(**{name: 1}), row(**{name: 2}))


def test_rows_are_identical_whatever_the_clock_decided():
    one, other = row(settling_time=1.0, p99_solve_time=1.0), row(settling_time=1.0,
                                                                 solve_times=(0.5,))
    assert identical(one, other)
    assert not identical(one, row(settling_time=np.nextafter(1.0, 2.0)))
    bare = untimed(one)
    assert identical(bare, one)
    assert len(bare.solve_times) == bare.metrics.deadline_misses == 0
    assert np.isnan(bare.metrics.p99_solve_time)


def test_a_table_goes_on_where_it_stopped(tmp_path):
    path = tmp_path / 'episodes.csv'
    write(path, row(seed=0))
    table = Table(path)
    assert [one.key.seed for one in table.rows] == [0]
    table.append(row(seed=1))
    assert [one.key.seed for one in table.rows] == [0, 1]
    assert [one.key.seed for one in read(path)] == [0, 1]


@pytest.mark.parametrize('cut', [1, 5, 300])
def test_a_torn_last_line_is_dropped(cut, tmp_path):
    path = tmp_path / 'episodes.csv'
    write(path, row(seed=0), row(seed=1, solve_times=np.full(100, 0.001)))
    path.write_bytes(path.read_bytes()[:-cut])
    assert [one.key.seed for one in read(path)] == [0]
    write(path, row(seed=2))
    assert [one.key.seed for one in read(path)] == [0, 2]


@pytest.mark.parametrize('length', [0, 10])
def test_a_head_that_is_torn_is_written_anew(length, tmp_path):
    path = tmp_path / 'episodes.csv'
    write(path)
    path.write_bytes(path.read_bytes()[:length])
    write(path, row())
    assert len(read(path)) == 1


def test_another_table_is_refused(tmp_path):
    path = tmp_path / 'episodes.csv'
    path.write_text('seed,success\n1,1\n')
    with pytest.raises(CampaignError, match='not the table'):
        Table(path)


def test_a_measure_that_an_older_table_lacks_is_unknown(tmp_path):
    path = tmp_path / 'episodes.csv'
    write(path, row())
    table = pd.read_csv(path)
    table.drop(columns='uptime').to_csv(path, index=False)
    found, = read(path)
    assert math.isnan(found.metrics.uptime)
    assert identical(dataclasses.replace(found, metrics=dataclasses.replace(
        found.metrics, uptime=row().metrics.uptime)), row())
    table.drop(columns='strikes').to_csv(path, index=False)
    with pytest.raises(CampaignError, match='not the table'):
        read(path)


def test_a_broken_line_is_named(tmp_path):
    path = tmp_path / 'episodes.csv'
    write(path, row(), row(seed=1))
    lines = path.read_text().splitlines()
    path.write_text('\n'.join([*lines[:2], 'ilqr,hanging', lines[2], '']))
    with pytest.raises(CampaignError, match='line 3'):
        read(path)


def test_a_full_disk_is_reported_and_what_was_written_stays(tmp_path):
    path = tmp_path / 'episodes.csv'
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (3000, limit[1]))
    try:
        with pytest.raises(CampaignError, match=re.escape(str(path))):
            write(path, *(row(seed=seed) for seed in range(100)))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
    seeds = [one.key.seed for one in read(path)]
    assert 3 < len(seeds) < 100
    assert seeds == list(range(len(seeds)))


def test_a_place_that_cannot_be_written_is_refused(tmp_path):
    with pytest.raises(CampaignError, match='none'):
        Table(tmp_path / 'none' / 'episodes.csv')


def test_a_tick_without_a_solve_has_no_solve_time():
    times = solves([row(solve_times=(0.0, 0.002)), error_row(), row(solve_times=(0.001,))])
    np.testing.assert_array_equal(times, [0.002, 0.001])
    assert len(solves([])) == 0
