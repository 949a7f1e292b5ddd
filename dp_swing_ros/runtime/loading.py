# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Loads controllers beside the one that runs.

What another solver needs is compiled for seconds, or loaded for tenths of one. A thread would hold
up the ticks, for compilers hold Python's interpreter lock. So a process compiles what is not on
the disk yet, and the thread then loads it from there.
"""

from collections.abc import Mapping
import json
import math
import os
import subprocess
import sys
from threading import Lock, Thread
from typing import Any, NamedTuple

from dp_swing_ros.control.receding_horizon import RecedingHorizon
from dp_swing_ros.errors import one_line
from dp_swing_ros.parameters import ParameterError

COMPILE = ('import json, sys; from dp_swing_ros import controller; '
           'controller(json.loads(sys.stdin.read())).warm_up()')
NICENESS = 10     # of the process that compiles
COMPILING = 300.0  # [s] that it has at most


class Loaded(NamedTuple):
    """A controller that can run at once, and the parameters that it is made from."""

    controller: RecedingHorizon
    values: dict[str, Any]
    error: str = ''    # why it cannot be used, if it cannot


class Loader:
    """Loads the newest controller that was asked for; one that was overtaken is dropped."""

    def __init__(self, running: RecedingHorizon) -> None:
        """Take the controller that is loaded already."""
        self.kinds = {kind_of(running)}   # of controllers that have been loaded
        self.slowest = math.inf   # [s] of a tick beyond its time limit
        self.lock = Lock()
        self.asked: Loaded | None = None
        self.ready: Loaded | None = None
        self.thread: Thread | None = None

    def load(self, controller: RecedingHorizon, values: Mapping[str, Any],
             slowest: float) -> None:
        """Load a controller in a thread, whose ticks may be so much late [s]."""
        with self.lock:
            self.slowest = slowest
            self.asked, self.ready = Loaded(controller, dict(values)), None
            if self.thread is None:
                self.thread = Thread(target=self.run, daemon=True)
                self.thread.start()

    def wait(self) -> None:
        """Wait until all is loaded; raises ParameterError where it cannot be used."""
        thread = self.thread
        if thread is not None:
            thread.join()
        if self.ready is not None and self.ready.error:
            raise ParameterError(self.ready.error)

    def take(self) -> Loaded | None:
        """Return a controller that has become ready, or why it cannot be used; once."""
        if self.ready is None:
            return None
        with self.lock:
            ready, self.ready = self.ready, None
        return ready

    def run(self) -> None:
        """Load what is asked for until nothing is."""
        while True:
            with self.lock:
                if self.asked is None:
                    self.thread = None
                    return
                loading, self.asked = self.asked, None
            try:
                self.prepare(loading)
            except BaseException as error:
                loading = loading._replace(error=one_line(error))
            with self.lock:
                if self.asked is None:
                    self.ready = loading

    def prepare(self, loading: Loaded) -> None:
        """Compile and load what a controller needs."""
        kind = kind_of(loading.controller)
        if kind not in self.kinds:
            subprocess.run([sys.executable, '-c', COMPILE], input=json.dumps(loading.values),
                           text=True, check=False, stdout=subprocess.DEVNULL, timeout=COMPILING,
                           stderr=subprocess.DEVNULL, preexec_fn=lambda: os.nice(NICENESS))
            self.kinds.add(kind)
        limit = loading.controller.parameters.time_limit
        taken = loading.controller.warm_up(limit + self.slowest)
        if taken > limit + self.slowest:
            raise ParameterError(f'a tick takes {taken:.2g} s, and time_limit is {limit:g} s; '
                                 'expected fewer samples or a shorter horizon')


def kind_of(controller: RecedingHorizon) -> tuple[Any, ...]:
    """Return what decides which kernels a controller needs."""
    parameters, (_, cost, prediction) = controller.parameters, controller.nominal.parameters
    model = controller.nominal.model
    switches = {name: value for name, value in vars(controller.planner.solver_parameters).items()
                if isinstance(value, (bool, str))}
    return (parameters.solver, *switches.items(), parameters.estimator, cost.angle_error,
            parameters.shown_tries > 0,
            model.integrator, model.pendulum.kind, prediction.dynamics)
