# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A short version of benchmarks/large_logs.py, and what it must find."""

import sys

import large_logs
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

ROWS = 2500


def verdicts(folder, monkeypatch):
    """Return what each kind of log is read by, as the page has it."""
    monkeypatch.setattr(sys, 'argv', ['', '--rows', str(ROWS), '--docs', str(folder)])
    large_logs.main()
    page = (folder / 'results' / 'large_logs.md').read_text()
    assert f'{ROWS:,} rows' in page
    rows = [line.strip('| ').split(' | ') for line in page.splitlines()]
    return {row[0]: row[-2:] for row in rows if row[0] in large_logs.WRITERS}


def test_logs_become_bags_that_others_read(tmp_path, monkeypatch):
    assert verdicts(tmp_path, monkeypatch) == {'csv': ['yes'] * 2, 'parquet': ['yes'] * 2}


@pytest.mark.parametrize('change', [
    lambda topic, decode: [(topic, lambda: Float64(data=1.001 * decode().data))],
    lambda topic, decode: [(topic, decode)] * 2,
    lambda topic, decode: []])
def test_other_rows_are_none_of_the_log(change):
    log = large_logs.swaying(3)

    def reader(change):
        def read(bag):
            for row in log.to_numpy()[:, 1:]:
                yield '/joint_states', lambda: JointState(position=row[:-1])
                yield from change('/force_command', lambda: Float64(data=row[-1]))
        return read
    assert large_logs.agrees(log, reader(lambda topic, decode: [(topic, decode)]), 'bag')
    assert not large_logs.agrees(log, reader(change), 'bag')
