# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What processes take of the machine, as Linux counts it, and processes that take all of it."""

from array import array
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, ExitStack
import math
import os
from pathlib import Path
import subprocess
import sys
from typing import NamedTuple

import numpy as np

from dp_swing_ros.pendulum.state import Array

PAGE = os.sysconf('SC_PAGE_SIZE')     # [bytes]
TICK = 1 / os.sysconf('SC_CLK_TCK')   # [s]
USER, SYSTEM = 11, 12   # places in /proc/PID/stat after the name, whatever that holds
WARM, FIRST, LAST = 60.0, 10.0, 0.1   # [s], [s] after that, share of the run at its end
# ends with its parent, even where that was killed
BURN = """
import os, sys
while os.getppid() == int(sys.argv[1]):
    for _ in range(1_000_000):
        pass
"""


class Usage(NamedTuple):
    """
    What a process took of the machine.

    Shapes: t (K,) [s] from the first state, resident and private memory (K,) [bytes], processor
    time (K,) [s].
    """

    t: Array
    resident: Array
    private: Array
    processor: Array

    @property
    def share(self) -> float:
        """Return the processor time in a second, NaN where it was seen but once."""
        passed = np.ptp(self.t) if len(self.t) else 0.0
        return float(np.ptp(self.processor) / passed) if passed > 0 else math.nan

    @property
    def growth(self) -> float:
        """
        Return by how much the resident memory grew [bytes], NaN where the run is too short.

        From the ten seconds after the first minute to the last tenth; medians.
        """
        if not len(self.t):
            return math.nan
        first = (self.t >= WARM) & (self.t < WARM + FIRST)
        last = self.t >= (1 - LAST) * self.t[-1]
        if not first.any() or self.t[last][0] < WARM + FIRST:
            return math.nan
        return float(np.median(self.resident[last]) - np.median(self.resident[first]))


class Resources:
    """Memory and processor time of processes, sampled whenever asked."""

    def __init__(self, pids: Mapping[str, int]) -> None:
        """Take the processes by their names."""
        self.pids = pids
        self.rows = {name: tuple(array('d') for _ in Usage._fields) for name in pids}

    def sample(self, t: float) -> None:
        """Look at all that still run, at a time [s]."""
        for name, pid in self.pids.items():
            try:
                _, resident, shared, *_ = Path(f'/proc/{pid}/statm').read_text().split()
                stat = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
            except OSError:   # it has ended
                continue
            # not smaps_rollup: it takes 5 ms, through which the process may have to wait
            values = (t, PAGE * int(resident), PAGE * (int(resident) - int(shared)),
                      TICK * (int(stat[USER]) + int(stat[SYSTEM])))
            for column, value in zip(self.rows[name], values):
                column.append(value)

    def usage(self) -> dict[str, Usage]:
        """Return what was seen, by the names of the processes."""
        return {name: Usage(*map(np.array, rows)) for name, rows in self.rows.items()}


@contextmanager
def burning(count: int) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Keep as many processors busy as there are, or fewer, by a process each; yield those."""
    with ExitStack() as stack:
        burners = []
        for _ in range(count):
            burner = stack.enter_context(subprocess.Popen(
                [sys.executable, '-c', BURN, str(os.getpid())], stdin=subprocess.DEVNULL,
                start_new_session=True))
            stack.callback(burner.kill)
            burners.append(burner)
        yield burners
