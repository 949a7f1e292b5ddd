# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Executables of the package as processes, in a ROS domain of their own, never left behind."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
import contextlib
import json
import os
from pathlib import Path
import re
import shutil
import signal
import socket
import subprocess
import sys
import time

from dp_swing_ros.declarations import DECLARATIONS, misspelt
from dp_swing_ros.errors import UserError
from dp_swing_ros.executables import ENDING
from dp_swing_ros.parameters import complete, near, ParameterError
from dp_swing_ros.parameters.files import for_node, is_for, is_of_rclpy, locate, sections
from dp_swing_ros.parameters.nodes import OWN
from dp_swing_ros.pendulum.state import LINKS
from dp_swing_ros.tools.command_lines import postponed, progress

READY = 180.0    # [s] for processes to come up; the first start of an mpc compiles
GRACE = 21.0     # [s] a process has to end after SIGINT; an mpc may brake for 11 of them
LAST_LINES = 12  # of a log, shown when its process fails
DOMAINS = range(102)  # their ports lie below those that Linux gives to anybody
PORTS_PER_DOMAIN, FIRST_PORT = 250, 7400  # Source: the DDSI-RTPS specification, 9.6.1
PARTICIPANTS = 20     # looked for in a domain
# left to themselves, nodes that keep to this machine may take 3 s to find each other
FAST_DISCOVERY = Path('config', 'fast_discovery.xml')


def located(files: Iterable[Path], nodes: Mapping[str, Mapping[str, object]]) -> list[Path]:
    """
    Return where parameter files are, which are for nodes of ours.

    `nodes` are those to be started, by name, with the parameters that prevail over the files.
    Raises ParameterError for a section of no node, and for what one of the nodes would refuse.
    """
    places = list(map(locate, files))
    found = [(place, *section) for place in places for section in sections(place)]
    declared = {**{node: each.fields(max(LINKS)) for node, each in DECLARATIONS.items()}, **OWN}
    for place, pattern, _ in found:
        if not any(is_for(pattern, node) for node in declared):
            raise ParameterError(
                f'{place}, line {pattern.line}: {pattern!r} is no node of this package in the '
                f'root namespace; {near(pattern.rsplit("/", 1)[-1], declared)}')
    for place in places:
        for words in misspelt(section[1:] for section in found if section[0] == place):
            raise ParameterError(f'{place}, {words}')
    for node, given in nodes.items():
        own = for_node([section[1:] for section in found], node, declared[node])
        asked = {name: value for name, value in {**own, **given}.items()
                 if not is_of_rclpy(name)}
        complete(OWN[node] if node in OWN else DECLARATIONS[node].fields_for(asked), asked, node)
    return places


@contextlib.contextmanager
def isolated() -> Iterator[str]:
    """
    Keep this process and its children on this machine and in a domain of their own; yield it.

    What the user has set, a ROS_DOMAIN_ID or a profile of Fast DDS, is kept.
    Raises UserError where no domain is free.
    """
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    os.environ.setdefault('FASTRTPS_DEFAULT_PROFILES_FILE', str(locate(FAST_DISCOVERY).resolve()))
    if os.environ.get('ROS_DOMAIN_ID'):
        yield os.environ['ROS_DOMAIN_ID']
        return
    domain, claim = _claim_domain()
    with claim:
        os.environ['ROS_DOMAIN_ID'] = domain
        try:
            yield domain
        finally:
            os.environ.pop('ROS_DOMAIN_ID', None)


def _claim_domain() -> tuple[str, socket.socket]:
    """Return the first domain without nodes, and the socket that claims it while it is open."""
    for domain in DOMAINS:
        base = FIRST_PORT + PORTS_PER_DOMAIN * domain
        claim = _udp_socket()
        try:
            # no participant uses the last port: it keeps apart two runs that start together
            claim.bind(('', base + PORTS_PER_DOMAIN - 1))
            for n in range(PARTICIPANTS):
                with _udp_socket() as participant:
                    participant.bind(('', base + 10 + 2 * n))
            return str(domain), claim
        except OSError:  # somebody has the port
            claim.close()
    raise UserError('there are nodes in every ROS domain of this machine; set ROS_DOMAIN_ID')


def _udp_socket() -> socket.socket:
    return socket.socket(socket.AF_INET, socket.SOCK_DGRAM)


class ProcessError(UserError):
    """A process failed; the message names it and ends with the last lines of its log."""


class Process:
    """
    One executable under `ros2 run`, or a script, in a session of its own, its output in a file.

    As a context manager it is gone at the end of the context, however that ended.
    """

    def __init__(self, name: str, parameters: Mapping[str, object], log: Path,
                 parameter_files: Iterable[Path] = (),
                 remappings: Mapping[str, str] | None = None,
                 script: Path | None = None) -> None:
        """
        Start it with ROS parameters, those of the files first, and with other names of topics.

        Raises UserError where there is no `ros2`.
        """
        ros2 = shutil.which('ros2')
        if ros2 is None:
            raise UserError('there is no ros2 on the PATH; source the setup of ROS or of the '
                            'virtual environment first')
        command = [*((sys.executable, script) if script else (ros2, 'run', 'dp_swing_ros', name)),
                   '--ros-args']
        for file in parameter_files:
            if not any(is_for(pattern, name) for pattern, _ in sections(file)):
                continue   # of which the node would warn
            command += ['--params-file', str(file.resolve())]
        for key, value in parameters.items():
            # JSON is YAML that cannot be misread: 10.0 stays a float, '2024' a text
            command += ['-p', f'{key}:={json.dumps(value)}']
        for own, other in (remappings or {}).items():
            command += ['-r', f'{own}:={other}']
        self.name, self._log = name, log
        self._read = 0  # characters of the log
        with log.open('wb') as output:
            self._process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
                env={**os.environ, 'PYTHONUNBUFFERED': '1'}, start_new_session=True)

    def __enter__(self) -> 'Process':
        return self

    def __exit__(self, *error: object) -> None:
        """Ask it, and whatever it started, to end; wait, and kill what is left."""
        # a second Ctrl-C must not leave processes behind
        handlers = [signal.signal(number, signal.SIG_IGN) for number in ENDING]
        try:
            self.signal(signal.SIGINT)
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(GRACE)
            self.kill()
        finally:
            for number, handler in zip(ENDING, handlers):
                signal.signal(number, handler)

    @property
    def running(self) -> bool:
        """Return whether it has not ended yet."""
        return self._process.poll() is None

    def check(self) -> None:
        """Raise ProcessError if it has ended."""
        if not self.running:
            raise self._failure(f'ended early with exit code {self._process.returncode}')

    @property
    def pid(self) -> int:
        """Return the number of the executable's own process, which `ros2 run` may wait for."""
        pid = self._process.pid
        try:
            while children := Path(f'/proc/{pid}/task/{pid}/children').read_text().split():
                pid = int(children[0])
        except FileNotFoundError:
            if pid == self._process.pid:
                raise
            return self.pid   # that one was there for a moment only
        return pid

    def kill(self) -> None:
        """End what is left of it and of whatever it started."""
        self.signal(signal.SIGKILL)
        self._process.wait()

    def end(self) -> None:
        """Interrupt it and wait; raise ProcessError if it ended before, or as `finish` does."""
        self.check()
        self.signal(signal.SIGINT)
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
        begin, self._read = self._read, text.rfind('\n') + 1
        return text[begin:self._read].splitlines()

    def signal(self, number: int) -> None:
        """Send a signal to it and to whatever it started."""
        # the group outlives its first process while anything of it runs
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self._process.pid, number)

    def _failure(self, what: str) -> ProcessError:
        lines = self._log.read_text(errors='replace').splitlines()[-LAST_LINES:]
        return ProcessError('\n'.join([f'{self.name} {what}; the end of {self._log}:',
                                       *(f'    {line}' for line in lines)]))


class Crew(contextlib.ExitStack):
    """Processes that end with the context, the last first, whenever an interrupt comes."""

    def start(self, name: str, parameters: Mapping[str, object], log: Path,
              parameter_files: Iterable[Path] = (),
              remappings: Mapping[str, str] | None = None,
              script: Path | None = None) -> Process:
        """Start one more; see Process."""
        with postponed():   # between its start and its place here it would be left behind
            return self.enter_context(
                Process(name, parameters, log, parameter_files, remappings, script))


def await_ready(processes: Sequence[Process], missing: Callable[[], set[str]],
                wait: Callable[[float], None]) -> None:
    """
    Wait until none is missing, and show the logs meanwhile.

    `wait` does so for a time [s]. Raises ProcessError where one ends, or after READY.
    """
    end = time.monotonic() + READY
    with progress(bar_format='{desc} ({elapsed})') as line:
        while names := ' and '.join(sorted(missing())):
            line.set_description_str(f'waiting for {names}')
            if time.monotonic() > end:
                raise ProcessError(f'{names} not ready after {READY:g} s')
            for process in processes:
                process.check()
                for text in process.new_lines():
                    line.write(f'  {attributed(process.name, text)}')
            wait(0.1)


def attributed(name: str, line: str) -> str:
    """Return a line of a log without level and time, and with the name of its node once."""
    text = re.sub(r'^\[\w+\] \[[\d.]+\] \[[^]]*\]: ', '', line)
    return f'{name}: {text.removeprefix(f"{name}: ")}'
