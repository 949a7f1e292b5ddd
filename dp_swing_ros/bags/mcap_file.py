# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
One MCAP file that is being written, flush by flush.

Source: the MCAP specification and its ROS 2 profile.
"""

from collections.abc import Iterable
from contextlib import suppress
import errno
from io import FileIO
import os
from pathlib import Path
from typing import Any, NamedTuple

from mcap.records import Channel, Schema
from mcap.writer import CompressionType, Writer

from dp_swing_ros.bags.ending import end_after
from dp_swing_ros.bags.metadata import Contents, Recorded, to_yaml
from dp_swing_ros.provenance import package_version


class Storage(NamedTuple):
    """How files are written, and when the next one begins."""

    chunk_size: int = 1 << 20  # [bytes] uncompressed, after which a chunk is written anyway
    fsync: bool = False        # let each flush wait for the disk
    max_size: int = 0          # [bytes] of a file, 0: without limit
    max_duration: int = 0      # [ns] of a file, 0: without limit


INDEX_SIZE = 80    # [bytes] of a chunk in the summary
CHANNEL_SIZE = 10  # [bytes] of a channel in the index of a chunk
TOPIC_SIZE = 400   # [bytes] of a topic in the summary, beside its definition and profiles


class _Pending:
    """What the library has written and the operating system does not have yet."""

    def __init__(self) -> None:
        self.handed_over = 0  # [bytes] before it
        self._parts: list[bytes] = []
        self._size = 0

    def __len__(self) -> int:
        return self._size

    def write(self, data: bytes) -> int:
        self._parts.append(data)
        self._size += len(data)
        return len(data)

    def tell(self) -> int:
        return self.handed_over + self._size

    def flush(self) -> None:
        """Do nothing: a full disk is to be met between two calls of the library."""

    def hand_over(self, file: FileIO) -> None:
        """Write it all to a file; raises OSError, after which it is still there."""
        rest = memoryview(b''.join(self._parts))
        while rest:
            rest = rest[file.write(rest):]
        self.handed_over += self._size
        self._parts, self._size = [], 0


class McapFile:
    """A file of a bag. All methods raise OSError, after which only `rescue` may be called."""

    def __init__(self, path: Path, topics: Iterable[Recorded], storage: Storage) -> None:
        """Begin the file with these topics; leave none if that fails."""
        self.path = path
        self._counts: dict[str, int] = {}
        self._count = self._first = self._last = 0
        self._chunks = 0       # at most
        self._topics_size = 0  # [bytes]
        self._unflushed = False
        self._storage = storage
        self._schemas: dict[str, Schema] = {}    # by type
        self._channels: dict[str, Channel] = {}  # by topic
        self._pending = _Pending()
        stream: Any = self._pending
        self._writer = Writer(stream, storage.chunk_size, CompressionType.ZSTD)
        self._writer.start('ros2', f'dp_swing_ros {package_version()}')
        for topic in topics:
            self.add(topic)
        self._file = FileIO(path, 'xb')
        try:
            self._hand_over()
            if self._storage.fsync:
                _sync_folder(path.parent)
        except OSError:
            self._file.close()
            path.unlink(missing_ok=True)
            raise

    @property
    def size(self) -> int:
        """Bytes so far, without the chunk in progress."""
        return self._pending.tell()

    def is_full(self, received: int) -> bool:
        """Tell whether a message that was received then [ns] belongs into the next file."""
        return self._count > 0 and (
            0 < self._storage.max_size <= self.size
            or 0 < self._storage.max_duration <= received - self._first)

    @property
    def summary_size(self) -> int:
        """Bytes that `finish` adds at most."""
        return self._topics_size + self._chunks * (
            INDEX_SIZE + CHANNEL_SIZE * len(self._channels))

    @property
    def contents(self) -> Contents:
        """What it holds."""
        return Contents(self.path.name, self._counts, self._first, self._last)

    def add(self, topic: Recorded) -> None:
        """Add a topic, before its first message."""
        if topic.type not in self._schemas:
            data = topic.definition.encode()
            number = self._writer.register_schema(topic.type, 'ros2msg', data)
            self._schemas[topic.type] = Schema(data=data, encoding='ros2msg',
                                               id=number, name=topic.type)
        schema_id = self._schemas[topic.type].id
        about = {'offered_qos_profiles': to_yaml(topic.qos), 'topic_type_hash': topic.type_hash}
        number = self._writer.register_channel(topic.name, 'cdr', schema_id, about)
        self._channels[topic.name] = Channel(
            id=number, topic=topic.name, message_encoding='cdr', metadata=about,
            schema_id=schema_id)
        self._counts[topic.name] = 0
        self._topics_size += TOPIC_SIZE + len(topic.definition) + len(str(about))

    def write(self, name: str, data: bytes, received: int, sent: int, sequence: int) -> None:
        """Append a message with its receive and publication times [ns]."""
        self._writer.add_message(self._channels[name].id, received, data, sent, sequence)
        self._first = min(self._first, received) if self._count else received
        self._last = max(self._last, received)
        self._counts[name] += 1
        self._count += 1
        self._unflushed = True
        if self._pending:  # the chunk was full
            self._hand_over()

    def flush(self) -> None:
        """Hand every message to the operating system, and notice if it has lost the file."""
        if self._unflushed:
            self._writer.flush()
            self._hand_over()
            self._unflushed = False
        if os.fstat(self._file.fileno()).st_nlink == 0:
            raise FileNotFoundError(errno.ENOENT, 'it was removed')

    def finish(self) -> None:
        """Write the summary and close the file."""
        self.flush()  # first the messages: the summary may not fit
        self._writer.finish()
        self._hand_over()
        self._file.close()

    def rescue(self) -> None:
        """Cut what the last flush could not write whole, and give the file a legal end."""
        with suppress(OSError):
            self._file.close()
        kept = end_after(self.path, self._pending.handed_over, list(self._schemas.values()),
                         list(self._channels.values()))
        self._counts = {name: sum(each.counts.get(channel.id, 0) for each in kept)
                        for name, channel in self._channels.items()}
        self._first = min((each.chunk.message_start_time for each in kept), default=0)
        self._last = max((each.chunk.message_end_time for each in kept), default=0)

    def _hand_over(self) -> None:
        self._pending.hand_over(self._file)
        self._chunks += 1
        if self._storage.fsync:
            os.fsync(self._file.fileno())


def _sync_folder(folder: Path) -> None:
    # the name of a new file is on the disk only once its folder is
    number = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)
