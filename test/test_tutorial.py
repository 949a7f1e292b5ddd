# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tutorial's commands and snippets, as they are printed; those with nodes are only parsed."""

import json
import os
from pathlib import Path
import re
import shlex
import subprocess
import sys

import pytest

from dp_swing_ros.__main__ import TOOLS
from dp_swing_ros.declarations import DECLARATIONS
from dp_swing_ros.estimators.estimator import Estimator
from dp_swing_ros.parameters import checked, named
from dp_swing_ros.parameters.files import value_of
from dp_swing_ros.parameters.nodes import LoggerParameters
from dp_swing_ros.tools.demo import command_line

TOP = Path(__file__).parents[1]
PAGE = (TOP / 'docs' / 'tutorial.md').read_text()
COMMANDS = re.findall(r'^    ros2 run dp_swing_ros (.*)$', PAGE, re.M)
SAID = {'verify': 'the recorded ones to the bit', 'compare': '| search '}
# an episode takes as long as it lasts with most solvers, and longer with the tutorial's own
SHORT = {'evaluate': ['--duration', '0.5', '--seeds', '1', '--jobs', '1', '--no-figures'],
         'analyse': ['--no-animation']}
# in one process, which loads all once and has the solver: bags of the first steps, then arguments
# in, and for each what came of it; the pictures of analyse are looked at in its own test
RUN = """
from contextlib import redirect_stdout
import io, json, pathlib, shutil, sys
from one_process import record
from dp_swing_ros.__main__ import main
from dp_swing_ros.tools import analyse
record(pathlib.Path('files'), '--lockstep', '--duration', '1', '--solver', 'search',
       mpc='{estimator: blend, search: {iterations: 3}}').rename('my_run/bag')
shutil.copytree('my_run', 'worse')
analyse.PICTURES = {'hero': analyse.PICTURES['hero']}
for words in json.load(sys.stdin):
    with redirect_stdout(io.StringIO()) as printed:
        code = main(words)
    print(json.dumps([code, printed.getvalue()]))
"""


def blocks(language):
    return re.findall(rf'^```{language}\n(.*?)^```', PAGE, re.M | re.S)


def commands(names):
    """Return the commands of some executables, as words."""
    return [words for words in map(shlex.split, COMMANDS) if words[0] in names]


def module(name):
    """Return the code of a module of the last steps."""
    code, = (block for block in blocks('python') if f'class {name.capitalize()}:' in block)
    return code


@pytest.fixture(scope='module')
def here(tmp_path_factory):
    """Work where a reader would, with the solver of the last steps."""
    folder = tmp_path_factory.mktemp('tutorial')
    (folder / 'worse.yaml').write_text(*blocks('yaml'))
    (folder / 'my_solver').mkdir()
    toml, more = blocks('toml')
    toml = toml.replace("py-modules = ['search']", "py-modules = ['search', 'blend']")
    (folder / 'my_solver' / 'pyproject.toml').write_text(f'{toml}\n{more}')
    for name in ('search', 'blend'):
        (folder / 'my_solver' / f'{name}.py').write_text(module(name))
    subprocess.run([sys.executable, '-m', 'pip', 'install', '--quiet', '--no-deps',
                    '--no-build-isolation', '--target', folder / 'site', folder / 'my_solver'],
                   check=True)
    (folder / 'my_run').mkdir()
    return folder


def test_every_executable_is_a_tool_or_a_node():
    assert {words.split()[0] for words in COMMANDS} <= {*TOOLS, *DECLARATIONS, 'logger', 'demo'}


@pytest.fixture(scope='module')
def ran(here):
    """Return exit code and output of each command of a tool, and the errors of all."""
    several = [[*words, *SHORT.get(words[0], [])] for words in commands(TOOLS)]
    done = subprocess.run(
        [sys.executable, '-c', RUN], cwd=here, input=json.dumps(several), capture_output=True,
        text=True, env={**os.environ, 'PYTHONPATH': os.pathsep.join(
            [str(here / 'site'), *sys.path])})
    found = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(found) == len(several), done.stderr
    return found, done.stderr


@pytest.mark.parametrize(('number', 'words'), enumerate(commands(TOOLS)), ids=str)
def test_a_tool_runs(number, words, ran):
    found, errors = ran
    code, printed = found[number]
    assert code == 0, printed + errors
    assert SAID.get(words[0], '') in printed


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
def test_a_snippet_runs(block, here, ran, monkeypatch, capsys):   # on the bags that ran made
    monkeypatch.chdir(here)
    exec(block, {})
    assert capsys.readouterr().out


def test_the_estimator_has_all_that_the_protocol_asks_for():
    found = {}
    exec(module('blend'), found)
    assert {name for name in vars(Estimator) if not name.startswith('_')} <= {*dir(found['Blend'])}
