# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The messages of one whole MCAP file, by the reader of the mcap library.

What that reader passes over is damage here: a checksum or a count that is wrong, a number that
two channels share, bytes after the end. What is left of a damaged file is for `recovery`.
"""

from contextlib import suppress
import dataclasses
from io import BytesIO
import mmap
from pathlib import Path
from typing import Any, NamedTuple
import zlib

import lz4.frame
from mcap.records import Channel, Chunk, McapRecord, Message, MessageIndex, Schema, Statistics
from mcap.stream_reader import breakup_chunk, StreamReader
import zstandard

from dp_swing_ros.bags.channels import ChannelInfo, Definitions
from dp_swing_ros.errors import BagError, one_line

PIECE = 1 << 16    # [bytes] unpacked at a time: what an error costs besides its own block
LARGEST = 1 << 29  # [bytes] of a chunk; writers make them of a few MiB
STREAMS: dict[str, Any] = {'': BytesIO, 'lz4': lambda data: lz4.frame.LZ4FrameFile(BytesIO(data)),
                           'zstd': zstandard.ZstdDecompressor().stream_reader}

Buffer = mmap.mmap | bytes


class DamagedFile(Exception):
    """A file is not whole; the message says after how many messages, and what is wrong."""


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
            channel = self._definitions.channel(record.channel_id)
            if channel is None:
                raise ValueError(f'has a message of the unknown channel {record.channel_id}')
            self.entries.append(Entry(channel, record.log_time, record.publish_time,
                                      record.sequence, record.data))


def contents(file: Path) -> Buffer:
    """
    Return the bytes of a file, which stay on the disk until they are looked at.

    Raises BagError.
    """
    try:
        if file.is_fifo():  # to open it would wait for its writer
            raise BagError(f'cannot read {str(file)!r}: it is not a regular file')
        with file.open('rb') as stream:
            return mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
    except ValueError:  # an empty file cannot be mapped
        return b''
    except OSError as error:
        raise BagError(f'cannot read {str(file)!r}: {error.strerror}') from None


def read(data: Buffer) -> list[Entry]:
    """
    Return the messages of a file as they follow each other.

    Raises DamagedFile where it is not whole.
    """
    messages = Messages()
    try:
        _read(data, messages)
    except Exception as error:  # noqa: B902  the library raises whatever damage leads to
        raise DamagedFile(f'after {len(messages.entries)} messages, then '
                          f'{one_line(error)}') from None
    return messages.entries


def _read(data: Buffer, messages: Messages) -> None:
    stream, counted, indexed = stream_of(data), None, 0
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


def stream_of(data: Buffer) -> Any:
    """Return the bytes of a file as the library reads them, from the first on."""
    stream = data if isinstance(data, mmap.mmap) else BytesIO(data)
    stream.seek(0)
    return stream


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
