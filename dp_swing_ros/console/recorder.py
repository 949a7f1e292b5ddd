# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recordings: a logger of their own, and a report on each when it is done; as processes."""

from collections.abc import Sequence
from datetime import datetime
import json
from pathlib import Path
import signal
import subprocess
import sys
import time
from typing import Any, NamedTuple
from urllib.parse import quote

from dp_swing_ros.console.requests import RequestError

LOGGER = 'logger_of_console'   # the name of its node
BAG, REPORT, REPORT_LOG = 'bag', 'report.html', 'report.log'
GRACE, REPORTING = 20.0, 5.0   # [s] for a logger to end, which may have much to write; a report
SHOWN = 300      # [characters] of a log in an error


class Finished(NamedTuple):
    """A recording that is done."""

    name: str
    reported: bool

    def links(self) -> dict[str, Any]:
        """Return it for the page."""
        place = f'/recordings/{quote(self.name)}'
        return {'name': self.name, 'bag': f'{place}/{BAG}/{BAG}_0.mcap',
                'report': f'{place}/{REPORT}' if self.reported else None}


class Recorder:
    """One recording at a time, below a folder; `poll` tells what has become of it."""

    def __init__(self, recordings: Path) -> None:
        """Take the folder, which is made where it is needed."""
        self.recordings = recordings
        self.folder: Path | None = None    # of the recording that goes on
        self.since = 0.0                   # [s] of the wall clock
        self.finished: list[Finished] = []
        self._logger: subprocess.Popen[bytes] | None = None
        self._ending = False
        self._reports: dict[str, subprocess.Popen[bytes]] = {}   # that are being made

    def start(self, topics: Sequence[str]) -> Path:
        """Begin to record topics; return the folder. Raises RequestError."""
        if self.folder is not None:
            raise RequestError(f'{self.folder} is being recorded already')
        folder = self.recordings / f'console_{datetime.now():%Y%m%d_%H%M%S}'
        try:
            folder.mkdir(parents=True)
        except OSError as error:
            raise RequestError(f'cannot make {folder}: {error.strerror}') from None
        parameters = {'output': str(folder / BAG), 'progress_period': 0.0, 'topics': topics}
        words = [word for name, value in parameters.items()
                 for word in ('-p', f'{name}:={json.dumps(value)}')]
        self._logger = _begin(folder / 'logger.log', 'logger', '--ros-args',
                              '-r', f'__node:={LOGGER}', *words)
        self.folder, self.since, self._ending = folder, time.time(), False
        return folder

    def stop(self) -> Path:
        """Ask the logger to end; return the folder. Raises RequestError where there is none."""
        if self._logger is None or self.folder is None:
            raise RequestError('nothing is being recorded')
        self._ending = True
        self._logger.send_signal(signal.SIGINT)
        return self.folder

    def poll(self) -> str:
        """Go on with what has ended; return what went wrong, if anything did."""
        for name, report in list(self._reports.items()):
            if report.poll() is not None:
                del self._reports[name]
                self.finished = [each._replace(reported=report.returncode == 0)
                                 if each.name == name else each for each in self.finished]
                if report.returncode != 0:
                    return f'no report on {name}: {_end_of(self.recordings / name / REPORT_LOG)}'
        if self._logger is None or self.folder is None or self._logger.poll() is None:
            return ''
        folder, failed = self.folder, self._logger.returncode != 0 or not self._ending
        self.folder = self._logger = None
        if failed:
            return f'the logger ended: {_end_of(folder / "logger.log")}'
        self.finished.append(Finished(folder.name, False))
        self._reports[folder.name] = _begin(
            folder / REPORT_LOG, 'analyse', str(folder / BAG), '--output', str(folder),
            '--no-animation', before=('nice', '-n', '19'))
        return ''

    def close(self) -> None:
        """End what still goes on, so that a bag is whole."""
        waits = [(report, REPORTING) for report in self._reports.values()]
        if self._logger is not None:
            self._logger.send_signal(signal.SIGINT)
            waits.insert(0, (self._logger, GRACE))
        for process, patience in waits:
            try:
                process.wait(patience)
            except subprocess.TimeoutExpired:
                process.kill()

    def state(self) -> dict[str, Any]:
        """Return what the page shows of it."""
        return {'kind': 'recording', 'folder': None if self.folder is None else str(self.folder),
                'since': None if self.folder is None else self.since,
                'finished': [each.links() for each in self.finished]}


def _end_of(log: Path) -> str:
    return log.read_text(errors='replace').strip()[-SHOWN:]


def _begin(log: Path, name: str, *arguments: str,
           before: tuple[str, ...] = ()) -> 'subprocess.Popen[bytes]':
    """
    Begin a tool or a node as a process that no Ctrl-C in this terminal reaches.

    It ends with this one, however that ends: a bag is whole even where the console was killed.
    """
    with log.open('wb') as output:
        return subprocess.Popen(
            ['setpriv', '--pdeathsig', 'INT', *before, sys.executable, '-m', 'dp_swing_ros', name,
             *arguments],
            stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
            start_new_session=True)
