# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What may be imported from the root of the package, and the page that describes it."""

from pathlib import Path
import pkgutil
import re
import subprocess
import sys

import api_reference
import pytest

import dp_swing_ros

PAGE = Path(__file__).parents[1] / 'docs' / 'api.md'
HEAVY = ('dp_swing_ros.control', 'matplotlib', 'mcap', 'numba', 'numpy', 'pandas', 'rclpy',
         'scipy', 'torch')


def test_the_page_is_current():
    assert PAGE.read_text() == api_reference.reference(), 'run `make docs`'


def test_the_page_describes_every_name_once():
    assert sorted(re.findall(r'^### (\w+)$', PAGE.read_text(), re.M)) == sorted(
        dp_swing_ros.PUBLIC)


@pytest.mark.parametrize('name', dp_swing_ros.PUBLIC)
def test_a_name_can_be_imported(name):
    names = {}
    exec(f'from dp_swing_ros import {name} as found', names)
    assert names['found'] is getattr(dp_swing_ros, name)
    assert name in dir(dp_swing_ros) and name in dp_swing_ros.__all__


def test_no_name_is_one_of_a_module():
    """A module that is imported becomes an attribute of its package, and would hide the name."""
    modules = {module.name for module in pkgutil.iter_modules(dp_swing_ros.__path__)}
    assert not modules & set(dp_swing_ros.PUBLIC)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'dp_swing_ros' has no attribute 'nonsense'"):
        getattr(dp_swing_ros, 'nonsense')


def test_the_import_of_the_package_loads_nothing():
    shown = subprocess.run(
        [sys.executable, '-c', 'import sys, dp_swing_ros; print(*sys.modules)'], check=True,
        capture_output=True, text=True).stdout.split()
    assert 'dp_swing_ros' in shown and not set(HEAVY) & set(shown)


def test_what_the_page_prints_runs(capsys):
    first, = re.findall(r'^```python\n(from .*?)^```', PAGE.read_text(), re.M | re.S)
    exec(first, {})
    assert 'success=True' in capsys.readouterr().out
