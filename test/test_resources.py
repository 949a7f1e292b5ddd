# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import math
import signal
import subprocess
import sys

from conftest import BENCHMARKS, wait_until
import numpy as np
import pytest
from resources import burning, Resources, Usage

IDLE = 'import sys; held = bytearray(50_000_000); print(flush=True); sys.stdin.read()'
KILLED = """
import os, signal
from resources import burning
with burning(2) as burners:
    print(*(burner.pid for burner in burners), flush=True)
    os.kill(os.getpid(), signal.SIGKILL)
"""


def computed(pid):
    """Return for how long [s] a process has computed."""
    now = Resources({'it': pid})
    now.sample(0.0)
    return now.usage()['it'].processor[0]


def test_a_busy_process_and_an_idle_one_are_told_apart_until_they_end():
    """Memory is what a process holds; burners end with the context."""
    with burning(2) as burners, subprocess.Popen(
            [sys.executable, '-c', IDLE], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert [burner.poll() for burner in burners] == [None, None]
        other.stdout.readline()
        resources = Resources({'busy': burners[0].pid, 'idle': other.pid})
        began = computed(burners[0].pid)
        resources.sample(0.0)
        assert wait_until(lambda: computed(burners[0].pid) > began + 0.5)
        resources.sample(1.0)
        other.kill()
    assert [burner.poll() for burner in burners] == [-signal.SIGKILL] * 2
    resources.sample(2.0)
    found = resources.usage()
    assert found['busy'].share > 0.1 > found['idle'].share
    for usage in found.values():
        assert usage.t.tolist() == [0.0, 1.0]   # who has ended is not seen any more
        assert (usage.resident > usage.private).all()
        assert 1e6 < usage.private.min() < usage.resident.max() < 1e9
    assert 50e6 < found['idle'].private[0] < 100e6


def runs(pid):
    try:
        with open(f'/proc/{pid}/stat') as stat:
            return stat.read().rpartition(')')[2].split()[0] != 'Z'
    except OSError:   # it may end at any time
        return False


def test_burners_end_with_a_tool_that_is_killed():
    done = subprocess.run([sys.executable, '-c', KILLED], cwd=BENCHMARKS, capture_output=True,
                          text=True)
    burners = [int(pid) for pid in done.stdout.split()]
    assert len(burners) == 2
    assert wait_until(lambda: not any(map(runs, burners)))


def usage(duration, grown):
    t = np.arange(0.0, duration)
    memory = 1e8 + np.where(t > 70, grown, 0.0) + np.where(t < 60, -3e7, 0.0)
    return Usage(t, memory, 0.5 * memory, 0.25 * t)


@pytest.mark.parametrize('duration, growth', [(600.0, 2e6), (79.0, 2e6), (77.0, None)])
def test_memory_grows_from_the_first_minute_on(duration, growth):
    found = usage(duration, 2e6)
    assert found.growth == growth if growth else math.isnan(found.growth)
    assert found.share == pytest.approx(0.25)


def test_of_a_process_that_was_never_seen_nothing_is_known():
    nothing = Usage(*[np.array([])] * 4)
    assert math.isnan(nothing.growth) and math.isnan(nothing.share)
