# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Progress bars are for terminals: in a pipe or a file they are thousands of lines."""

import ast
from pathlib import Path

import pytest

from dp_swing_ros.tools.evaluate import main

TOP = Path(__file__).parents[1]
SOURCES = sorted([*(TOP / 'dp_swing_ros').rglob('*.py'), *(TOP / 'benchmarks').glob('*.py')])


def bars(file):
    """Return the calls in a file that make a progress bar."""
    text = file.read_text()
    return [node for node in ast.walk(ast.parse(text if 'tqdm(' in text else ''))
            if isinstance(node, ast.Call) and getattr(node.func, 'id', '') == 'tqdm']


@pytest.mark.parametrize('file', [file for file in SOURCES if bars(file)],
                         ids=lambda file: file.name)
def test_a_progress_bar_is_for_terminals_alone(file):
    for bar in bars(file):
        disable, = [keyword.value for keyword in bar.keywords if keyword.arg == 'disable']
        assert isinstance(disable, ast.Constant) and disable.value is None, f'line {bar.lineno}'


def test_a_campaign_leaves_nothing_but_its_lines_in_a_file(tmp_path, capfd):
    assert main(['--contestants', 'nothing', '--scenarios', 'hanging', '--seeds', '2',
                 '--duration', '1', '--jobs', '1', '--no-figures', '--output',
                 str(tmp_path / 'campaign')]) == 0
    out, error = capfd.readouterr()
    assert (error, '\r' in out) == ('', False) and out
