# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What `ros2 run dp_swing_ros plant`, mpc, relay, logger and replay call.

Nothing here is slow to import, so that a first line comes at once, and a signal that comes before
the node is there ends the process without a word.
"""

from collections.abc import Callable
from functools import partial
from importlib import import_module
import os
import signal
import sys
from typing import Any


def on_signals(handler: Callable[..., Any]) -> None:
    """Call a handler on every signal that asks the process to end."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        # a script ignores SIGINT for what it starts in the background, nohup means its SIGHUP
        if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler)


def _start(name: str) -> int:
    on_signals(lambda *_: os._exit(0))
    if {'-h', '--help'} & set(sys.argv[1:]):
        print(*import_module('dp_swing_ros.nodes.help').lines(name), sep='\n')
        return 0
    print(f'{name}: loading', flush=True)
    code: int = import_module(f'dp_swing_ros.nodes.{name}').main()
    return code


plant = partial(_start, 'plant')
mpc = partial(_start, 'mpc')
relay = partial(_start, 'relay')
logger = partial(_start, 'logger')
replay = partial(_start, 'replay')
