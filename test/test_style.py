# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rules of the house: ament's linters through their public tools, types, and imports."""

from pathlib import Path
import subprocess
import sys

from catkin_pkg.package import parse_package
import pytest

TOP = Path(__file__).parents[1]
FOLDERS = ('dp_swing_ros', 'test', 'benchmarks', 'scripts', 'examples')
PYTHON = sorted([TOP / 'setup.py', TOP / 'scripts' / 'ros2'] + [
    file for folder in FOLDERS for file in (TOP / folder).rglob('*.py')])
HEADER = ['# Copyright 2026 the dp_swing_ros authors', '# SPDX-License-Identifier: Apache-2.0']


def check(command, *arguments):
    """Run a linter of this environment."""
    run = subprocess.run([Path(sys.executable).with_name(command), *arguments], cwd=TOP,
                         capture_output=True, text=True)
    assert run.returncode == 0, run.stdout + run.stderr


def names(files):
    return [str(file.relative_to(TOP)) for file in files]


def test_flake8():
    """ament_flake8's rules, from setup.cfg."""
    check('flake8', *names(PYTHON))


def test_pydocstyle():
    """ament_pep257's rules, from setup.cfg; tests speak by their names."""
    check('pydocstyle', *names(file for file in PYTHON if 'test' not in file.parts))


def test_mypy():
    check('mypy')


def test_imports_run_one_way():
    """import-linter's contracts, from pyproject.toml."""
    check('lint-imports')


@pytest.mark.parametrize('file', PYTHON, ids=names(PYTHON))
def test_every_file_says_whose_it_is(file):
    lines = [line for line in file.read_text().splitlines()[:3] if not line.startswith('#!')]
    assert lines[:2] == HEADER


def test_the_manifest_is_valid():
    warnings = []
    package = parse_package(str(TOP / 'package.xml'), warnings=warnings)
    package.validate(warnings=warnings)
    assert not warnings
    assert package.package_format == 3
    assert package.get_build_type() == 'ament_python'
