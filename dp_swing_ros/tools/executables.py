# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What `ros2 run dp_swing_ros demo` and the other tools call.

Nothing here is slow to import, so that a signal that comes while a tool is still loading ends the
process without a word.
"""

from functools import partial
from importlib import import_module
import os
import signal

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
INTERRUPTED = 130   # exit code


def end_quietly() -> None:
    """End this process at any signal that asks for it, until a tool has its own way to end."""
    for number in ENDING:
        # a script ignores SIGINT for what it starts in the background, nohup SIGHUP
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, lambda *_: os._exit(INTERRUPTED))


def _start(name: str) -> int:
    end_quietly()
    code: int = import_module(f'dp_swing_ros.tools.{name}').main()
    return code


analyse = partial(_start, 'analyse')
compare = partial(_start, 'compare')
demo = partial(_start, 'demo')
evaluate = partial(_start, 'evaluate')
export = partial(_start, 'export')
identify = partial(_start, 'identify')
parameters = partial(_start, 'parameters')
recover = partial(_start, 'recover')
verify = partial(_start, 'verify')
