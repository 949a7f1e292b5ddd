# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A short version of benchmarks/durability.py, and what it must find."""

import re
import sys

import durability


def test_bags_survive(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, 'argv', ['', '--kills', '1', '--kills-fast', '1', '--seconds', '1',
                                      '--docs', str(tmp_path)])
    durability.main()
    page = (tmp_path / 'results' / 'durability.md').read_text()
    rows = [line for line in page.splitlines() if re.match(r'\| \d', line)]
    assert len(rows) == 2
    for row in rows:
        _, kills, _, _, oldest, newest, *verdicts = row.strip('| ').split(' | ')
        assert kills == '1'
        # [ms], far less than the 2 s of the run; how little on a machine is on the page
        assert float(oldest) <= 1000
        assert float(newest) <= 1000
        assert set(verdicts) == {'1 of 1'}
    assert re.search(r'5000 messages on 5 topics in \S+ s: 5000 in the bag, 0 lost; the logger '
                     'itself counted 0 lost', page)
    if 'Not measured' not in page:
        assert re.search(r'No space left on device; .* makes a whole bag of it', page)
        assert re.search(r'\d{3,} messages are in the bag as it was left, without', page)
        assert 'NO' not in page.replace('No ', '')
