# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bags, models and parameter files of strangers, for all that reads them."""

from collections.abc import Callable, Sequence
from contextlib import suppress
import json
import os
from pathlib import Path
import re
import shutil
import struct
import subprocess
import time
from typing import Any

from forgeries import rewritten
from fuzz_attacks import Entry, Rng, Step, step
from fuzz_target import PATIENCE, Process, STARTING
from mcap.records import Channel, Message
from mutations import MUTATIONS
import numpy as np
from websockets.sync.client import connect
import zstandard

Items = list[Any]


def run_tool(folder: Path, name: str, *arguments: str, until: str = '') -> None:
    """Run a tool or a node to its end, or until it prints a text; no end, no traceback: raise."""
    process = Process(folder / f'{name}_{time.monotonic_ns()}.log', name, *arguments)
    end = time.monotonic() + STARTING
    while process.popen.poll() is None and time.monotonic() < end and not (
            until and until in process.text()):
        time.sleep(0.05)
    if until and process.popen.poll() is None and 'the page is at' in process.text():
        watch(int(re.search(r'the page is at http://[^/]*:(\d+)/', process.text())[1]))
    running = process.popen.poll() is None
    code = process.end(PATIENCE) if running else process.popen.returncode
    text = process.text()
    assert process.largest < 2 << 30, f'{name} took {process.largest / 2 ** 30:.1f} GB'
    assert 'Traceback' not in text, f'{name} printed a traceback: {text.splitlines()[-1]}'
    assert not running or until and until in text, f'{name} does not end'
    assert code in (0, 1, 2, 130), f'{name} ended with {code}: {text[-200:]}'


def watch(port: int) -> None:
    """Look at a recorded run as a page does."""
    with connect(f'ws://127.0.0.1:{port}/socket', max_size=None, close_timeout=0.2,
                 ping_interval=None) as page:
        for request in ({'do': 'play', 'on': True, 'rate': 1}, {'do': 'seek', 'at': 1.0}):
            page.send(json.dumps(request))
        end = time.monotonic() + PATIENCE   # what cannot be shown has no frames, and is up
        with suppress(TimeoutError):
            while time.monotonic() < end and json.loads(page.recv(1.0))['kind'] != 'frame':
                pass


def of_topic(items: Items, name: str) -> list[Message]:
    """Return the messages of a topic."""
    wanted = {each.id for each in items if isinstance(each, Channel) and each.topic == name}
    return [each for each in items if isinstance(each, Message) and each.channel_id in wanted]


def stamps(second: int, every: int = 1) -> Callable[[Items], Items]:
    """Return what gives all states, or some, a stamp [s]."""
    def change(items: Items) -> Items:
        for each in of_topic(items, '/joint_states')[every // 2::every]:
            each.data = each.data[:4] + struct.pack('<II', second, 0) + each.data[12:]
        return items
    return change


def log_times(begin: int) -> Callable[[Items], Items]:
    """Return what lets a recording begin at a time [ns]."""
    def change(items: Items) -> Items:
        for n, each in enumerate(one for one in items if isinstance(one, Message)):
            each.log_time = each.publish_time = begin + n
        return items
    return change


def announced(old: str, new: str) -> Callable[[Items], Items]:
    """Return what announces another parameter."""
    def change(items: Items) -> Items:
        for each in of_topic(items, '/configuration'):
            text = re.sub(old, new, each.data[8:].rstrip(b'\0').decode()).encode() + b'\0'
            each.data = each.data[:4] + struct.pack('<I', len(text)) + text
        return items
    return change


def compressed(items: Items) -> Items:
    """Compress each message, as rosbag2 does with compression_mode MESSAGE."""
    for each in items:
        if isinstance(each, Message):
            each.data = zstandard.compress(each.data)
    return items


FORGERIES = {
    'rate 0.0': announced(r'\brate: \S+', 'rate: 0.0'),
    'rate abc': announced(r'\brate: \S+', 'rate: abc'), 'stamps 0': stamps(0),
    'stamps 2^31': stamps(2 ** 31), 'some stamps 0': stamps(0, 7),
    'some stamps 2^31': stamps(2 ** 31, 7), 'log times 2^63': log_times(2 ** 63 - 100),
    'log times 0': log_times(0), 'step 0': announced(r'\bstep: \S+', 'step: 0.0'),
    'links 3': announced(r'\blinks: \S+', 'links: 3'), 'compressed messages': compressed}
TOOLS: dict[str, Sequence[str]] = {
    'analyse': ('--no-animation',), 'export': (), 'verify': (),
    'compare': ('--solvers', 'ilqr', '--duration', '0.5'), 'identify': (), 'train': (),
    'recover': (), 'console': ('--port', '0')}
KNOWN = (('console', 'rate 0.0'), ('console', 'rate abc'), ('identify', 'log times 2^63'),
         ('train', 'log times 2^63'), ('identify', 'stamps 0'), ('train', 'some stamps 2^31'),
         ('identify', 'some stamps 2^31'), ('identify', 'some stamps 0'), ('train', 'stamps 0'),
         ('analyse', 'stamps 0'), ('verify', 'step 0'),
         ('compare', 'step 0'), ('recover', 'compressed messages'), ('export', 'links 3'))


def tool_on(tool: str, damage: str, seed: int) -> Step:
    """Return a tool on a damaged bag."""
    def do(target: Any) -> None:
        folder = target.folder / f'file_{time.monotonic_ns()}'
        shutil.copytree(recorded(target.folder), folder / 'bag')
        file = next((folder / 'bag').glob('*.mcap'))
        if damage in FORGERIES:
            file.write_bytes(rewritten(file.read_bytes(), FORGERIES[damage]))
        elif damage == 'sparse':
            with file.open('r+b') as content:
                content.truncate(8 << 30)
        else:
            MUTATIONS[damage](folder / 'bag', np.random.default_rng(seed))
        run_tool(folder, tool, 'bag', *TOOLS[tool],
                 until='the page is at' if tool == 'console' else '')
        shutil.rmtree(folder)
    return Step(f'{tool} on a bag, {damage}', do)


def recorded(folder: Path) -> Path:
    """Return a sound bag, which is recorded at first."""
    made = folder / 'sound'
    while not made.exists():
        trial = folder / f'trial_{time.monotonic_ns()}'
        done = subprocess.run(
            ['ros2', 'run', 'dp_swing_ros', 'demo', '--lockstep', '--no-figures', '--duration',
             '3', '--output', trial], capture_output=True,
            env={**os.environ, 'ROS_DOMAIN_ID': ''})   # one of its own
        if done.returncode in (0, 1):   # on a busy machine nodes may not come up in time
            trial.rename(made)
    return made / 'bag'


def start(node: str, content: bytes | str, *parameters: str) -> Step:
    """Return a node that is started with a file of such content, or at such a path."""
    def do(target: Any) -> None:
        file = target.folder / f'file_{time.monotonic_ns()}.yaml'
        if isinstance(content, bytes):
            file.write_bytes(content)
        path = str(file) if isinstance(content, bytes) else content.replace(
            'FOLDER', str(target.folder))
        arguments = [word for each in parameters for word in ('-p', each.replace('FILE', path))]
        run_tool(target.folder, node, '--ros-args', '-r', '__ns:=/of_file',
                 *(arguments or ('--params-file', path)), until='ready' if node == 'mpc' else
                 'states a second')
    return step(f'{node} {" ".join(parameters)} with the file {content[:60]!r}', do)


MODEL = ('dynamics:=learned', 'model:=FILE')
PATHS = ('/dev/zero', 'FOLDER/fifo', 'FOLDER/nested.json', 'FOLDER', '/none')
CONTENTS = (b'', b'\0' * 100, b'[', b'{"format": 1e400}', b'\xff\xfe', b'/**: {ros__parameters: {',
            b'/**:\n  ros__parameters:\n    rate: .inf\n    cart_mass: .nan\n',
            b'/**:\n  ros__parameters:\n    rate: 1:59:59\n',
            b'/**:\n  ros__parameters:\n    initial_state: [1, x, .nan]\n')


def files(folder: Path) -> Entry:
    """Return files for all that reads any."""
    known = [[tool_on(tool, damage, 0)] for tool, damage in KNOWN]
    known += [[start('mpc', path, *MODEL)] for path in PATHS]
    known += [[start('mpc', content, *MODEL)] for content in CONTENTS[:4]]
    known += [[start('plant', content)] for content in CONTENTS]

    def draw(rng: Rng) -> list[Step]:
        if rng.random() < 0.2:
            return [start('plant', CONTENTS[rng.integers(len(CONTENTS))] + rng.bytes(5))]
        damage = str(rng.choice([*MUTATIONS, *FORGERIES, 'sparse']))
        return [tool_on(str(rng.choice(list(TOOLS))), damage, int(rng.integers(2 ** 31)))]
    return Entry(known, draw)
