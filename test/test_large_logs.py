# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A short version of benchmarks/large_logs.py, and what it must find."""

import sys

import large_logs
import pytest

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
    lambda topic, values: [(topic, lambda: 1.001 * values()[0])],
    lambda topic, values: [(topic, values)] * 2,
    lambda topic, values: []])
def test_other_rows_are_none_of_the_log(change):
    log = large_logs.swaying(3)

    def read(bag):
        for row in log.to_numpy()[:, 1:]:
            yield '/joint_states', lambda: row[:-1]
            yield from change('/force_command', lambda: row[-1:])
    assert not large_logs.agrees(log, read, 'bag')
