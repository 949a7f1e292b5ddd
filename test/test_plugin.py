# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The examples of packages with a solver: that tools find them; what sampled iLQR solves."""

from importlib.util import find_spec
import math
import os
from pathlib import Path
import shutil
import subprocess
import sys

import numpy as np
import pytest
from sampled_ilqr import SampledILQR

from dp_swing_ros.control import controllers
from dp_swing_ros.evaluation.scenarios import SCENARIOS
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.state import hanging
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.solvers import SOLVERS

TOP = Path(__file__).parents[1]
HAS_ACADOS = bool(find_spec('acados') and find_spec('casadi'))
PROBLEM = controllers.problem({})


def solver(**parameters):
    return SampledILQR(PROBLEM, SampledILQR.Parameters(**parameters), 0)


def campaign(*contestants, output):
    """Return the words of a short one."""
    return ['evaluate', '--contestants', *contestants, '--scenarios', 'hanging', '--seeds', '1',
            '--duration', '0.5', '--jobs', '1', '--no-figures', '--output', output]


COMMANDS = [
    campaign('sampled_ilqr', 'few=sampled_ilqr:sampled_ilqr.scouts=1', output='campaign'),
    ['evaluate', '--contestants', 'ilqr:sampled_ilqr.scouts=0'],
    *[campaign('acados_rti', 'more=acados_rti:acados_rti.iterations=3', output='acados')]
    * HAS_ACADOS]


@pytest.fixture(scope='module')
def done(tmp_path_factory):
    """Return what came of the commands where the packages are installed."""
    folder = tmp_path_factory.mktemp('plugin')
    names = ['sampled_ilqr', *['acados_rti'] * HAS_ACADOS]
    for name in names:
        shutil.copytree(TOP / 'examples' / name, folder / name)
    subprocess.run([sys.executable, '-m', 'pip', 'install', '--quiet', '--no-deps',
                    '--no-build-isolation', '--target', folder / 'site',
                    *(folder / name for name in names)], check=True)
    return subprocess.run(
        [sys.executable, '-c', f'from dp_swing_ros.__main__ import main\n'
         f'print([main(words) for words in {COMMANDS}])'], cwd=folder, capture_output=True,
        text=True, env={**os.environ, 'PYTHONPATH': f'{folder / "site"}{os.pathsep}{TOP}'})


def test_tools_know_it_and_its_parameters(done):
    codes = [0, 2, *[0] * HAS_ACADOS]
    assert done.stdout.endswith(f'{codes}\n'), done.stdout + done.stderr
    assert 'sampled_ilqr: held' in done.stdout and 'few: held' in done.stdout
    assert "'sampled_ilqr.scouts'" in done.stderr


@pytest.mark.skipif(not HAS_ACADOS, reason='there is no acados; see examples/acados_rti')
def test_tools_know_acados(done):
    assert 'acados_rti: held' in done.stdout and 'more: held' in done.stdout


def test_samples_beyond_the_memory_are_refused_under_its_name():
    with pytest.raises(ParameterError, match='sampled_ilqr.samples is 1000000'):
        SampledILQR(controllers.problem({'horizon': 1000}),
                    SampledILQR.Parameters(samples=1_000_000))


def test_one_descent_is_ilqr():
    """Before the first draw it is iLQR with as many passes."""
    ilqr = SOLVERS['ilqr'](PROBLEM, SOLVERS['ilqr'].Parameters(iterations=10))
    expected = ilqr.solve(hanging(), None, math.inf)
    plan = solver(iterations=1, passes=10).solve(hanging(), None, math.inf)
    np.testing.assert_array_equal(plan.U, expected.U)
    np.testing.assert_array_equal(plan.K, expected.K)


def test_samples_find_what_a_descent_alone_does_not():
    ilqr = SOLVERS['ilqr'](PROBLEM, SOLVERS['ilqr'].Parameters(iterations=1000))
    cases = SCENARIOS['random'].cases('random', range(30), None, 10.0)
    states = [np.array(case.plant['initial_state']) for case in cases]
    ratios = [solver().solve(x, None, math.inf).stats.cost
              / ilqr.solve(x, None, math.inf).stats.cost for x in states]
    assert np.median(ratios) < 1.0


def test_where_nothing_is_to_be_found_it_stops():
    plan = solver(iterations=100).solve(np.array([0.0, 0.1, 0.1, 0.0, 0.0, 0.0]), None, math.inf)
    assert plan.stats.status is Status.COMPLETE
    assert 1 < plan.stats.iterations < 100


@pytest.mark.parametrize('count', [1, 3, 5])
def test_a_solve_that_was_cut_short_can_be_repeated(count):
    """As many descents give the same plan, however many there might have been."""
    short = solver(iterations=count).solve(hanging(), None, math.inf)
    assert short.stats.iterations == count
    cost = solver(iterations=count + 2).solve(hanging(), None, math.inf).stats.cost
    assert cost <= short.stats.cost
    np.testing.assert_array_equal(
        short.U, solver(iterations=count).solve(hanging(), None, math.inf).U)
