# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What logger and replay are told, and the tables of all parameters; needs no ROS.

Plant and mpc have theirs where the plant and the controller are: see configuration.NODES.
"""

from collections.abc import Iterable, Iterator
import dataclasses
import math
from typing import Any, NamedTuple

from dp_swing_ros.bags.fields import BILLION
from dp_swing_ros.bags.mcap_file import Storage
from dp_swing_ros.bags.playback import ORDERS, SENT
from dp_swing_ros.parameters import parameter, Parameters
from dp_swing_ros.topics import TOPICS


@dataclasses.dataclass(frozen=True)
class LoggerParameters(Parameters):
    """What to record, where, and how safely."""

    output: str = parameter(
        '', 'folder of the bag, which must not exist; empty: named by the time, here')
    topics: tuple[str, ...] = parameter(
        tuple(topic.name for topic in TOPICS), 'topics to record, as soon as they have publishers')
    flush_period: float = parameter(
        0.05, 'longest time that a message stays in the process, which a kill would lose',
        unit='s', minimum=0.001)
    chunk_size: int = parameter(
        1 << 20, 'size of uncompressed messages after which they are written at once',
        unit='bytes', minimum=1024)
    fsync: bool = parameter(
        False, 'wait for the disk at each flush, so that messages survive a power cut, too')
    max_bagfile_size: int = parameter(
        0, 'size after which the next file of the bag begins (0: never)', unit='bytes', minimum=0)
    max_bagfile_duration: float = parameter(
        0.0, 'time after which the next file of the bag begins (0: never)', unit='s', minimum=0.0)
    progress_period: float = parameter(
        5.0, 'time between two lines on the progress (0: none)', unit='s', minimum=0.0)

    def to_storage(self) -> Storage:
        """Return what concerns the files."""
        return Storage(self.chunk_size, self.fsync, self.max_bagfile_size,
                       round(self.max_bagfile_duration * BILLION))


@dataclasses.dataclass(frozen=True)
class ReplayParameters(Parameters):
    """What to play, and how; named as the options of `ros2 bag play` are."""

    bag: str = parameter('', 'folder of the bag to play, or its .mcap file; must be given')
    partial: bool = parameter(False, 'play what there is of a bag whose logger was killed')
    # a list of none would tell nobody what it is to be a list of
    topics: tuple[str, ...] = parameter(('',), 'topics to play; empty: all')
    rate: float = parameter(1.0, 'times as fast as recorded', minimum=1e-3)
    start_offset: float = parameter(
        0.0, 'where to begin, after the first message of the bag', unit='s', minimum=0.0)
    playback_duration: float = parameter(
        0.0, 'how much of the bag to play, in its own time (0 or less: all)', unit='s')
    message_order: str = parameter(
        SENT, 'the time that counts of each message: when it was sent, or when it was received',
        choices=lambda: list(ORDERS))
    loop: bool = parameter(False, 'begin again after the last message')
    clock: float = parameter(
        0.0, 'publish the time of the bag on /clock so often, and before every message, for '
        'nodes with use_sim_time (0: not at all)', unit='Hz', minimum=0.0, maximum=1e4)
    start_paused: bool = parameter(False, 'wait for the service replay/resume or replay/play_next')
    wait: float = parameter(
        2.0, 'at most, for subscribers of the topics to be found', unit='s', minimum=0.0)
    delay: float = parameter(0.0, 'before the first message', unit='s', minimum=0.0)


class Row(NamedTuple):
    """A parameter as it is shown."""

    name: str
    default: str
    unit: str
    expected: str
    description: str


def rows(groups: Iterable[tuple[str, type[Parameters]]]) -> Iterator[Row]:
    """Yield the parameters of (prefix, group) pairs."""
    for prefix, group in groups:
        for field in dataclasses.fields(group):
            yield Row(full_name(field, prefix), _shown(field.default), field.metadata['unit'],
                      expected(field), field.metadata['description'])


def table(groups: Iterable[tuple[str, type[Parameters]]]) -> str:
    """Return the Markdown table of the parameters of (prefix, group) pairs."""
    lines = ['| parameter | default | unit | range | description |',
             '| --- | --- | --- | --- | --- |']
    for row in rows(groups):
        cells = row._replace(name=f'`{row.name}`', default=f'`{row.default}`')
        lines.append('| ' + ' | '.join(cell.replace('|', r'\|') for cell in cells) + ' |')
    return '\n'.join(lines) + '\n'


def full_name(field: dataclasses.Field, prefix: str) -> str:
    """Return the name of a parameter as a node declares it."""
    return f'{prefix}.{field.name}' if prefix else field.name


def expected(field: dataclasses.Field) -> str:
    """Return in words what a parameter may be; empty where anything of its type is."""
    about = field.metadata
    if about['choices'] is not None:
        return 'one of ' + ', '.join(about['choices']())
    bounds = []
    if about['minimum'] is not None:
        bounds.append(f'at least {about["minimum"]:g}')
    if about['maximum'] is not None:
        bounds.append(f'at most {about["maximum"]:g}')
    text = ', '.join(bounds)
    if about['size'] is not None:
        each = f', each {text}' if text else ''
        return f'{about["size"]} numbers{each}'
    return text


def _shown(value: Any) -> str:
    if isinstance(value, tuple):
        return f'[{", ".join(_shown(element) for element in value)}]'
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and math.isinf(value):
        return '.inf'
    return f'{value:g}' if isinstance(value, float) else str(value)
