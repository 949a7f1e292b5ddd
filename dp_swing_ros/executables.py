# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What `ros2 run dp_swing_ros NAME` calls.

Nothing here is slow to import, so that a node's first line comes at once, and a signal that comes
while a node or a tool is still loading ends the process without a word.
"""

from collections.abc import Callable
from functools import partial
from importlib import import_module
import os
import signal
import sys
from typing import Any

from dp_swing_ros import environment

ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
MISUSED, INTERRUPTED = 2, 130   # exit codes; the latter of a tool
UNREAD = 128 + signal.SIGPIPE   # and of one whose output nobody reads to its end


def on_signals(handler: Callable[..., Any],
               unless_ignored: tuple[signal.Signals, ...] = ENDING) -> dict[signal.Signals, Any]:
    """
    Call a handler on every signal that asks the process to end; return the handlers before it.

    What is ignored may stay so: a script ignores SIGINT for what it starts in the background, and
    nohup means its SIGHUP.
    """
    return {number: signal.signal(number, handler) for number in ENDING
            if number not in unless_ignored or signal.getsignal(number) is not signal.SIG_IGN}


# a node that a script has started in the background obeys SIGINT all the same
on_signals_to_node = partial(on_signals, unless_ignored=(signal.SIGHUP,))


def end_quietly() -> None:
    """End this process at a signal, until a tool has a way of its own to end."""
    on_signals(lambda *_: os._exit(INTERRUPTED))


def piped(work: Callable[[], int]) -> int:
    """Do the work of a tool and return its exit code; its output may go to `head`, which ends."""
    try:
        try:
            return work()
        finally:
            print(end='', flush=True)   # here it may fail, and not after the last line of Python
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return UNREAD


def _node(name: str) -> int:
    on_signals_to_node(lambda *_: os._exit(0))
    if {'-h', '--help'} & set(sys.argv[1:]):
        return piped(partial(show_help, name))
    print(f'{name}: loading', flush=True)
    return _in_ros('nodes', name)


def show_help(name: str) -> int:
    """Print the help of a node, which needs no ROS; return the exit code."""
    print(*import_module('dp_swing_ros.nodes.help').lines(name), sep='\n')
    return 0


def _tool(name: str) -> int:
    end_quietly()
    return piped(lambda: import_module(f'dp_swing_ros.tools.{name}').main())


def _tool_in_ros(name: str) -> int:
    end_quietly()
    return piped(partial(_in_ros, 'tools', name))


def _in_ros(package: str, name: str) -> int:
    """Run what imports ROS, which may end the process then and there."""
    if error := environment.misused():
        print(f'{name}: error: {error}', file=sys.stderr)
        return MISUSED
    code: int = import_module(f'dp_swing_ros.{package}.{name}').main()
    return code


def plays_bag(arguments: list[str]) -> bool:
    """Return whether the arguments of a console name a bag, for which it needs no ROS."""
    return bool(arguments) and arguments[0] not in ('--ros-args', '-h', '--help')


def console() -> int:
    """Show a live run, or one in a bag."""
    return (_tool if plays_bag(sys.argv[1:]) else _node)('console')


plant = partial(_node, 'plant')
mpc = partial(_node, 'mpc')
relay = partial(_node, 'relay')
logger = partial(_node, 'logger')
replay = partial(_node, 'replay')
analyse = partial(_tool, 'analyse')
compare = partial(_tool, 'compare')
demo = partial(_tool_in_ros, 'demo')
evaluate = partial(_tool, 'evaluate')
export = partial(_tool, 'export')
identify = partial(_tool, 'identify')
import_log = partial(_tool, 'import_log')
learn = partial(_tool, 'learn')
parameters = partial(_tool, 'parameters')
recover = partial(_tool, 'recover')
play = partial(_tool_in_ros, 'play')
train = partial(_tool, 'train')
verify = partial(_tool, 'verify')
