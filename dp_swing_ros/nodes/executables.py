# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What `ros2 run dp_swing_ros plant`, mpc, logger and replay call.

Nothing here is slow to import, so that a first line comes at once, and a signal that comes before
the node is there ends the process without a word.
"""

from importlib import import_module
import os
import signal
import sys

HELP = {'-h', '--help'}


def plant() -> int:
    """Run the plant."""
    return _start('plant')


def mpc() -> int:
    """Run the mpc."""
    return _start('mpc')


def logger() -> int:
    """Run the logger."""
    return _start('logger')


def replay() -> int:
    """Run the replay."""
    return _start('replay')


def _start(name: str) -> int:
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        # a script ignores SIGINT for what it starts in the background, nohup means its SIGHUP
        if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, lambda *_: os._exit(0))
    if HELP & set(sys.argv[1:]):
        print(import_module('dp_swing_ros.nodes.help').help_of(name))
        return 0
    print(f'{name}: loading', flush=True)
    code: int = import_module(f'dp_swing_ros.nodes.{name}').main()
    return code
