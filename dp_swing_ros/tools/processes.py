# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Executables of the package as processes that are watched, and never left behind."""

from collections.abc import Iterable, Mapping
import contextlib
import json
import os
from pathlib import Path
import shutil
import signal
import subprocess
import time

from dp_swing_ros.errors import UserError

GRACE = 10.0     # [s] a process has to end after SIGINT
LAST_LINES = 12  # of a log, shown when its process fails
ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def interrupt_on_signals() -> None:
    """Raise KeyboardInterrupt at every signal that asks this process to end."""
    for number in ENDING:
        # nohup ignores SIGHUP, and means it
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, signal.default_int_handler)


class ProcessError(UserError):
    """A process failed; the message names it and ends with the last lines of its log."""


class Process:
    """One executable under `ros2 run`, in a session of its own, its output in a file."""

    def __init__(self, name: str, parameters: Mapping[str, object], log: Path,
                 parameter_files: Iterable[Path] = ()) -> None:
        """
        Start it with ROS parameters, those of the files first.

        Raises UserError where there is no `ros2`.
        """
        ros2 = shutil.which('ros2')
        if ros2 is None:
            raise UserError('there is no ros2 on the PATH; source the setup of ROS or of the '
                            'virtual environment first')
        command = [ros2, 'run', 'dp_swing_ros', name, '--ros-args']
        for file in parameter_files:
            command += ['--params-file', str(file.resolve())]
        for key, value in parameters.items():
            # JSON is YAML that cannot be misread: 10.0 stays a float, '2024' a text
            command += ['-p', f'{key}:={json.dumps(value)}']
        self.name, self._log = name, log
        self._read = 0  # characters of the log
        with log.open('wb') as output:
            self._process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
                env={**os.environ, 'PYTHONUNBUFFERED': '1'}, start_new_session=True)

    @property
    def running(self) -> bool:
        """Return whether it has not ended yet."""
        return self._process.poll() is None

    def check(self) -> None:
        """Raise ProcessError if it has ended."""
        if not self.running:
            raise self._failure(f'ended early with exit code {self._process.returncode}')

    def interrupt(self) -> None:
        """Ask it, and whatever it started, to end."""
        self._signal(signal.SIGINT)

    def kill(self) -> None:
        """End what is left of it and of whatever it started."""
        self._signal(signal.SIGKILL)
        self._process.wait()

    def end(self) -> None:
        """Interrupt it and wait; raise ProcessError if it ended before, or as `finish` does."""
        self.check()
        self.interrupt()
        self.finish()

    def finish(self) -> None:
        """Wait for its end; raise ProcessError if it is late or the exit code is not 0."""
        try:
            code = self._process.wait(GRACE)
        except subprocess.TimeoutExpired:
            raise self._failure(f'did not end within {GRACE:g} s') from None
        if code != 0:
            raise self._failure(f'ended with exit code {code}')

    def new_lines(self) -> list[str]:
        """Return the whole lines that it has written since the last call."""
        text = self._log.read_text(errors='replace')
        end = text.rfind('\n') + 1
        lines = text[self._read:end].splitlines()
        self._read = max(self._read, end)
        return lines

    def _signal(self, number: int) -> None:
        # the group outlives its first process while anything of it runs
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, number)

    def _failure(self, what: str) -> ProcessError:
        lines = self._log.read_text(errors='replace').splitlines()[-LAST_LINES:]
        return ProcessError('\n'.join([f'{self.name} {what}; the end of {self._log}:',
                                       *(f'    {line}' for line in lines)]))


class Crew:
    """The processes of one run; when the run is over, however it ended, so are they."""

    def __init__(self) -> None:
        self._processes: list[Process] = []

    def __enter__(self) -> 'Crew':
        return self

    def start(self, name: str, parameters: Mapping[str, object], log: Path,
              parameter_files: Iterable[Path] = ()) -> Process:
        """Start a process that belongs to the crew; as Process does."""
        self._processes.append(Process(name, parameters, log, parameter_files))
        return self._processes[-1]

    def check(self) -> None:
        """Raise ProcessError if one has ended."""
        for process in self._processes:
            process.check()

    def __exit__(self, *error: object) -> None:
        """Ask those that still run to end, wait, and kill what is left."""
        # a second Ctrl-C must not leave processes behind
        handlers = [signal.signal(number, signal.SIG_IGN) for number in ENDING]
        try:
            left = [process for process in self._processes if process.running]
            for process in left:
                process.interrupt()
            end = time.monotonic() + GRACE
            while any(process.running for process in left) and time.monotonic() < end:
                time.sleep(0.05)
            for process in self._processes:
                process.kill()
        finally:
            for number, handler in zip(ENDING, handlers):
                signal.signal(number, handler)
