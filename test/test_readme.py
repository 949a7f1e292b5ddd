# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What README prints runs exactly as it is printed, and its recipes lead where it says."""

import os
from pathlib import Path
import re
import shutil
import subprocess
import sys

import pytest
from real_bags import record

TOP = Path(__file__).parents[1]
README = (TOP / 'README.md').read_text()
PACKAGE = 'dp_swing_ros'
TOOL = ('import importlib, sys\n'
        'sys.exit(importlib.import_module(f"dp_swing_ros.tools.{sys.argv[1]}")'
        '.main(sys.argv[2:]))')


def blocks(heading):
    """Return the Python of a section."""
    section = re.search(rf'^## {re.escape(heading)}\n(.*?)(?=^## )', README, re.M | re.S)[1]
    return re.findall(r'^```python\n(.*?)^```', section, re.M | re.S)


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    return record(tmp_path_factory.mktemp('bag'), '--duration', '1', '--lockstep')


def test_every_snippet_is_run_here():
    tested = {block for heading in ('Bags', 'From Python, without ROS', 'Add a solver',
                                    'Add a dynamics model') for block in blocks(heading)}
    assert set(re.findall(r'^```python\n(.*?)^```', README, re.M | re.S)) == tested


def test_a_bag_is_a_frame(bag, tmp_path, monkeypatch):
    shutil.copytree(bag, tmp_path / 'my_bag')
    monkeypatch.chdir(tmp_path)
    snippet, = blocks('Bags')
    names = {}
    exec(snippet, names)
    assert len(names['run']) == 21


def test_a_run_without_ros(capsys):
    snippet, = blocks('From Python, without ROS')
    exec(snippet, {})
    assert 'success=True' in capsys.readouterr().out


@pytest.fixture
def copy(tmp_path):
    """Return a copy of the package and its tests, in which a reader may add something."""
    for name in (PACKAGE, 'test', 'benchmarks'):
        shutil.copytree(TOP / name, tmp_path / name,
                        ignore=shutil.ignore_patterns('__pycache__'))
    for name in ('pyproject.toml', 'package.xml', 'README.md'):
        shutil.copy(TOP / name, tmp_path / name)
    return tmp_path


def run(copy, *arguments, **environment):
    """Run Python in the copy, and return what it printed."""
    done = subprocess.run([sys.executable, *arguments], cwd=copy, capture_output=True, text=True,
                          env={**os.environ, 'PYTHONPATH': str(copy), **environment})
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_a_solver_is_added_as_the_recipe_says(copy, bag):
    file, registry = blocks('Add a solver')
    solvers = copy / PACKAGE / 'solvers'
    (solvers / 'shooting.py').write_text(file)
    with (solvers / '__init__.py').open('a') as init:
        init.write(registry)
    shown = run(copy, '-m', 'pytest', '-q', '-p', 'no:cacheprovider',
                'test/solvers/test_contract.py', '-k', 'shooting or unknown')
    assert ' passed' in shown and 'skipped' not in shown
    shown = run(copy, '-c', TOOL, 'evaluate', '--contestants', 'shooting', 'ilqr',
                '--scenarios', 'hanging', '--seeds', '1', '--duration', '1', '--jobs', '1',
                '--output', 'campaign')
    assert '`shooting`' in shown
    shown = run(copy, '-c', TOOL, 'compare', str(bag), '--at', '0.2', '--output', '.')
    assert '| shooting ' in shown
    assert (copy / 'counterfactual.png').stat().st_size > 10_000


def test_a_model_is_added_as_the_recipe_says(copy):
    """The file is that of Euler's steps under another name, which is all that a test can write."""
    registry, = blocks('Add a dynamics model')
    pendulum = copy / PACKAGE / 'pendulum'
    (pendulum / 'midpoint.py').write_text(
        (pendulum / 'euler.py').read_text().replace('Euler', 'Midpoint'))
    with (pendulum / 'models.py').open('a') as init:
        init.write(registry)
    shown = run(copy, '-m', 'pytest', '-q', '-p', 'no:cacheprovider',
                'test/pendulum/test_models.py', '-k', 'midpoint')
    assert ' passed' in shown
    # without the compiler, which would take a minute for all of a new model
    shown = run(copy, '-c', 'from dp_swing_ros import configuration\n'
                'from dp_swing_ros.simulation.closed_loop import simulate\n'
                'for name in ("ilqr", "ddp", "mppi"):\n'
                '    controller = configuration.controller({\n'
                '        "model": "midpoint", "solver": name, "horizon": 3,\n'
                '        "first_starts": 1, f"{name}.iterations": 1})\n'
                '    plant = configuration.plant({"integrator": "midpoint"})\n'
                '    print(len(simulate(plant, controller, 0.1).U))', NUMBA_DISABLE_JIT='1')
    assert shown.split() == ['2', '2', '2']
