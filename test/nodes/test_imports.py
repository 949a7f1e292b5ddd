# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import subprocess
import sys

import pytest

OF_BAGS = ('dp_swing_ros.bags', 'dp_swing_ros.recovery', 'lz4', 'mcap', 'mcap_ros2', 'zstandard')
OF_CONTROL = ('dp_swing_ros.control', 'dp_swing_ros.declarations', 'dp_swing_ros.kernels',
              'numba', 'scipy')
SLOW = ('matplotlib', 'scipy.optimize', 'scipy.stats', 'torch')


@pytest.mark.parametrize('modules', [
    {'nodes.plant': OF_BAGS + SLOW, 'nodes.mpc': (*OF_BAGS, 'pandas')},
    {'nodes.logger': OF_CONTROL, 'nodes.replay': OF_CONTROL, 'bags': ('pandas',),
     'tools.demo': SLOW}])
def test_what_a_process_does_without_it_does_not_load(modules):
    """One after another: what is loaded for the first is there for the next."""
    code = '\n'.join(['import sys', *(
        f'import dp_swing_ros.{module}; found = set({others}) & set(sys.modules); '
        f'assert not found, ({module!r}, found)' for module, others in modules.items())])
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
