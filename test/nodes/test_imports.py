# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import subprocess
import sys

import pytest

OF_BAGS = ('dp_swing_ros.bags', 'dp_swing_ros.recovery', 'lz4', 'mcap', 'mcap_ros2', 'zstandard')


@pytest.mark.parametrize('node', ['mpc', 'plant'])
def test_plant_and_mpc_load_nothing_of_bags(node):
    code = (f'import sys, dp_swing_ros.nodes.{node}; '
            f'found = set({OF_BAGS}) & set(sys.modules); assert not found, found')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
