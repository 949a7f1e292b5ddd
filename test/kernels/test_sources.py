# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Compiled kernels are found by what they are compiled from: no stale ones, no needless ones."""

import ast
import os
from pathlib import Path
import subprocess
import sys

import pytest

from dp_swing_ros.kernels.sources import PACKAGE, sources

KERNELS = sorted(file for file in PACKAGE.rglob('*.py')
                 if '@kernel' in file.read_text() or '@unrolled' in file.read_text())
PLUGIN = {
    'values.py': 'SCALE = 2.0\n',
    'passed.py': 'from .values import SCALE\n',
    'helpers.py': """
from dp_swing_ros.kernels import kernel
from plugin import passed
SCALE = passed.SCALE
@kernel
def helper(x):
    return SCALE * x
""",
    'equations.py': """
from dp_swing_ros.kernels.unrolling import unrolled
@unrolled
def equation(body, rule, x):
    return body.moment() + rule.apply(x)
""",
    'answers.py': """
from dp_swing_ros.kernels import kernel
from plugin.equations import equation
from plugin.helpers import (  # (
    helper)
@kernel
def answer(body, rule, x):
    return helper(x) + equation(body, rule, x) - body.width
""",
    # what is given to the kernel, of which its module does not know
    'bodies.py': """
from typing import NamedTuple
class Body(NamedTuple):
    mass: float
    length: float
    width: float
    def moment(self):
        return 10.0 * self.mass
""",
    'squares.py': """
def apply(x):
    return 100.0 * x
""",
    'rules.py': """
from dp_swing_ros.kernels.compilation import Constant
from plugin.squares import apply
class Rule(Constant):
    def __init__(self):
        super().__init__('rule', Rule)
        self.apply = apply
""",
    'unrelated.py': """
from dp_swing_ros.kernels import kernel
@kernel
def other(x):
    return x
""",
    '__init__.py': '',
}
ASKED = """
import os, sys
import dp_swing_ros.kernels.unrolling   # loads numba, once for all answers
for _ in sys.stdin:
    if not os.fork():
        break
    if os.wait()[1]:
        sys.exit('it failed')
else:
    sys.exit()
from plugin.answers import answer
from plugin.bodies import Body
from plugin.rules import Rule
from plugin.unrelated import other
value = answer(Body(mass=3.0, length=4.0, width=5.0), Rule(), 1.0)
other(1.0)
print(value, *(sum(each.stats.cache_misses.values()) for each in (answer, other)))
"""


@pytest.fixture(scope='module')
def ask(tmp_path_factory):
    """Yield a function that asks the plug-in with some edit: the answer, what was compiled."""
    here = tmp_path_factory.mktemp('sources')

    def answered(file='', old='', new=''):
        (here / 'plugin').mkdir(exist_ok=True)
        for name, text in PLUGIN.items():
            if name == file:
                assert old in text
                text = text.replace(old, new)
            (here / 'plugin' / name).write_text(text)
        print(file=asked.stdin, flush=True)
        value, answer, other = asked.stdout.readline().split()
        return float(value), int(answer), int(other)

    with subprocess.Popen(
            [sys.executable, '-B', '-c', ASKED], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            text=True, cwd=here,
            env={**os.environ, 'NUMBA_CACHE_DIR': str(here / 'cache'),
                 'PYTHONPATH': os.pathsep.join([str(here), str(PACKAGE.parent)])}) as asked:
        assert answered() == (127.0, 1, 1)
        yield answered


@pytest.mark.parametrize('file, old, new, value', [
    ('values.py', '2.0', '4.0', 129.0),
    ('helpers.py', 'SCALE * x', 'SCALE * x + 0.5', 127.5),
    ('equations.py', '+ rule', '- rule', -73.0),
    ('squares.py', '100.0', '200.0', 227.0),
    ('bodies.py', '10.0', '20.0', 157.0),
    ('bodies.py', '    length: float\n    width: float\n', '    width: float\n    length: float\n',
     127.0)])
def test_what_is_in_a_kernel_makes_it_another(ask, file, old, new, value):
    assert ask(file, old, new) == (value, 1, 0)


def test_what_was_compiled_is_found_again(ask):
    assert ask() == (127.0, 0, 0)


def test_what_is_in_no_kernel_leaves_those_of_others(ask):
    assert ask('unrelated.py', 'return x', 'return x  # as it is') == (127.0, 0, 1)


def test_a_module_s_kernels_are_of_its_sources_and_what_it_imports():
    def names(file):
        found = sources(str(PACKAGE / file))
        return {Path(each).relative_to(PACKAGE).as_posix() for each in found}
    assert {'solvers/mppi.py', 'solvers/riccati.py', 'pendulum/integrators.py',
            'kernels/compilation.py', 'kernels/trigonometry.py'} <= names('solvers/mppi.py')
    for other in ('pendulum/derivatives.py', 'estimators/gaussian.py'):
        assert not any(name.startswith('solvers/') for name in names(other))


@pytest.mark.parametrize('file', KERNELS, ids=lambda file: file.relative_to(PACKAGE).as_posix())
def test_all_imports_of_kernels_are_found(file):
    """By reading the text, that is, as by parsing it."""
    found, rooms = sources(str(file)), {Path(each).parent for each in sources(str(file))}
    assert not rooms & {PACKAGE / each for each in ('console', 'nodes', 'tools', 'figures')}
    for each in found:
        for node in ast.walk(ast.parse(Path(each).read_text())):
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith(PACKAGE.name):
                path = PACKAGE.parent.joinpath(*node.module.split('.'))
                paths = [path, *(path / name.name for name in node.names)]
                files = {str(made) for path in paths
                         for made in (path.with_suffix('.py'), path / '__init__.py')}
                assert files & found
                assert {file for file in files if os.path.isfile(file)} <= found
