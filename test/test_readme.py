# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What README prints runs exactly as it is printed, and its recipe leads where it says."""

import os
from pathlib import Path
import re
import shlex
import subprocess
import sys

from PIL import Image
from recorded_bags import record

TOP = Path(__file__).parents[1]
README = (TOP / 'README.md').read_text()


def blocks(heading, language='python'):
    """Return the snippets of a section."""
    section = re.search(rf'^## {re.escape(heading)}\n(.*?)(?=^## )', README, re.M | re.S)[1]
    return re.findall(rf'^```{language}\n(.*?)^```', section, re.M | re.S)


def test_it_is_short_and_every_snippet_is_run_here():
    assert len(README.splitlines()) <= 200
    tested = {block for heading in ('Bags', 'From Python, without ROS', 'Build on it')
              for block in blocks(heading)}
    assert set(re.findall(r'^```python\n(.*?)^```', README, re.M | re.S)) == tested


def test_a_bag_is_a_frame(tmp_path, monkeypatch):
    record(tmp_path / 'my_bag', duration=1.0)
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


def test_campaigns_know_what_another_package_has(tmp_path):
    """The package of the recipe is installed as a reader would, but into a folder of its own."""
    source, site = tmp_path / 'source', tmp_path / 'site'
    source.mkdir()
    for name, language in (('pyproject.toml', 'toml'), ('my_mpc.py', 'python')):
        block, = blocks('Build on it', language)
        (source / name).write_text(block)
    subprocess.run([sys.executable, '-m', 'pip', 'install', '--quiet', '--no-deps',
                    '--no-build-isolation', '--target', site, source], check=True)
    command, = re.findall(r'^    ros2 run dp_swing_ros (evaluate --contestants .* ilqr:model=.*)$',
                          README, re.M)
    done = subprocess.run(
        [sys.executable, '-m', 'dp_swing_ros', *shlex.split(command), '--jobs', '1',
         '--duration', '3', '--no-figures', '--output', 'campaign'], cwd=tmp_path,
        capture_output=True, text=True,
        env={**os.environ, 'PYTHONPATH': f'{site}{os.pathsep}{TOP}'})
    assert done.returncode == 0, done.stdout + done.stderr
    assert re.findall(r'^ilqr(?::model=kutta)?: held (\d) of 1', done.stdout, re.M) == ['1', '1']
