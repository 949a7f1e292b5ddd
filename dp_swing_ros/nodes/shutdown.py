# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How a process ends: on a signal, and where its last steps hang.

Fast DDS 2.14 can deadlock when two processes end at the same moment: the end of a participant
(DomainParticipant::set_listener, from rmw_destroy_node) spins for a lock whose holder, a callback
on the end of the other's endpoints, waits for it. It spins with Python's interpreter lock, so no
Python thread or signal handler can help: a timer of the C library calls _exit.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import ctypes
import signal
from typing import Any

CLOCK_MONOTONIC, SIGEV_THREAD = 1, 2  # of Linux


class _Event(ctypes.Structure):
    """The C library's sigevent: call a function with a value in a thread of its own."""

    _fields_ = (('value', ctypes.c_void_p), ('signal', ctypes.c_int), ('notify', ctypes.c_int),
                ('function', ctypes.c_void_p), ('attributes', ctypes.c_void_p),
                ('reserved', ctypes.c_char * 32))


def on_signals(handler: Callable[..., Any]) -> None:
    """Call a handler on every signal that asks the process to end."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        # a script ignores SIGINT for what it starts in the background, nohup means its SIGHUP
        if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler)


@contextmanager
def exit_after(seconds: int, code: int) -> Iterator[None]:
    """End the process with an exit code if what is inside takes longer than this time [s]."""
    libc = ctypes.CDLL(None, use_errno=True)
    event = _Event(value=code, notify=SIGEV_THREAD,
                   function=ctypes.cast(libc._exit, ctypes.c_void_p))
    timer = ctypes.c_void_p()
    if libc.timer_create(CLOCK_MONOTONIC, ctypes.byref(event), ctypes.byref(timer)) != 0:
        raise OSError(ctypes.get_errno(), 'timer_create')
    times = (ctypes.c_long * 4)(0, 0, seconds, 0)   # itimerspec: no interval; first, in s and ns
    libc.timer_settime(timer, 0, times, None)
    try:
        yield
    finally:
        libc.timer_delete(timer)
