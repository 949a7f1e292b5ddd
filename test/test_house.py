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


def test_the_page_s_table_of_rooms_is_current():
    found = house.outdated(house.PAGE.read_text())
    assert not found, f'{found}: run `make docs`'


def test_a_table_that_is_not_current_is_noticed_but_for_some_lines():
    def page(text):
        return f'<!-- rooms -->\n{text}\n<!-- end of rooms -->'

    def grown(by):
        return page(house.ROW.sub(lambda row: row[0].replace(
            f' {row[2]} |', f' {int(row[2]) + by} |') if row[1] == 'scripts' else row[0],
            house.table()))
    assert house.outdated(page(house.table())) == house.outdated(grown(house.SLACK)) == []
    assert house.outdated(grown(house.SLACK + 1)) == ['scripts']
    assert house.outdated(page(house.table().replace('| scripts |', '| attic |'))) == [
        'attic', 'scripts']
    assert house.outdated(page(house.table().replace('| plant |', '| planet |'))) == ['nodes']


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
