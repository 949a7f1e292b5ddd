# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Loads controllers beside the one that runs.

What another solver needs is compiled for seconds, or loaded for tenths of one. A thread would hold
up the ticks, for compilers hold Python's interpreter lock. So a process compiles what is not on
the disk yet, and the thread then loads it from there.
"""

from collections.abc import Callable, Mapping
import json
import os
import subprocess
import sys
from threading import Lock, Thread
from typing import Any, NamedTuple

from dp_swing_ros.control.receding_horizon import RecedingHorizon

COMPILE = ('import json, sys; from dp_swing_ros import configuration; '
           'configuration.controller(json.loads(sys.stdin.read())).warm_up()')
NICENESS = 10     # of the process that compiles
SWITCHING = 5e-4  # [s] after which the thread that loads lets the ticks go on


class Loaded(NamedTuple):
    """A controller that can run at once, and the parameters that it is made from."""

    controller: RecedingHorizon
    values: dict[str, Any]


class Loader:
    """Loads the newest controller that was asked for; one that was overtaken is dropped."""

    def __init__(self, running: RecedingHorizon, on_error: Callable[[str], None]) -> None:
        """Take the controller that is loaded already, and what to call where a thread fails."""
        self.kinds = {kind_of(running)}   # of controllers that have been loaded
        self.on_error = on_error
        self.lock = Lock()
        self.asked: Loaded | None = None
        self.ready: Loaded | None = None
        self.thread: Thread | None = None

    def load(self, controller: RecedingHorizon, values: Mapping[str, Any]) -> None:
        """Load a controller in a thread."""
        with self.lock:
            self.asked, self.ready = Loaded(controller, dict(values)), None
            if self.thread is None:
                sys.setswitchinterval(SWITCHING)
                self.thread = Thread(target=self.run, daemon=True)
                self.thread.start()

    def wait(self) -> None:
        """Wait until all is loaded."""
        thread = self.thread
        if thread is not None:
            thread.join()

    def take(self) -> Loaded | None:
        """Return a controller that has become ready, once."""
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
            except Exception as error:  # noqa: B902
                self.on_error(f'the new parameters cannot be used: {error}')
                continue
            with self.lock:
                if self.asked is None:
                    self.ready = loading

    def prepare(self, loading: Loaded) -> None:
        """Compile and load what a controller needs."""
        kind = kind_of(loading.controller)
        if kind not in self.kinds:
            subprocess.run([sys.executable, '-c', COMPILE], input=json.dumps(loading.values),
                           text=True, check=False, stdout=subprocess.DEVNULL,
                           stderr=subprocess.DEVNULL, preexec_fn=lambda: os.nice(NICENESS))
            self.kinds.add(kind)
        loading.controller.warm_up()


def kind_of(controller: RecedingHorizon) -> tuple[Any, ...]:
    """Return what decides which kernels a controller needs."""
    parameters, (_, cost, _) = controller.parameters, controller.nominal.given
    model = controller.nominal.model
    switches = {name: value for name, value in vars(controller.solver_parameters).items()
                if isinstance(value, (bool, str))}
    return (parameters.solver, *switches.items(), parameters.estimator, cost.angle_error,
            model.integrator, model.pendulum.kind)
