# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What other packages offer, as they are installed: a module and its entry points."""

import os
import subprocess
import sys

import pytest

SOLVER = """
from dp_swing_ros.solvers.descent import ILQR
class Mine(ILQR):
    pass
"""


@pytest.fixture
def site(tmp_path):
    """Return a folder of packages with three solvers, of which the first can be had."""
    (tmp_path / 'my_mpc.py').write_text(SOLVER)
    (tmp_path / 'broken.py').write_text('import nowhere')
    about = tmp_path / 'my_mpc-1.0.dist-info'
    about.mkdir()
    (about / 'METADATA').write_text('Metadata-Version: 2.1\nName: my_mpc\nVersion: 1.0\n')
    (about / 'entry_points.txt').write_text(
        '[dp_swing_ros.solvers]\nmine = my_mpc:Mine\nbroken = broken:Broken\nddp = my_mpc:Mine\n')
    return tmp_path


@pytest.mark.parametrize('first', ['my_mpc', 'dp_swing_ros'])
def test_what_others_offer_is_there_whoever_is_imported_first(site, first):
    """A package's own tests, and its users' scripts, import the package before this one."""
    done = subprocess.run(
        [sys.executable, '-c', f'import {first}, my_mpc, dp_swing_ros as dp; '
         'print(*dp.SOLVERS, dp.SOLVERS["mine"] is my_mpc.Mine, dp.SOLVERS["ddp"].__module__)'],
        env={**os.environ, 'PYTHONPATH': f'{site}{os.pathsep}{os.environ["PYTHONPATH"]}'},
        capture_output=True, text=True)
    assert done.stdout.split() == ['ilqr', 'ddp', 'mppi', 'mine', 'True',
                                   'dp_swing_ros.solvers.descent'], done.stderr
    for words in ("my_mpc:Mine is left out: dp_swing_ros.solvers has 'ddp' already",
                  "'broken' of dp_swing_ros.solvers, cannot be imported: ModuleNotFoundError"):
        assert done.stderr.count(words) == 1
