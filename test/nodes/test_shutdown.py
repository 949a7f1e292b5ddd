# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import subprocess
import sys
import time

import pytest

from dp_swing_ros.nodes.process import exit_after


@pytest.mark.parametrize('code', [0, 2])
def test_hang_with_the_interpreter_lock_ends(code):
    # PyDLL keeps the interpreter's lock during the call, as the middleware does.
    script = ('import ctypes\n'
              'from dp_swing_ros.nodes.process import exit_after\n'
              f'with exit_after(1, {code}):\n'
              '    ctypes.PyDLL(None).pause()')
    before = time.monotonic()
    assert subprocess.run([sys.executable, '-c', script], timeout=120).returncode == code
    assert time.monotonic() - before >= 1


def test_what_ends_in_time_is_left_alone():
    with exit_after(1, 7):
        pass
    time.sleep(1.2)
