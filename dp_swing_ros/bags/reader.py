# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the messages of a bag, topic by topic; needs no ROS."""

from pathlib import Path
import re
from typing import Any, Callable, Iterator, NamedTuple, TypeVar

from mcap.records import Channel, Message, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC
from mcap_ros2.decoder import DecoderFactory

from dp_swing_ros.errors import BagError
from dp_swing_ros.topics import Topic

R = TypeVar('R')


class Entry(NamedTuple):
    """A message, decoded if it is asked for."""

    topic: str
    received: int  # [ns]
    sent: int      # [ns]
    sequence: int  # of its publisher
    data: bytes
    decode: Callable[[bytes], Any] | None  # None if it is not of ROS 2


class Offer(NamedTuple):
    """A topic as its publishers offered it."""

    type: str      # noqa: A003
    encoding: str  # of its messages
    qos: str       # YAML, a list of a profile per publisher; may be empty


class Bag:
    """The messages in a bag of one pendulum."""

    def __init__(self, path: Path | str, partial: bool = False) -> None:
        """
        Read the folder of a bag, or its MCAP file.

        A file without an end, as a logger leaves that was killed, is read only if `partial`.
        Raises BagError, saying what was found, what is expected and what to do.
        """
        self.path = Path(path)
        self.offers: dict[str, Offer] = {}  # by topic
        self.entries = [entry for file in _files(self.path)
                        for entry in _entries(file, partial, self.offers)]
        self.topics = sorted({entry.topic for entry in self.entries})

    def __repr__(self) -> str:
        return f'the bag {str(self.path)!r}'

    def has(self, topic: Topic) -> bool:
        """Tell whether there are messages on a topic."""
        return bool(self._names(topic))

    def of(self, topic: Topic) -> list[Any]:
        """
        Return the messages on a topic as they were received.

        Raises BagError where there are none, or those of several pendulums.
        """
        return [self.decoded(entry) for entry in self.entries_of(topic)]

    def entries_of(self, topic: Topic) -> list[Entry]:
        """Return the entries of a topic; raises as `of`."""
        names = self._names(topic)
        found = f'it holds messages of {", ".join(self.topics) or "no topic"}'
        if not names:
            raise BagError(f'{self} has nothing on {topic.name}: {found}; '
                           'record a run with the logger')
        if len(names) > 1:
            raise BagError(f'{self} has several pendulums: {found}; '
                           'record each with a logger in its namespace')
        return [entry for entry in self.entries if entry.topic == names[0]]

    def _names(self, topic: Topic) -> list[str]:
        return [name for name in self.topics
                if name == topic.name or name.endswith('/' + topic.name.lstrip('/'))]

    def decoded(self, entry: Entry) -> Any:
        """
        Return the message of an entry.

        Raises BagError where it is not one of ROS 2.
        """
        if entry.decode is None:
            raise BagError(f'{self} has {entry.topic} in another encoding; '
                           'expected cdr messages with a ros2msg definition')
        return entry.decode(entry.data)

    def parse(self, parse: Callable[..., R], *arguments: Any) -> R:
        """
        Call a function that reads what messages say.

        Raises BagError where it raises ValueError.
        """
        try:
            return parse(*arguments)
        except ValueError as error:
            raise BagError(f'{self} is not one of this pendulum: {error}') from None


def _files(path: Path) -> list[Path]:
    if path.is_file():
        return [path]
    if not path.exists():
        raise BagError(f'there is no bag {str(path)!r}')
    files = sorted(path.glob('*.mcap'), key=_in_order)
    if not files:
        found = ', '.join(sorted(file.name for file in path.iterdir())) or 'nothing'
        raise BagError(f'{str(path)!r} is no bag with an MCAP file, it holds {found}; '
                       '`ros2 bag convert` turns other storages into MCAP')
    return files


def _in_order(file: Path) -> list[int | str]:
    # bag_2 before bag_10
    return [int(part) if part.isdecimal() else part for part in re.split(r'(\d+)', file.name)]


def _entries(file: Path, partial: bool, offers: dict[str, Offer]) -> Iterator[Entry]:
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    decoders = DecoderFactory()
    for record in _records(file, partial):
        if isinstance(record, Schema):
            schemas[record.id] = record
        elif isinstance(record, Channel):
            channels[record.id] = record
            schema = schemas.get(record.schema_id)
            offers[record.topic] = Offer(schema.name if schema else '', record.message_encoding,
                                         record.metadata.get('offered_qos_profiles', ''))
        elif isinstance(record, Message):
            channel = channels[record.channel_id]
            decode = decoders.decoder_for(channel.message_encoding,
                                          schemas.get(channel.schema_id))
            yield Entry(channel.topic, record.log_time, record.publish_time, record.sequence,
                        record.data, decode)


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
