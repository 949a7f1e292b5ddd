# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A solver in the shadow of another: it answers the same ticks, but the other's forces act.

It lives in a process of its own, which is given the processor only when nobody else wants it.
"""

from collections.abc import Iterator
import gc
import math
from multiprocessing.connection import Connection, Pipe
import os
import signal
import subprocess
import sys
import time
from typing import Any, NamedTuple

from dp_swing_ros import configuration
from dp_swing_ros.executables import ENDING
from dp_swing_ros.rerun.answers import answer, Tick

RUN = 'import sys; from dp_swing_ros.rerun.shadow import run; run(int(sys.argv[1]))'
FAR = 20      # ticks behind the other: it is given no more until it has caught up
GRACE = 1.0   # [s] it has to end


class Answer(NamedTuple):
    """What a shadow would have done at a tick."""

    number: int        # of the tick
    stamp: int         # [ns] of its state
    status: str
    cost: float
    regret: float      # how much more the plan that was obeyed costs
    force: float       # [N]
    solve_time: float  # [s]


class Shadow:
    """A shadow, as whoever it follows sees it; a ConnectionError says that it has ended."""

    def __init__(self, solver: str, values: dict[str, Any]) -> None:
        """Begin one of a solver; it loads, or compiles, before it is ready."""
        self.solver = solver
        self.connection, there = Pipe()
        with there:
            self.process = subprocess.Popen(
                [sys.executable, '-c', RUN, str(there.fileno())], pass_fds=[there.fileno()],
                stdin=subprocess.DEVNULL, start_new_session=True)
        self.ready = False
        self.behind = 0    # ticks that it has not answered
        self.changed: dict[str, Any] | None = None
        self.reset = False
        self.connection.send({**values, 'solver': solver})

    def change(self, values: dict[str, Any]) -> None:
        """Let it follow another mpc from the next tick on, of these parameters."""
        self.changed = {**values, 'solver': self.solver}

    def follow(self, tick: Tick) -> None:
        """Give it a tick, unless it still loads or is far behind."""
        self.reset = self.reset or tick.reset
        if self.ready and self.behind < FAR:
            self.connection.send(tick._replace(changed=self.changed, reset=self.reset))
            self.changed, self.reset = None, False
            self.behind += 1

    def answers(self, wait: bool = False) -> Iterator[Answer]:
        """Yield its answers that have come, with `wait` until there are no more to come."""
        while wait and (self.behind or not self.ready) or self.connection.poll():
            try:
                received = self.connection.recv()
            except EOFError:
                raise ConnectionError('it closed its end') from None
            if received is None:
                self.ready = True
            else:
                self.behind -= 1
                yield received

    def close(self) -> None:
        """End it."""
        self.connection.close()
        try:
            self.process.wait(GRACE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def run(descriptor: int) -> None:
    """Be a shadow at the end of a pipe, until the other end is closed."""
    for number in ENDING:   # the one that it follows decides
        signal.signal(number, signal.SIG_IGN)
    os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    with Connection(descriptor) as connection:
        try:
            _follow(connection)
        except (ConnectionError, EOFError):
            pass


def _follow(connection: Connection) -> None:
    controller = configuration.controller(connection.recv())
    controller.warm_up()
    gc.collect()
    gc.freeze()
    connection.send(None)
    while True:
        tick: Tick = connection.recv()
        began, deadline = time.perf_counter(), math.inf
        if tick.real_time:   # where a newer one is there, it is time for that
            deadline = began + (-math.inf if connection.poll() else
                                controller.parameters.time_limit)
        plan = answer(controller, tick, counted=False, deadline=deadline)
        stats = plan.stats
        connection.send(Answer(
            tick.number, tick.stamp, stats.status.name, stats.cost, tick.cost - stats.cost,
            plan.first_force(controller.nominal.u_max), time.perf_counter() - began))
        controller.commands.replace_last(tick.force)
