# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rules of the house: ament's linters through their public tools, types, and imports."""

import ast
from functools import cache
from pathlib import Path
import subprocess
import sys

from catkin_pkg.package import parse_package
from importlinter.cli import lint_imports
import pycodestyle
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


def test_ruff():
    """The rules of ament_flake8 and ament_pep257, from pyproject.toml."""
    check('ruff', 'check', '--no-cache', *names(PYTHON))


def test_pycodestyle():
    """Rules of ament_flake8 that ruff has not, from setup.cfg."""
    style = pycodestyle.StyleGuide(config_file=str(TOP / 'setup.cfg'))
    assert style.check_files(map(str, PYTHON)).total_errors == 0


@cache
def tree(file):
    return ast.parse(file.read_text())


def place(node):
    """Return where an import belongs: its section, then its names, whatever their case."""
    module = node.module if isinstance(node, ast.ImportFrom) else node.names[0].name
    top = module.partition('.')[0]
    section = 0 if top in sys.stdlib_module_names else 2 if top == 'dp_swing_ros' else 1
    return section, *([(name.lower(), name) for name in found] for found in (
        [module], [alias.name for alias in node.names if isinstance(node, ast.ImportFrom)]))


def out_of_order(module):
    """Return the lines of imports that are not in Google's order, or not apart."""
    nodes = [node for node in module.body if isinstance(node, (ast.Import, ast.ImportFrom))]
    places = [place(node) for node in nodes]
    return [node.lineno for node, here in zip(nodes, places) if here[2] != sorted(here[2])] + [
        after.lineno for before, after, first, second in zip(nodes, nodes[1:], places, places[1:])
        if first > second or first[0] < second[0] and after.lineno == before.end_lineno + 1]


def test_imports_are_in_google_s_order():
    """Python's, those of others, and ours, each with a line between; ament_flake8's rule, too."""
    wrong = {file: lines for file in PYTHON if (lines := out_of_order(tree(file)))}
    assert not wrong


@pytest.mark.parametrize('text', [
    'import sys\nimport ast\n', 'from os import path, PathLike\nimport ast\n',
    'from os import sep, path\n', 'import sys\nimport numpy\n', 'import numpy\n\nimport sys\n',
    'import dp_swing_ros\n\nimport numpy\n', 'from os import path\nimport os\n'])
def test_an_import_out_of_order_is_seen(text):
    assert out_of_order(ast.parse(text))


def test_a_class_has_a_line_before_its_first_method():
    """ament_flake8's rule; docstrings need none."""
    wrong = {file: node.name for file in PYTHON for node in tree(file).body
             if isinstance(node, ast.ClassDef) and isinstance(node.body[0], ast.FunctionDef)
             and min([node.body[0], *node.body[0].decorator_list],
                     key=lambda of: of.lineno).lineno == node.lineno + 1}
    assert not wrong


def test_mypy():
    check('mypy')


def test_imports_run_one_way(monkeypatch):
    """import-linter's contracts, from pyproject.toml."""
    monkeypatch.chdir(TOP)
    monkeypatch.setattr(sys, 'path', [*sys.path])   # to which it adds
    assert lint_imports(str(TOP / 'pyproject.toml')) == 0


def test_every_file_says_whose_it_is():
    wrong = [file for file in PYTHON if [line for line in file.read_text().splitlines()[:3]
                                         if not line.startswith('#!')][:2] != HEADER]
    assert not wrong


def test_the_manifest_is_valid():
    warnings = []
    package = parse_package(str(TOP / 'package.xml'), warnings=warnings)
    package.validate(warnings=warnings)
    assert not warnings
    assert package.package_format == 3
    assert package.get_build_type() == 'ament_python'
