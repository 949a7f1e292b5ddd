# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Running nodes under attack, an honest client that watches them, and the stranger's tools."""

from collections.abc import Callable, Sequence
from contextlib import suppress
import ctypes
import json
import math
import os
from pathlib import Path
import re
import resource
import signal
import socket
import subprocess
from threading import Event, Thread
import time
from typing import Any

from builtin_interfaces.msg import Time
import numpy as np
from rcl_interfaces.msg import Parameter
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray, String
from std_srvs.srv import SetBool
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

PR_SET_PDEATHSIG = 1   # of Linux
NODES = ('mpc', 'plant', 'console', 'logger', 'relay')
PATIENCE = 10.0       # [s] for what takes a tenth of one, and need not come
ANSWERED = 60.0       # [s] for what must come: the machine may be busy
STARTING = 120.0      # [s] for nodes, which may compile
MEMORY = 3 << 30      # [bytes] that a process may have
SILENCE = 1.0         # [s] of a publisher, after which an mpc obeys another one
LASTING = QoSProfile(depth=2, durability=DurabilityPolicy.TRANSIENT_LOCAL)
MANY = QoSProfile(depth=1000)


def limited() -> None:
    """
    Bound the memory of a child, which ends with its parent: the machine is not attacked.

    SIGINT ends it, which a shell that starts tests in the background has it ignore.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))


def resident(pid: int) -> int:
    """Return what a process holds [bytes]; 0 where it is gone."""
    with suppress(OSError, IndexError):
        return int(Path(f'/proc/{pid}/statm').read_text().split()[1]) * os.sysconf('SC_PAGE_SIZE')
    return 0


class Process:
    """An executable of the package, with its log and bounded memory."""

    def __init__(self, log: Path, name: str, *arguments: str) -> None:
        self.name, self.log, self.read = name, log, 0
        with log.open('ab') as output:
            self.popen = subprocess.Popen(
                ['ros2', 'run', 'dp_swing_ros', name, *arguments], stdin=subprocess.DEVNULL,
                stdout=output, stderr=output, start_new_session=True, preexec_fn=limited,
                cwd=log.parent, env={**os.environ, 'PYTHONUNBUFFERED': '1'})
        self.largest = 0
        Thread(target=self._watch, daemon=True).start()

    def _watch(self) -> None:
        while self.popen.poll() is None:
            self.largest = max(self.largest, resident(self.popen.pid))
            if self.largest > MEMORY:
                self.signal(signal.SIGKILL)
            time.sleep(0.05)

    def signal(self, number: int) -> None:
        """Send a signal to it and what it started, while its number is not another's."""
        if self.popen.poll() is None:
            os.killpg(self.popen.pid, number)

    def text(self) -> str:
        """Return all that it has printed."""
        return self.log.read_text(errors='replace')

    def complaint(self) -> str:
        """Return what is wrong with it by itself, in words; empty where nothing is."""
        text, before = self.text(), self.read
        self.read = len(text)
        error = [line for line in text.splitlines() if line.strip()][-1:]
        if self.largest > MEMORY:
            return f'{self.name} took {self.largest / 2 ** 30:.1f} GB'
        if self.popen.poll() is not None:
            return f'{self.name} ended with code {self.popen.returncode}: {error}'
        if 'Traceback' in text[before:]:
            found = re.findall(r'^\w[\w.]*(?:Error|Exception).*', text[before:], re.MULTILINE)
            return f'{self.name} printed a traceback: {found[-1:]}'
        return ''

    def end(self, patience: float) -> int | None:
        """Ask it to end, and return its exit code; None where it had to be killed."""
        self.signal(signal.SIGINT)
        try:
            return self.popen.wait(patience)
        except subprocess.TimeoutExpired:
            return None
        finally:
            self.signal(signal.SIGKILL)   # if it still runs
            self.popen.wait()


class Loop:
    """What is heard of a plant and an mpc in a namespace."""

    def __init__(self, node: Any, namespace: str) -> None:
        self.states: dict[int, float] = {}      # [ns] stamp of each, and when it came [s]
        self.state = JointState()
        # when it came [s], stamp of the state [ns], force, and when it was sent [s]
        self.answers: list[tuple[float, int, float, float]] = []
        self.strange = set[int]()               # stamps of states of a stranger
        self.copied = set[int]()                # and of those of the plant that he sent again
        node.create_subscription(JointState, f'{namespace}/joint_states', self._on_state, MANY)
        node.create_subscription(JointState, f'{namespace}/force_command_stamped', self._on_force,
                                 MANY)

    def _on_state(self, message: JointState) -> None:
        stamp = message.header.stamp.sec * 10 ** 9 + message.header.stamp.nanosec
        if stamp not in self.strange:
            self.states[stamp], self.state = time.monotonic(), message

    def _on_force(self, message: JointState, info: dict[str, int]) -> None:
        stamp = message.header.stamp.sec * 10 ** 9 + message.header.stamp.nanosec
        if list(message.name) == ['cart']:   # else an attacker has sent it
            self.answers.append((time.monotonic(), stamp, message.effort[0],
                                 info['source_timestamp'] / 1e9))

    def answered(self, since: float) -> bool:
        """Return whether a state that came since then has been answered."""
        return any(self.states.get(stamp, 0.0) > since for _, stamp, *_ in self.answers[-50:])

    def obeyed_strangers(self, since: float) -> set[int]:
        """Return the strange states that were answered since then, while the plant was heard."""
        found, seen, heard = set[int](), set[int](), -math.inf   # [s] when the plant was
        for at, stamp, _, sent in self.answers:
            if stamp in self.strange and at > since and sent - heard < SILENCE:
                found.add(stamp)
            elif not any(stamp in each for each in (self.strange, self.copied, seen)):
                heard = sent
            seen.add(stamp)   # of which more answers may come without a state
        return found


class Target:
    """Nodes of ours that run; everything about them is known as a stranger knows it."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.processes = folder, dict[str, Process]()
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node('stranger', context=self.context)
        self.loop, self.simulated = Loop(self.node, ''), Loop(self.node, '/simulated')
        self.announced: dict[str, str] = {}
        self.announcements = 0
        self.last_force, self.relayed = math.nan, list[float]()
        self.clients, self.publishers = dict[str, Any](), dict[str, Any]()
        # of all nodes, which may announce themselves at once
        self.node.create_subscription(String, 'configuration', self._on_configuration, QoSProfile(
            depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL))
        self.node.create_subscription(Float64, 'force_command', self._on_force, MANY)
        self.node.create_subscription(Float64MultiArray, 'force_controller/commands',
                                      lambda message: self.relayed.extend(message.data), MANY)
        self.clock, self.offset = self.node.create_publisher(Clock, '/clock', 10), 0.0
        self.socket: Any = None
        self.over = Event()
        self.threads = [Thread(target=work, daemon=True) for work in (self._spin, self._tick)]
        for thread in self.threads:
            thread.start()
        os.mkfifo(folder / 'fifo')
        (folder / 'nested.json').write_text('[' * 12_500 + ']' * 12_500)
        for name in (*NODES, 'simulated_mpc', 'simulated_plant'):
            self.start(name)

    def begin(self) -> None:
        """Wait until all are there."""
        assert self.await_(lambda: self.loop.answers and self.simulated.answers, STARTING)
        assert self.await_(lambda: {'/plant', '/mpc'} <= set(self.announced), STARTING)
        self.port = self._port()
        names, tries = ['dynamics', 'model'], round(STARTING / PATIENCE)
        answers = (self.call(GetParameters, 'mpc/get_parameters', names=names)
                   for _ in range(tries))   # the first one may be lost
        self.values = [Parameter(name=name, value=value) for name, value in zip(
            names, next(filter(None, answers)).values)]

    # honest

    def _spin(self) -> None:
        executor = SingleThreadedExecutor(context=self.context)
        executor.add_node(self.node)
        while not self.over.is_set():
            with suppress(RuntimeError):   # bytes that are no message come here, too
                executor.spin_once(timeout_sec=0.1)

    def _tick(self) -> None:
        while not self.over.wait(0.01):
            now = time.time() + self.offset
            now = min(max(now, 0.0), 2.0 ** 31 - 1)
            self.clock.publish(Clock(clock=Time(sec=int(now), nanosec=int(now % 1 * 1e9))))

    def _on_configuration(self, message: String) -> None:
        self.announcements += 1
        with suppress(Exception):
            node = re.match(r'node: (\S+)', message.data)[1]
            if node not in self.announced or self.honest:
                self.announced[node] = message.data

    honest = True   # what comes now is of our nodes

    def _on_force(self, message: Float64) -> None:
        self.last_force = message.data

    def start(self, name: str) -> None:
        """Start a node, perhaps again."""
        executable = name.removeprefix('simulated_')
        parameters = {
            'console': ['port:=0', 'recordings:=' + str(self.folder / 'runs')],
            'plant': ['start:=up_up'],
            'logger': [f'output:={self.folder / "bag"}_{time.monotonic_ns()}']}.get(executable, [])
        arguments = ['--ros-args'] + [word for each in parameters for word in ('-p', each)]
        if executable != name:
            arguments += ['-r', '__ns:=/simulated', '-p', 'use_sim_time:=true']
        self.processes[name] = Process(self.folder / f'{name}_{time.monotonic_ns()}.log',
                                       executable, *arguments)
        if name == 'console' and hasattr(self, 'port'):
            self.port = self._port()

    def _port(self) -> int:
        console = self.processes['console']
        self.await_(lambda: 'the page is at' in console.text(), STARTING)
        return int(re.search(r'the page is at http://[^/]*:(\d+)/', console.text())[1])

    def await_(self, condition: Callable[[], Any], patience: float = PATIENCE) -> bool:
        """Wait for a condition; return whether it came true."""
        end = time.monotonic() + patience
        while not condition() and time.monotonic() < end:
            time.sleep(0.005)
        return bool(condition())

    def call(self, kind: Any, name: str, **fields: Any) -> Any:
        """Call a service; return its answer, None where there is none."""
        answers = self.call_many(kind, name, [kind.Request(**fields)])
        return answers[0].result() if answers and answers[0].done() else None

    def call_many(self, kind: Any, name: str, requests: Sequence[Any],
                  patience: float = PATIENCE) -> list[Any]:
        """Call a service so often at once; return the futures, once all are done if they will."""
        if name not in self.clients:
            self.clients[name] = self.node.create_client(kind, name)
        client = self.clients[name]
        if not self.await_(client.service_is_ready):
            return []
        futures = [client.call_async(request) for request in requests]
        self.await_(lambda: all(each.done() for each in futures), patience)
        return futures

    def complaints(self) -> list[str]:
        """Return what is wrong with the processes by themselves."""
        return [found for found in (each.complaint() for each in self.processes.values()) if found]

    def faults(self, began: float, bounded: bool = True) -> list[str]:
        """Return what is wrong, in words, after an attack that began at a time [s]."""
        found = list[str]()
        relayed, self.relayed = self.relayed, []
        if not np.isfinite(relayed).all():
            found.append('the relay handed on a force that is not finite')
        for name, loop in {'': self.loop, 'simulated ': self.simulated}.items():
            since = time.monotonic()
            if not self.await_(lambda: loop.answered(since), ANSWERED):
                quiet = not any(at > since for at in loop.states.values())
                found.append(f'no {"state" if quiet else "answer"} of the {name}nodes for '
                             f'{ANSWERED:g} s')
            forces = [force for at, _, force, _ in loop.answers if at > began]
            if not all(math.isfinite(force) and (abs(force) <= 20.0 or not bounded)
                       for force in forces):
                found.append(f'a force of {max(forces, key=abs)}')
            if strange := loop.obeyed_strangers(began):
                found.append(f'{len(strange)} states of a stranger were answered')
        if page := self.page_complaint():
            found.append(page)
        return found + self.complaints()

    def page_complaint(self) -> str:
        """Return what is wrong with what a fresh page gets."""
        stamp = self.loop.state.header.stamp
        since = stamp.sec + 1e-9 * stamp.nanosec
        try:
            with connect(f'ws://127.0.0.1:{self.port}/socket', max_size=None, close_timeout=0.2,
                         open_timeout=ANSWERED, ping_interval=None) as page:
                end = time.monotonic() + ANSWERED
                while time.monotonic() < end:
                    message = json.loads(page.recv(ANSWERED))
                    if message['kind'] == 'frame' and since < message['t'] < since + 60.0:
                        return ''
        except (OSError, TimeoutError, WebSocketException) as error:
            time.sleep(2.0)   # if it is ending, it tells why
            return f'a page is not served: {type(error).__name__} {error}'
        return f'a page got no frame for {ANSWERED:g} s'

    def heal(self) -> None:
        """Start anew what ended or hangs, and undo what an attack may have left."""
        self.honest = True
        for name, process in list(self.processes.items()):
            if process.popen.poll() is not None:
                self.start(name)
        for node in ('plant', 'mpc'):
            announced = String(data=self.announced[f'/{node}'])
            self.publisher('configuration', String).publish(announced)
        self.call(SetBool, 'mpc/enable', data=True)

    def end(self) -> list[str]:
        """End all nodes; return what was wrong with that."""
        found = []
        for name, process in self.processes.items():
            alive = process.popen.poll() is None
            code = process.end(STARTING)
            if alive and code != 0:
                found.append(f'{name} ended at SIGINT with {code}')
            if name == 'mpc' and not self.await_(
                    lambda: self.last_force == 0.0, ANSWERED):
                found.append(f'the last force was {self.last_force}, not zero')
        self.over.set()
        for thread in self.threads:
            thread.join()
        self.node.destroy_node()
        self.context.try_shutdown()
        return found

    # strange

    @property
    def last_state(self) -> JointState:
        """Return the newest state of the plant, which is sent again."""
        stamp = self.loop.state.header.stamp
        self.loop.copied.add(stamp.sec * 10 ** 9 + stamp.nanosec)
        return self.loop.state

    @property
    def strange(self) -> set[int]:
        """Return the stamps [ns] of states that are not the plant's."""
        return self.loop.strange

    def strange_stamp(self) -> Time:
        """Return the time, as the stamp of a state of a stranger."""
        now = time.time_ns()
        self.strange.add(now)
        return Time(sec=now // 10 ** 9, nanosec=now % 10 ** 9)

    def publisher(self, topic: str, kind: Any) -> Any:
        """Return a publisher that somebody hears."""
        if topic not in self.publishers:
            lasting = topic in ('configuration', 'robot_description')
            self.publishers[topic] = self.node.create_publisher(
                kind, topic, LASTING if lasting else MANY)
            self.await_(self.publishers[topic].get_subscription_count)
        return self.publishers[topic]

    def change(self, node: str, several: Sequence[Parameter]) -> None:
        """Set parameters, wait until that counts if it is taken, and undo it."""
        before, name = self.announcements, f'{node}/set_parameters_atomically'
        answer = self.call(SetParametersAtomically, name, parameters=several)
        if answer is not None and answer.result.successful:
            self.await_(lambda: self.announcements > before, 2.0)
            self.call(SetParametersAtomically, name, parameters=self.values)

    def page_sends(self, several: Sequence[str | bytes]) -> None:
        """Send texts or bytes as a page, and read what waits."""
        for text in several:
            with suppress(OSError, TimeoutError, WebSocketException, UnicodeError):
                if self.socket is None:
                    self.socket = connect(f'ws://127.0.0.1:{self.port}/socket', max_size=None,
                                          close_timeout=0.2, ping_interval=None)
                self.socket.send(text)
                with suppress(TimeoutError):
                    while True:
                        self.socket.recv(0.0)
                continue
            self.socket = None

    def request(self, content: bytes) -> None:
        """Send bytes to the port of the page; raises AssertionError where it fails inside."""
        with suppress(OSError), socket.create_connection(('127.0.0.1', self.port), 1.0) as stream:
            stream.sendall(content.replace(b'HOST', b'127.0.0.1:%d' % self.port))
            stream.settimeout(1.0)
            answer = stream.recv(100)
            assert b' 500 ' not in answer, answer.splitlines()[0]

    def jump(self, several: Sequence[float]) -> None:
        """Let the simulated time jump, by so much each [s]."""
        for by in several:
            self.offset += float(by)
            time.sleep(0.1)
        self.offset = min(max(self.offset, -time.time()), 2.0 ** 31 - 1e6 - time.time())
