# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What README prints runs exactly as it is printed, and its recipes lead where it says."""

import os
from pathlib import Path
import re
import shutil
import subprocess
import sys

from PIL import Image
import pytest
from real_bags import record

from dp_swing_ros.estimators.estimator import Estimator

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
    tested = {block for heading in ('Bags', 'From Python, without ROS', 'Build on it')
              for block in blocks(heading)}
    assert set(re.findall(r'^```python\n(.*?)^```', README, re.M | re.S)) == tested


def test_a_bag_is_a_frame(bag, tmp_path, monkeypatch):
    shutil.copytree(bag, tmp_path / 'my_bag')
    monkeypatch.chdir(tmp_path)
    snippet, = blocks('Bags')
    names = {}
    exec(snippet, names)
    assert len(names['run']) == 21
    with Image.open('angles.png') as image:
        image.verify()


def test_a_run_without_ros(capsys):
    snippet, = blocks('From Python, without ROS')
    exec(snippet, {})
    assert 'success=True' in capsys.readouterr().out


def test_the_estimator_has_all_that_the_protocol_asks_for():
    found = {}
    exec(blocks('Build on it')[1], found)
    assert {name for name in vars(Estimator) if not name.startswith('_')} <= {*dir(found['Blend'])}


@pytest.fixture(scope='module')
def plugin(tmp_path_factory):
    """Install the package of README's recipes as a reader would, but into a folder of its own."""
    source, site = tmp_path_factory.mktemp('source'), tmp_path_factory.mktemp('site')
    (source / 'my_mpc').mkdir()
    (source / 'my_mpc' / '__init__.py').touch()
    toml, = re.findall(r'^```toml\n(.*?)^```', README, re.M | re.S)
    (source / 'pyproject.toml').write_text(toml)
    for name, block in zip(re.findall(r'`my_mpc/(\w+)\.py`', README), blocks('Build on it')):
        (source / 'my_mpc' / f'{name}.py').write_text(block)
    subprocess.run([sys.executable, '-m', 'pip', 'install', '--quiet', '--no-deps',
                    '--no-build-isolation', '--target', site, source], check=True)
    return site


def run(folder, plugin, *arguments):
    """Run a tool with the package of the recipes on the path, and return what it printed."""
    done = subprocess.run(
        [sys.executable, '-c', TOOL, *map(str, arguments)], cwd=folder, capture_output=True,
        text=True, env={**os.environ, 'PYTHONPATH': f'{plugin}{os.pathsep}{TOP}'})
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_campaigns_know_what_another_package_has(plugin, tmp_path):
    shown = run(tmp_path, plugin, 'evaluate', '--contestants', 'shooting', 'ilqr:estimator=blend',
                'ilqr:model=kutta', '--scenarios', 'hanging', '--seeds', '1', '--jobs', '1',
                '--duration', '3', '--no-figures', '--output', 'campaign')
    assert 'shooting: ' in shown
    held = re.findall(r'^ilqr:(\w+)=\w+: held 1 of 1', shown, re.M)
    assert held == ['estimator', 'model'], shown


@pytest.mark.parametrize('solver, mpc', [
    ('shooting', '    shooting: {iterations: 3}\n'), ('ilqr', '    estimator: blend\n')],
    ids=['solver', 'estimator'])   # another integrator compiles for a minute, above
def test_nodes_and_tools_know_what_another_package_has(solver, mpc, plugin, tmp_path, monkeypatch):
    monkeypatch.setenv('PYTHONPATH', f'{plugin}{os.pathsep}{os.environ.get("PYTHONPATH", "")}')
    bag = record(tmp_path, '--duration', '1', '--lockstep', '--solver', solver, mpc=mpc)
    assert 'the recorded ones to the bit' in run(tmp_path, plugin, 'verify', bag)
    shown = run(tmp_path, plugin, 'compare', bag, '--at', '0.2', '--output', '.')
    assert '| shooting ' in shown
    assert (tmp_path / 'counterfactual.png').stat().st_size > 10_000
