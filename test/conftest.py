# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What all tests share: a ROS domain for each worker, seeded numbers, processes that end."""

from contextlib import contextmanager
import fcntl
from functools import cache
import json
import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile
import time

from domains import claim_domain
import numpy as np
import pytest

from dp_swing_ros import provenance
from dp_swing_ros.executables import ENDING

pytest_plugins = ['spent']

DOMAIN, LOCK = claim_domain()
os.environ['ROS_DOMAIN_ID'] = str(DOMAIN)
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
LOGS = tempfile.TemporaryDirectory(prefix='dp_swing_ros_test_log_')  # gone when the tests end
os.environ['ROS_LOG_DIR'] = LOGS.name
os.environ['FASTRTPS_DEFAULT_PROFILES_FILE'] = str(
    Path(__file__).parents[1] / 'config' / 'fast_discovery.xml')

provenance.commit = cache(provenance.commit)   # asks git, and need not do so for every run

# A script ignores SIGINT for what it starts in the background, nohup SIGHUP. So do these tests,
# but by a handler, which unlike SIG_IGN ends at exec: what they start obeys, as in a terminal.
for number in ENDING:
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, lambda *_: None)

BENCHMARKS = Path(__file__).parents[1] / 'benchmarks'
PATIENCE = 120.0  # [s] for what should take one, and may wait for compilers
TURN = 0.02       # [s] at most, for a callback
HELD_UP = 5.0     # [s] of such turns at least, where all of the time passes at once
LAST_WORDS = 4000  # characters of a node that a failure shows
STARTED = []       # nodes of the tests that are underway


@pytest.hookimpl(optionalhook=True)   # without pytest-xdist nobody asks
def pytest_xdist_auto_num_workers():
    """Return how many test processes there are: nodes wait for each other, and cores idle."""
    return min(os.cpu_count() * 3 // 2, 8)


def pytest_collection_modifyitems(items):
    """Begin with what takes longest, nodes and whole runs, so that no process is left with it."""
    top = Path(__file__).parent
    items.sort(key=lambda item: item.path.relative_to(top).parts[0] not in (
        'console', 'nodes', 'rerun', 'tools', item.path.name))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """Show with a failure what the nodes around it have printed."""
    report = yield
    if report.failed:
        report.sections += [(f'{node.name} has printed', node.output()[-LAST_WORDS:])
                            for node in STARTED]
    return report


@pytest.fixture
def rng():
    """Return random numbers that are the same in every run."""
    return np.random.default_rng(20)


def wait_until(condition, timeout=PATIENCE):
    """Wait for a condition; return whether it came true."""
    end = time.monotonic() + timeout
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.02)
    return condition()


def spin_until(executor, condition, timeout=PATIENCE):
    """
    Let callbacks come until a condition holds; return whether it did.

    Where this process was held up all that time, what has come meanwhile is taken still.
    """
    end, turns = time.monotonic() + timeout, min(timeout, HELD_UP) / TURN
    while not (over := condition()) and (turns > 0 or time.monotonic() < end):
        executor.spin_once(TURN)
        turns -= 1
    return bool(over)


class NodeProcess:
    """An executable of the package, started as the user starts it, or a script of benchmarks/."""

    def __init__(self, name, log, parameters=(), arguments=(), environment=(), options=()):
        words = [f'{key}:={json.dumps(value)}' for key, value in dict(parameters).items()]
        ros = ['--ros-args'] if words or arguments else []
        for word in words:
            ros += ['-p', word]
        command = [sys.executable, BENCHMARKS / name] if name.endswith('.py') else \
            ['ros2', 'run', 'dp_swing_ros', name]
        self.name, self.log = name, log
        with log.open('wb') as output:
            self.popen = subprocess.Popen(
                [*command, *options, *ros, *arguments],
                stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
                start_new_session=True,
                env={**os.environ, 'PYTHONUNBUFFERED': '1', **dict(environment)})

    def output(self):
        """Return all that it has printed so far."""
        return self.log.read_text(errors='replace')

    def complaint(self):
        """Return what it has printed but its first line."""
        return self.output().removeprefix(f'{self.name}: loading\n')

    def wait_for(self, text, timeout=PATIENCE):
        """Wait until it prints the text; fail if it ends or is silent instead."""
        found = wait_until(lambda: text in self.output() or self.popen.poll() is not None, timeout)
        assert found and text in self.output(), f'{text!r} not in: {self.output()}'

    def wait(self, timeout=PATIENCE):
        """Wait for its end and return the exit code."""
        return self.popen.wait(timeout)

    def stop(self, number=signal.SIGINT, timeout=PATIENCE):
        """Send a signal to the process and what it started; return the exit code."""
        self.signal(number)
        return self.wait(timeout)

    def signal(self, number):
        """Send a signal to its own process group."""
        try:
            os.killpg(self.popen.pid, number)
        except ProcessLookupError:
            pass


@pytest.fixture
def here(tmp_path, monkeypatch):
    """Work in an empty folder, and keep the signals of the test run."""
    monkeypatch.chdir(tmp_path)
    handlers = {number: signal.getsignal(number) for number in ENDING}
    yield tmp_path
    for number, handler in handlers.items():
        signal.signal(number, handler)


@pytest.fixture(scope='session')
def lockstep_bag(tmp_path_factory):
    """Return the bag of a run of plant, mpc and logger in lockstep, one for all test processes."""
    here = tmp_path_factory.getbasetemp()
    shared = here.parent if 'PYTEST_XDIST_WORKER' in os.environ else here
    with (shared / 'lockstep.lock').open('w') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        bag = shared / 'lockstep' / 'run' / 'bag'
        if not bag.exists():
            from one_process import record   # a second of loading
            making = shared / f'lockstep_{os.getpid()}'
            record(making, '--lockstep', '--duration', '5')
            making.rename(shared / 'lockstep')   # as a whole, or not at all
    return bag


@contextmanager
def starting(folder):
    """Yield a function that starts a node with its log in a folder; in the end none is left."""
    started = []

    def start(name, parameters=(), arguments=(), environment=(), options=()):
        log = folder / f'{name}_{len(started)}.log'
        started.append(NodeProcess(name, log, parameters, arguments, environment,
                                   options))
        STARTED.append(started[-1])
        return started[-1]

    try:
        yield start
    finally:
        for process in started:
            STARTED.remove(process)
            process.signal(signal.SIGKILL)
            process.popen.wait()


@pytest.fixture
def start_node(tmp_path):
    """Return a function that starts a node; at the end of the test no process is left."""
    with starting(tmp_path) as start:
        yield start
