# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import subprocess
import sys

import pytest

OF_BAGS = ('dp_swing_ros.bags', 'dp_swing_ros.recovery', 'lz4', 'mcap', 'mcap_ros2', 'zstandard')
OF_CONTROL = ('dp_swing_ros.control', 'dp_swing_ros.declarations', 'dp_swing_ros.kernels',
              'numba', 'scipy')
SLOW = ('matplotlib', 'scipy.optimize', 'scipy.stats', 'torch')


@pytest.mark.parametrize('module, others', [
    ('nodes.mpc', OF_BAGS), ('nodes.plant', OF_BAGS), ('nodes.plant', SLOW),
    ('nodes.logger', OF_CONTROL), ('nodes.replay', OF_CONTROL), ('tools.demo', SLOW)])
def test_what_a_process_does_without_it_does_not_load(module, others):
    code = (f'import sys, dp_swing_ros.{module}; '
            f'found = set({others}) & set(sys.modules); assert not found, found')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
