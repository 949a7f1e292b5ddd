# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The messages of one whole MCAP file, by the reader of the mcap library.

What that reader passes over is damage here: a checksum or a count that is wrong, a number that
two channels share, bytes after the end. What is left of a damaged file is for `recovery`.
"""

from collections.abc import Mapping
from contextlib import redirect_stderr, suppress
import dataclasses
from io import BytesIO, StringIO
from pathlib import Path
from types import MappingProxyType
from typing import Any, Callable, NamedTuple
import zlib

import lz4.frame
from mcap.records import Channel, Chunk, McapRecord, Message, MessageIndex, Schema, Statistics
from mcap.stream_reader import breakup_chunk, StreamReader
from mcap_ros2.decoder import DecoderFactory
import zstandard

from dp_swing_ros.errors import BagError, one_line

PIECE = 1 << 16    # [bytes] unpacked at a time: what an error costs besides its own block
LARGEST = 1 << 29  # [bytes] of a chunk; writers make them of a few MiB
STREAMS: dict[str, Any] = {'': BytesIO, 'lz4': lambda data: lz4.frame.LZ4FrameFile(BytesIO(data)),
                           'zstd': zstandard.ZstdDecompressor().stream_reader}
FIELDS = 2000      # lines of a definition: reading one takes the square of their number
DEFINITION = 1 << 18  # [bytes]

Declared = Mapping[tuple[type, int], Any]  # schemas and channels; None where it is not known


class DamagedFile(Exception):
    """A file is not whole; the message says after how many messages, and what is wrong."""


class ChannelInfo:
    """A topic as a channel and its schema describe it."""

    def __init__(self, channel: Channel, schema: Schema | None) -> None:
        self.topic = channel.topic
        self.type = schema.name if schema else ''
        self.encoding = channel.message_encoding
        self.definition = schema.data if schema else b''
        self.metadata = channel.metadata
        self.qos = channel.metadata.get('offered_qos_profiles', '')  # as YAML; may be empty
        self.is_ros = schema is not None and (channel.message_encoding, schema.encoding) == (
            'cdr', 'ros2msg')
        self._schema = schema
        self._decoder: Callable[[bytes], Any] | None = None

    def decode(self, data: bytes) -> Any:
        """Return a message of ROS; raises anything where it is none, or the definition none."""
        # Only who asks for a message minds whether its definition can be read.
        if self._decoder is None:
            if len(self.definition) > DEFINITION or self.definition.count(b'\n') > FIELDS:
                raise ValueError(f'its definition is longer than {DEFINITION} bytes or '
                                 f'{FIELDS} lines')
            with redirect_stderr(StringIO()):   # where its parser prints what is wrong, too
                self._decoder = DecoderFactory().decoder_for(self.encoding, self._schema)
            assert self._decoder is not None, 'a message of ROS has a decoder'
        return self._decoder(_Body(data))


class _Body(bytes):
    """A message as it is serialised; unlike bytes, it does not end silently."""

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, slice) and key.stop is not None and key.stop > len(self):
            raise ValueError('it ends amid a field')
        return super().__getitem__(key)


class Entry(NamedTuple):
    """A message, decoded if it is asked for."""

    channel: ChannelInfo
    received: int  # [ns]
    sent: int      # [ns]
    sequence: int  # of its publisher
    data: bytes

    @property
    def topic(self) -> str:
        """Return the topic that it is on."""
        return self.channel.topic

    @property
    def time(self) -> int:
        """Return when it was sent [ns]; when it was received where a recorder did not know."""
        return self.sent or self.received


class Definitions:
    """The schemas and channels of a file by their numbers: what was declared last of each."""

    def __init__(self, declared: Declared = MappingProxyType({})) -> None:
        self._declared = dict(declared)
        self._channels: dict[int, ChannelInfo] = {}

    def declare(self, item: Schema | Channel) -> bool:
        """Add what a file declares; return whether it agrees with what it declared before."""
        key = type(item), item.id
        before = self._declared.get(key)
        if before != item:
            self._declared[key] = item
            self._channels.clear()
        return before in (None, item)

    def entry(self, message: Message) -> Entry | None:
        """Return a message with its channel; None where that is not known."""
        number = message.channel_id
        if number not in self._channels:
            channel = self._declared.get((Channel, number))
            schema = channel and self._declared.get((Schema, channel.schema_id))
            if channel is None or schema is None and channel.schema_id != 0:
                return None
            self._channels[number] = ChannelInfo(channel, schema)
        return Entry(self._channels[number], message.log_time, message.publish_time,
                     message.sequence, message.data)


class Messages:
    """The messages of a file as they follow each other, each with its channel."""

    def __init__(self) -> None:
        self.entries: list[Entry] = []
        self._definitions = Definitions()

    def add(self, record: McapRecord) -> None:
        """Add a message or what declares its channel; raises ValueError where they do not fit."""
        if isinstance(record, (Schema, Channel)):
            if not self._definitions.declare(record):
                raise ValueError(f'has a second {type(record).__name__.lower()} {record.id}')
        elif isinstance(record, Message):
            entry = self._definitions.entry(record)
            if entry is None:
                raise ValueError(f'has a message of the unknown channel {record.channel_id}')
            self.entries.append(entry)


def contents(file: Path) -> bytes:
    """Return the bytes of a file; raises BagError."""
    try:
        if not file.is_file() and not file.is_dir():  # to open a pipe would wait for its writer
            raise BagError(f'cannot read {str(file)!r}: it is not a regular file')
        return file.read_bytes()
    except OSError as error:
        raise BagError(f'cannot read {str(file)!r}: {error.strerror}') from None


def read(data: bytes) -> list[Entry]:
    """Return the messages of a file in their order; raises DamagedFile where it is not whole."""
    messages = Messages()
    try:
        _read(data, messages)
    except Exception as error:  # noqa: B902  the library raises whatever damage leads to
        raise DamagedFile(f'after {len(messages.entries)} messages, then '
                          f'{one_line(error)}') from None
    return messages.entries


def _read(data: bytes, messages: Messages) -> None:
    stream, counted, indexed = BytesIO(data), None, 0
    for record in StreamReader(stream, emit_chunks=True, validate_crcs=True,
                               record_size_limit=len(data)).records:
        for item in _unpacked(record) if isinstance(record, Chunk) else (record,):
            messages.add(item)
        if isinstance(record, Statistics):
            counted = record.message_count
        elif isinstance(record, MessageIndex):
            indexed += len(record.records)
    found = len(messages.entries)
    if stream.tell() != len(data):
        raise ValueError('goes on after its end')
    if counted not in (None, found) or indexed > found:  # a record of no kind is passed over
        raise ValueError(f'counts {indexed if counted is None else counted} of them')


def _unpacked(chunk: Chunk) -> list[McapRecord]:
    # The library would unpack as much as there is, whatever the chunk says of its size.
    content = unpack(chunk.data, chunk.compression, chunk.uncompressed_size,
                     chunk.uncompressed_crc)
    if not content.verified:
        raise ValueError('has a chunk whose checksum or size is wrong')
    return breakup_chunk(dataclasses.replace(chunk, compression='', data=content.content))


class Unpacked(NamedTuple):
    """The beginning of a chunk, and how it compares with what the chunk says of itself."""

    content: bytes
    complete: bool  # of the size that it says
    verified: bool  # complete, and with the checksum that it says, if any


def unpack(data: bytes, compression: str, size: int, checksum: int) -> Unpacked:
    """
    Unpack what is to give `size` bytes, up to the first error; a checksum of 0 is none.

    It takes no more memory than these bytes fill.
    """
    content = bytearray()
    # of no data at all zstandard would read for ever
    if data and size <= LARGEST and compression in STREAMS:
        stream = STREAMS[compression](data)
        with suppress(zstandard.ZstdError, RuntimeError, EOFError, MemoryError):
            while len(content) <= size and (piece := stream.read1(PIECE)):
                content += piece
    complete = len(content) == size
    return Unpacked(bytes(content[:size]), complete,
                    complete and (checksum == 0 or zlib.crc32(content) == checksum))
