# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads a bag as an episode; needs no ROS."""

from pathlib import Path
from typing import Any, Callable, Iterator, NamedTuple

from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC
from mcap_ros2.decoder import DecoderFactory
import numpy as np

from dp_swing_ros.episode import Episode, Ticks
from dp_swing_ros.nodes.errors import BagError
from dp_swing_ros.nodes.fields import (
    BILLION, from_diagnostics, nanoseconds, Report, to_force, to_state)
from dp_swing_ros.nodes.topics import DIAGNOSTICS, JOINT_STATES, ROBOT_DESCRIPTION, Topic
from dp_swing_ros.state import Array
from dp_swing_ros.urdf import from_urdf

CONTROLLER = 'mpc'  # who reports a tick in the diagnostics


class Sample(NamedTuple):
    """A state as it was published."""

    stamp: int    # [ns]
    x: Array
    force: float  # [N] over the period before


def read_episode(path: Path | str, partial: bool = False) -> Episode:
    """
    Read the run in a bag, given its folder or its MCAP file.

    A file without an end, as a logger leaves that was killed, is read only if `partial`.
    Raises BagError, saying what was found, what is expected and what to do.
    """
    path = Path(path)
    messages = [message for file in _files(path) for message in _messages(file, partial)]
    return _Run(path, messages).episode()


class _Sealed(NamedTuple):
    """A message that is decoded if it is asked for."""

    topic: str
    data: bytes
    decode: Callable[[bytes], Any] | None  # None if it is not of ROS 2


class _Run:
    """The messages of one pendulum, topic by topic."""

    def __init__(self, path: Path, messages: list[_Sealed]) -> None:
        self._path = path
        self._messages = messages
        self._topics = sorted({message.topic for message in messages})

    def episode(self) -> Episode:
        samples = self._samples()
        start = samples[0].stamp
        reports = self._reports()
        bodies, limits = self._parse(from_urdf, self._of(ROBOT_DESCRIPTION)[-1].data)
        return Episode(
            t=np.array([sample.stamp - start for sample in samples]) / BILLION,
            X=np.array([sample.x for sample in samples]),
            U=np.array([sample.force for sample in samples[1:]]),
            ticks=self._parse(_ticks, reports, start),
            solver=str(reports[-1].values.get('solver', '')) if reports else '',
            bodies=bodies, limits=limits)

    def _of(self, topic: Topic) -> list[Any]:
        names = [name for name in self._topics
                 if name == topic.name or name.endswith('/' + topic.name.lstrip('/'))]
        found = f'it holds messages of {", ".join(self._topics) or "no topic"}'
        if not names:
            raise BagError(f'the bag {str(self._path)!r} has nothing on {topic.name}: {found}; '
                           'record a run with the logger')
        if len(names) > 1:
            raise BagError(f'the bag {str(self._path)!r} has several pendulums: {found}; '
                           'record each with a logger in its namespace')
        return [self._opened(message) for message in self._messages if message.topic == names[0]]

    def _opened(self, message: _Sealed) -> Any:
        if message.decode is None:
            raise BagError(f'the bag {str(self._path)!r} has {message.topic} in another encoding; '
                           'expected cdr messages with a ros2msg definition')
        return message.decode(message.data)

    def _samples(self) -> list[Sample]:
        samples: dict[int, Sample] = {}
        for message in self._of(JOINT_STATES):
            stamp = nanoseconds(message.header.stamp)
            sample = Sample(stamp, self._parse(to_state, message), to_force(message))
            before = samples.setdefault(stamp, sample)
            if not np.array_equal(before.x, sample.x, equal_nan=True):
                raise BagError(f'the bag {str(self._path)!r} has two states at {stamp} ns: the '
                               'plant was reset in lockstep, or two plants ran; record one run')
        if len(samples) < 2:
            raise BagError(f'the bag {str(self._path)!r} has {len(samples)} states; '
                           'at least 2 make a run')
        return [samples[stamp] for stamp in sorted(samples)]

    def _reports(self) -> list[Report]:
        if not any(topic.endswith(DIAGNOSTICS.name) for topic in self._topics):
            return []  # a run of the plant alone
        reports = [from_diagnostics(message, CONTROLLER) for message in self._of(DIAGNOSTICS)]
        return sorted((report for report in reports if report is not None),
                      key=lambda report: report.stamp)

    def _parse(self, parse: Callable[..., Any], *arguments: Any) -> Any:
        try:
            return parse(*arguments)
        except ValueError as error:
            raise BagError(f'the bag {str(self._path)!r} is not one of this pendulum: '
                           f'{error}') from None


def _ticks(reports: list[Report], start: int) -> Ticks:
    def column(key: str, kind: type) -> Array:
        missing = [report for report in reports if key not in report.values]
        if missing:
            raise ValueError(f'a tick of {CONTROLLER} does not give its {key}')
        return np.array([report.values[key] for report in reports], dtype=kind)

    return Ticks(t=np.array([report.stamp - start for report in reports]) / BILLION,
                 cost=column('cost', float), iterations=column('iterations', int),
                 solve_time=column('solve_time', float), latency=column('latency', float),
                 late=column('late', bool), status=column('status', str).tolist())


def _files(path: Path) -> list[Path]:
    if path.is_file():
        return [path]
    if not path.exists():
        raise BagError(f'there is no bag {str(path)!r}')
    files = sorted(path.glob('*.mcap'))
    if not files:
        found = ', '.join(sorted(file.name for file in path.iterdir())) or 'nothing'
        raise BagError(f'{str(path)!r} is no bag with an MCAP file, it holds {found}; '
                       '`ros2 bag convert` turns other storages into MCAP')
    return files


def _messages(file: Path, partial: bool) -> Iterator[_Sealed]:
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    decoders = DecoderFactory()
    for record in _records(file, partial):
        if isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel):
            channels[record.id] = record
        elif isinstance(record, Message):
            channel = channels[record.channel_id]
            decode = decoders.decoder_for(channel.message_encoding,
                                          schemas.get(channel.schema_id))
            yield _Sealed(channel.topic, record.data, decode)


def _records(file: Path, partial: bool) -> Iterator[Any]:
    count = 0
    with file.open('rb') as stream:
        if stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
            raise BagError(f'{str(file)!r} is no MCAP file')
        stream.seek(0)
        try:
            for record in StreamReader(stream, validate_crcs=True).records:
                count += isinstance(record, Message)
                yield record
        except Exception as error:  # noqa: B902
            # Half a record fails in as many ways as there are kinds of records.
            if stream.read(1):
                raise BagError(f'{str(file)!r} is damaged after {count} messages: '
                               f'{error}') from None
            if not partial:
                raise BagError(f'{str(file)!r} has {count} messages but no end, as if its logger '
                               'was killed; ask for what is there (partial)') from None
