# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A plug-in of pytest: which test files took longest, and how many processes they started."""

from collections import Counter
import sys

import pytest

STARTED = 'started'   # processes, of a phase of a test
FILES = 40            # that a run names in the end
starts = [0]
seconds, processes = Counter(), Counter()   # of each file, in the process that reports


def count_starts(event, _):
    """Count a process that is started, by whomever."""
    starts[0] += event == 'subprocess.Popen'


sys.addaudithook(count_starts)


def pytest_runtest_logstart():
    """Forget what was started between tests, as by pytest itself."""
    starts[0] = 0


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport():
    """Say in the report of a phase of a test how many processes were started in it."""
    outcome = yield
    outcome.get_result().user_properties.append((STARTED, starts[0]))
    starts[0] = 0


def pytest_runtest_logreport(report):
    """Add up what the tests of a file took."""
    file = report.nodeid.partition('::')[0]
    seconds[file] += report.duration
    processes[file] += dict(report.user_properties).get(STARTED, 0)


def pytest_terminal_summary(terminalreporter):
    """Print which files took longest, and how many processes they started."""
    def row(name, spent, started):
        terminalreporter.write_line(
            f'{name:50} {spent:8.1f} s {started:5} process{"es" * (started != 1)}')

    terminalreporter.section('seconds and started processes of test files')
    for file, spent in seconds.most_common(FILES):
        row(file, spent, processes[file])
    row(f'{len(seconds)} file{"s" * (len(seconds) != 1)}', sum(seconds.values()),
        sum(processes.values()))
