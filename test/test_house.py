# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The house does not grow unseen: what each node loads, and the table of rooms."""

import os
from pathlib import Path
import re
import subprocess
import sys

import house
import pytest


@pytest.mark.parametrize('node', house.CONTRACTS)
def test_a_node_loads_what_it_needs(node):
    words = house.broken(node, house.loaded(node))
    assert not words, f'{words} (CONTRACTS of scripts/house.py)'


def test_a_broken_contract_is_named():
    found = house.Loaded({'dp_swing_ros': 5, 'dp_swing_ros.topics': 9,
                          'dp_swing_ros.figures.style': 7}, 50.0)
    assert house.broken('logger', found) == 'the logger loads figures: dp_swing_ros.figures.style'
    many = house.Loaded({f'dp_swing_ros.nodes.m{i}': 1 for i in range(99)}, 50.0)
    assert 'loads 99 modules' in house.broken('logger', many)


def test_nothing_is_larger_than_what_was_largest():
    for (lines, name), (what, most) in zip(house.largest(), house.MOST.items()):
        assert lines <= most, f'{name} is a {what} of {lines} lines; expected {most} at most'


def rows(text):
    """Return the files and lines of the rooms of a table."""
    found = re.findall(r'^\| ([\w/ ]+) \| (\d+) \| ([\w ]+) \|$', text, re.M)
    return {name: int(re.sub(r'\D.*', '', lines) or 0) for name, _, lines in found}


def test_the_page_s_table_of_rooms_is_current():
    """Within some lines, so that not every change is one of the page."""
    told, there = rows(house.PAGE.read_text()), rows(house.table())
    assert told.keys() == there.keys(), 'run `make docs`'
    of_nodes = house.table().partition('\n\nNo class')[2]
    assert of_nodes and of_nodes in house.PAGE.read_text(), 'run `make docs`'
    for name, lines in there.items():
        assert abs(told[name] - lines) <= max(100, 0.03 * lines), f'{name}: run `make docs`'


def test_the_report_names_every_room_and_node():
    report = house.report()
    for name in ('console', 'solvers', 'test', 'README', 'largest class', 'plant', 'logger'):
        assert name in report


def test_a_run_ends_with_what_was_spent_in_each_file(tmp_path):
    """Also where other processes run the tests."""
    (tmp_path / 'test_one.py').write_text('import subprocess, sys\ndef test_one():\n'
                                          '    subprocess.run([sys.executable, "-c", ""])\n')
    here = Path(__file__).parent
    for arguments in ([], ['-n', '1']):
        printed = subprocess.run(
            [sys.executable, '-m', 'pytest', '-p', 'spent', *arguments, '--rootdir', tmp_path,
             '-c', os.devnull, tmp_path], capture_output=True, text=True, cwd=tmp_path,
            env={**os.environ, 'PYTHONPATH': f'{here}:{os.environ.get("PYTHONPATH", "")}'}).stdout
        assert re.search(r'test_one\.py +\d+\.\d s +\d+\.\d s +1\n', printed), printed
        assert re.search(r'1 file +\d+\.\d s +\d+\.\d s +1\n', printed), printed
