# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tool that seeds defects: it changes what it says, once, and leaves nothing behind."""

import os

import defects
import pytest

ONE = defects.defect('one is two', 'numbers.py', 'ONE = 1', 'ONE = 2', 'test_numbers.py')


@pytest.fixture
def checkout(tmp_path):
    (tmp_path / 'dp_swing_ros').mkdir()
    (tmp_path / 'dp_swing_ros' / 'numbers.py').write_text('ONE = 1\nTWO = 2\n')
    (tmp_path / 'test').mkdir()
    (tmp_path / 'test' / 'test_numbers.py').write_text(
        'from pathlib import Path\nfrom runpy import run_path\n\n'
        'def test_one():\n    folder = Path(__file__).parents[1] / "dp_swing_ros"\n'
        '    assert run_path(str(folder / "numbers.py"))["ONE"] == 1\n')
    return tmp_path


def test_a_defect_is_there_for_a_while(checkout):
    file = checkout / 'dp_swing_ros' / 'numbers.py'
    with defects.applied(ONE, checkout):
        assert file.read_text() == 'ONE = 2\nTWO = 2\n'
    assert file.read_text() == 'ONE = 1\nTWO = 2\n'


@pytest.mark.parametrize('text', ['UNO = 1\n', 'ONE = 1\nONE = 1\n', None])
def test_a_defect_without_its_one_place_is_refused(checkout, text):
    file = checkout / 'dp_swing_ros' / 'numbers.py'
    file.write_text(text) if text else file.unlink()
    with pytest.raises(defects.MovedError, match='numbers.py has'):
        with defects.applied(ONE, checkout):
            pass
    assert not text or file.read_text() == text


def test_tests_kill_a_defect_or_let_it_survive(checkout, tmp_path):
    assert defects.tested(checkout, tmp_path / 'cache', ONE.tests) == defects.SURVIVED
    with defects.applied(ONE, checkout):
        assert defects.tested(checkout, tmp_path / 'cache', ONE.tests) == defects.KILLED
    assert defects.tested(checkout, tmp_path / 'cache', ['test_none.py']) == defects.NOT_RUN


def test_each_defect_is_another_and_changes_something():
    assert len({each.what for each in defects.DEFECTS}) == len(defects.DEFECTS)
    for each in defects.DEFECTS:
        assert each.right != each.wrong and each.tests
        assert not any(os.path.isabs(name) for name in (each.file, *each.tests))
        text = (defects.TOP / 'dp_swing_ros' / each.file).read_text(encoding='utf-8')
        assert text.count(each.right) == 1, f'to be anchored anew: {each.what}'
