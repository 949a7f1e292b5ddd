# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The messages of one whole MCAP file, by the reader of the mcap library.

What that reader passes over is damage here: a checksum or a count that is wrong, a number that
two channels share, bytes after the end. What is left of a damaged file is for `recovery`.
"""

import dataclasses
from io import BytesIO
import mmap
import os
from pathlib import Path
import stat
from typing import Any, NamedTuple

from mcap.records import Channel, Chunk, McapRecord, Message, MessageIndex, Schema, Statistics
from mcap.stream_reader import breakup_chunk, StreamReader

from dp_swing_ros.bags.channels import ChannelInfo, Definitions
from dp_swing_ros.bags.chunks import unpack
from dp_swing_ros.errors import BagError

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
        with open(file, 'rb', opener=_without_waiting) as stream:
            about = os.fstat(stream.fileno())
            if not stat.S_ISREG(about.st_mode):
                raise BagError(f'cannot read {str(file)!r}: it is not a regular file')
            size = about.st_size
            return mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) if size else b''
    except OSError as error:
        raise BagError(f'cannot read {str(file)!r}: {error.strerror}') from None


def _without_waiting(path: str, flags: int) -> int:
    # a named pipe would wait for its writer
    return os.open(path, flags | os.O_NONBLOCK)


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
        for item in unpacked(record) if isinstance(record, Chunk) else (record,):
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


def unpacked(chunk: Chunk) -> list[McapRecord]:
    """Return the records in a chunk; raises ValueError where it is damaged."""
    # The library would unpack as much as there is, whatever the chunk says of its size.
    content = unpack(chunk.data, chunk.compression, chunk.uncompressed_size,
                     chunk.uncompressed_crc)
    if not content.verified:
        raise ValueError('has a chunk whose checksum or size is wrong')
    return breakup_chunk(dataclasses.replace(chunk, compression='', data=content.content))


def one_line(error: Exception) -> str:
    """Return what an error says, in one line and not too long."""
    return ' '.join(str(error).split())[:300] or type(error).__name__
