# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A plug-in of pytest: which test files took longest, by clock and CPU, and what they started."""

from collections import Counter
import os
import sys

import pytest

SPENT = 'spent'       # processes that were started and seconds of CPU, of a phase of a test
FILES = 40            # that a run names in the end
starts, busy = [0], [0.0]
seconds, cpu, processes = Counter(), Counter(), Counter()   # of each file, where it is reported


def count_starts(event, _):
    """Count a process that is started, by whomever."""
    starts[0] += event == 'subprocess.Popen'


sys.addaudithook(count_starts)


def cpu_time():
    """Return the time [s] that this process and those that it has waited for were computing."""
    return sum(os.times()[:4])


def pytest_runtest_logstart():
    """Forget what was done between tests, as by pytest itself."""
    starts[0], busy[0] = 0, cpu_time()


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport():
    """Say in the report of a phase of a test how much was started and computed in it."""
    outcome, now = (yield), cpu_time()
    outcome.get_result().user_properties.append((SPENT, (starts[0], now - busy[0])))
    starts[0], busy[0] = 0, now


def pytest_runtest_logreport(report):
    """Add up what the tests of a file took."""
    file = report.nodeid.partition('::')[0]
    seconds[file] += report.duration
    started, computing = dict(report.user_properties).get(SPENT, (0, 0.0))
    processes[file] += started
    cpu[file] += computing


def pytest_terminal_summary(terminalreporter):
    """Print which files took longest, how much they computed, and how many processes started."""
    def row(name, *figures):
        terminalreporter.write_line('{:50} {:8.1f} s {:8.1f} s {:5}'.format(name, *figures))

    terminalreporter.section('seconds, seconds of CPU and started processes of test files')
    for file, spent in seconds.most_common(FILES):
        row(file, spent, cpu[file], processes[file])
    row(f'{len(seconds)} file{"s" * (len(seconds) != 1)}',
        *(sum(each.values()) for each in (seconds, cpu, processes)))
