# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Calls of command lines, each in a process of its own that may use only so much."""

from importlib import import_module
import multiprocessing
import os
from pathlib import Path
import re
import resource
import sys

SECONDS, MEMORY = 15, 3 << 30  # of a processor; [bytes] of addresses, most of them libraries
PATIENCE = 120                 # [s]

# they are forks of one process that has imported all, which takes longer than most calls
FORKS = multiprocessing.get_context('forkserver')
FORKS.set_forkserver_preload([f'dp_swing_ros.{module}' for module in (
    'tools.analyse', 'tools.compare', 'tools.evaluate', 'tools.export', 'tools.identify',
    'tools.import_log', 'tools.recover', 'tools.verify', 'nodes.replay')])


def called(module, arguments, folder, room=None):
    """
    Call the main function of a module within the limits; return code and what it printed.

    With room [bytes], it may take no more than this beside what it has; maps of files are free.
    """
    output = folder / 'output.txt'
    process = FORKS.Process(target=call, args=(module, arguments, folder, output, room))
    process.start()
    process.join(PATIENCE)
    process.kill()
    shown = output.read_text()
    assert 'Traceback' not in shown, shown
    assert process.exitcode in (0, 1, 2), (process.exitcode, shown)
    return process.exitcode, shown


def call(module, arguments, folder, output, room):
    """Limit this process, and call the main function in it."""
    os.chdir(folder)
    with output.open('wb') as file:
        for stream in (sys.stdout, sys.stderr):
            os.dup2(file.fileno(), stream.fileno())
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    if room is None:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    else:
        has = re.search(r'VmData:\s+(\d+) kB', Path('/proc/self/status').read_text())
        resource.setrlimit(resource.RLIMIT_DATA, (1024 * int(has[1]) + room,) * 2)
    sys.exit(import_module(f'dp_swing_ros.{module}').main(arguments))
