# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tutorial's commands and snippets, as they are printed; those with nodes are only parsed."""

import os
from pathlib import Path
import re
import shlex
import shutil
import subprocess
import sys

import pytest
from real_bags import record

from dp_swing_ros.__main__ import TOOLS
from dp_swing_ros.declarations import DECLARATIONS
from dp_swing_ros.nodes.parameters import LoggerParameters, named
from dp_swing_ros.parameters import checked
from dp_swing_ros.parameters.files import value_of
from dp_swing_ros.tools.demo import command_line

TOP = Path(__file__).parents[1]
PAGE = (TOP / 'docs' / 'tutorial.md').read_text()
COMMANDS = re.findall(r'^    ros2 run dp_swing_ros (.*)$', PAGE, re.M)
# an episode takes as long as it lasts with most solvers, and longer with the tutorial's own
SHORT = {'evaluate': ['--duration', '1', '--jobs', '1', '--no-figures']}


def blocks(language):
    return re.findall(rf'^```{language}\n(.*?)^```', PAGE, re.M | re.S)


def commands(names):
    """Return the commands of some executables, as words."""
    return [words for words in map(shlex.split, COMMANDS) if words[0] in names]


@pytest.fixture(scope='module')
def here(tmp_path_factory):
    """Work where a reader would, with the bags of the first steps and the solver of the last."""
    folder = tmp_path_factory.mktemp('tutorial')
    (folder / 'worse.yaml').write_text(*blocks('yaml'))
    (folder / 'my_solver').mkdir()
    (folder / 'my_solver' / 'pyproject.toml').write_text(*blocks('toml'))
    solver, = (block for block in blocks('python') if 'class Search:' in block)
    (folder / 'my_solver' / 'search.py').write_text(solver)
    subprocess.run([sys.executable, '-m', 'pip', 'install', '--quiet', '--no-deps',
                    '--no-build-isolation', '--target', folder / 'site', folder / 'my_solver'],
                   check=True)
    (folder / 'my_run').mkdir()
    record(folder / 'files', '--lockstep', '--duration', '1.5').rename(folder / 'my_run' / 'bag')
    shutil.copytree(folder / 'my_run', folder / 'worse')
    return folder


def test_every_executable_is_a_tool_or_a_node():
    assert {words.split()[0] for words in COMMANDS} <= {*TOOLS, *DECLARATIONS, 'logger', 'demo'}


@pytest.mark.parametrize('words', commands(TOOLS), ids=' '.join)
def test_a_tool_runs(words, here):
    done = subprocess.run(
        [sys.executable, '-m', 'dp_swing_ros', *words, *SHORT.get(words[0], [])], cwd=here,
        capture_output=True, text=True,
        env={**os.environ, 'PYTHONPATH': f'{here / "site"}{os.pathsep}{TOP}'})
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize('words', commands({'demo'}), ids=' '.join)
def test_the_demo_takes_its_arguments(words):
    if 'search' in words:       # which is not installed here
        words = [word.replace('search', 'ilqr') for word in words]
    assert command_line().parse_args(words[1:])


@pytest.mark.parametrize('words', commands({*DECLARATIONS, 'logger'}), ids=' '.join)
def test_a_node_has_its_parameters(words):
    given = dict(re.findall(r'-p (\S+?):=(\S+)', ' '.join(words)))
    if words[0] == 'logger':
        for name, value in given.items():
            checked(named(LoggerParameters)[name], value)
    elif given.get('solver') != 'search':
        DECLARATIONS[words[0]].complete(
            {name: value_of(value) for name, value in given.items()})


@pytest.mark.parametrize('block', [each for each in blocks('python') if 'class ' not in each],
                         ids=lambda block: re.search(r'import (\w+)', block)[1])
def test_a_snippet_runs(block, here, monkeypatch, capsys):
    monkeypatch.chdir(here)
    exec(block, {})
    assert capsys.readouterr().out
