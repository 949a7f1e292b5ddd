# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Writes a bag as rosbag2 does: a folder with MCAP files and metadata.yaml.

What was flushed survives the end of its process. Where the disk is full, the bag gets an end all
the same, in room that was held for it. Source: the MCAP specification and its ROS 2 profile.
"""

from collections.abc import Iterable
from contextlib import contextmanager, suppress
import errno
from io import BytesIO, FileIO
import os
from pathlib import Path
import shlex
from typing import Iterator, NamedTuple

from mcap.data_stream import RecordBuilder
from mcap.exceptions import McapError
from mcap.records import DataEnd, Footer
from mcap.writer import CompressionType, MCAP0_MAGIC, Writer

from dp_swing_ros.bags.metadata import (
    AS_IT_IS, Contents, METADATA, metadata, Recorded, to_yaml)
from dp_swing_ros.errors import BagError
from dp_swing_ros.provenance import package_version

METADATA_ROOM = 1 << 16  # [bytes] on the disk, held for metadata.yaml
STEP = 1 << 16  # [bytes] held more than is needed, so that it is done rarely
INDEX_SIZE = 80    # [bytes] of a chunk in the summary
CHANNEL_SIZE = 10  # [bytes] of a channel in the index of a chunk
TOPIC_SIZE = 400   # [bytes] of a topic in the summary, beside its definition and profiles


class Storage(NamedTuple):
    """How files are written, and when the next one begins."""

    chunk_size: int = 1 << 20  # [bytes] uncompressed, after which a chunk is written anyway
    fsync: bool = False        # let each flush wait for the disk
    max_size: int = 0          # [bytes] of a file, 0: without limit
    max_duration: int = 0      # [ns] of a file, 0: without limit


class _Pending(BytesIO):
    """
    What the library has written and the operating system does not have yet.

    So a full disk is met between two calls of the library, not within one.
    """

    handed_over = 0  # [bytes] before it

    def __len__(self) -> int:
        return self.getbuffer().nbytes

    def tell(self) -> int:
        return self.handed_over + len(self)

    def hand_over(self, file: FileIO) -> None:
        """Write it all to a file; raises OSError, after which it is still there."""
        _write_at(file, self.handed_over, self.getvalue())
        self.handed_over = self.tell()
        self.seek(0)
        self.truncate()


class McapFile:
    """A file of a bag. All methods raise OSError, after which only `rescue` may be called."""

    def __init__(self, path: Path, topics: Iterable[Recorded], storage: Storage) -> None:
        """Begin the file with these topics; leave none if that fails."""
        self.contents = Contents(path.name, {}, 0, 0)
        self._storage = storage
        self._schemas: dict[tuple[str, str, bytes], int] = {}   # by type and definition
        self._channels: dict[str, int] = {}  # by topic
        self._summary_size = self._largest = 0  # [bytes] at most, of the summary and a flush
        self._finished = False
        self._handed_over: list[tuple[int, Contents]] = []  # of the last two times, the sizes
        self._pending = _Pending()
        self._writer = Writer(self._pending, storage.chunk_size, CompressionType.ZSTD)
        self._writer.start(profile='ros2', library=f'dp_swing_ros {package_version()}')
        for topic in topics:
            self.add(topic)
        self._file = FileIO(path, 'xb')
        try:
            self._hand_over()
            if storage.fsync:
                _sync_folder(path.parent)
        except OSError:
            self._file.close()
            path.unlink(missing_ok=True)
            raise

    @property
    def size(self) -> int:
        """Bytes so far, without the chunk in progress."""
        return self._pending.tell()

    @property
    def end_size(self) -> int:
        """Bytes that a last flush and `finish` add at most, if it is no larger than others."""
        return self._largest + self._summary_size

    def is_full(self, received: int) -> bool:
        """Return whether a message that was received then [ns] belongs into the next file."""
        return self.contents.messages > 0 and (
            0 < self._storage.max_size <= self.size
            or 0 < self._storage.max_duration <= received - self.contents.first)

    def add(self, topic: Recorded) -> None:
        """Add a topic, before its first message."""
        schema = (topic.type, topic.definition_encoding, topic.definition.encode(errors=AS_IT_IS))
        if schema not in self._schemas:
            self._schemas[schema] = self._writer.register_schema(*schema) if any(schema) else 0
        about = {'offered_qos_profiles': to_yaml(topic.qos), 'topic_type_hash': topic.type_hash}
        self._channels[topic.name] = self._writer.register_channel(
            topic.name, topic.encoding, self._schemas[schema], about)
        self._summary_size += TOPIC_SIZE + len(topic.definition) + len(str(about))

    def write(self, name: str, data: bytes, received: int, sent: int, sequence: int) -> None:
        """Append a message with its receive and publication times [ns]."""
        self._writer.add_message(self._channels[name], received, data, sent, sequence)
        self.contents = self.contents.with_message(name, received)
        self._hand_over()  # where the chunk was full

    def flush(self) -> None:
        """Hand every message to the operating system, and notice if it has lost the file."""
        self._writer.flush()
        self._hand_over()
        if os.fstat(self._file.fileno()).st_nlink == 0:
            raise FileNotFoundError(errno.ENOENT, 'it was removed')

    def finish(self) -> None:
        """Write the summary and close the file."""
        self.flush()  # first the messages: the summary may not fit
        if not self._finished:
            self._writer.finish()
            self._finished = True
        self._hand_over()
        self._file.truncate()
        self._file.close()

    def rescue(self) -> None:
        """
        Give the file a legal end, after the last flush if there is room now for the rest of it.

        Else the end has no summary, and takes the place of this flush or of that before.
        """
        with suppress(OSError):
            self.finish()
            return
        with self._file:
            for size, contents in reversed(self._handed_over):
                with suppress(OSError):
                    self._end_at(size)
                    self.contents = contents
                    return
        raise OSError(errno.ENOSPC, 'no room for an end')

    def _end_at(self, size: int) -> None:
        if os.fstat(self._file.fileno()).st_nlink == 0:
            raise FileNotFoundError(errno.ENOENT, 'it was removed')
        end = RecordBuilder()
        DataEnd(data_section_crc=0).write(end)
        Footer(summary_start=0, summary_offset_start=0, summary_crc=0).write(end)
        # It is cut last: the blocks behind may be all that a full disk has for the end.
        _write_at(self._file, size, end.end() + MCAP0_MAGIC)
        self._file.truncate()

    def _hand_over(self) -> None:
        if not len(self._pending):
            return
        self._largest = max(self._largest, len(self._pending))
        self._pending.hand_over(self._file)
        self._handed_over = [*self._handed_over[-1:], (self.size, self.contents)]
        self._summary_size += INDEX_SIZE + CHANNEL_SIZE * len(self._channels)
        if self._storage.fsync:
            os.fsync(self._file.fileno())


def _write_at(file: FileIO, place: int, data: bytes) -> None:
    file.seek(place)
    while data:
        data = data[file.write(data):]


def _sync_folder(folder: Path) -> None:
    # the name of a new file is on the disk only once its folder is
    number = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)


class BagWriter:
    """
    A bag that is being written; `close` finishes it, and what was flushed survives anything.

    All methods raise BagError; what was flushed before can still be read.
    """

    def __init__(self, folder: Path, storage: Storage = Storage()) -> None:
        """Make the folder, if there is nothing already, and begin the file."""
        self.folder = folder
        self.failed = False
        self.custom = {'dp_swing_ros': package_version()}  # for metadata.yaml
        self._storage = storage
        self._reserve, self._reserved = folder / '.reserve', 0  # file, [bytes]
        self._topics: dict[str, Recorded] = {}
        self._ended: list[Contents] = []  # files
        self._file: McapFile | None = None
        self._closed = False
        with self._reported():
            folder.mkdir(parents=True)
            self._begin_file()
            self._hold(METADATA_ROOM)

    @property
    def counts(self) -> dict[str, int]:
        """Messages per topic."""
        files = [*self._ended, *([self._file.contents] if self._file else [])]
        return {name: sum(file.counts.get(name, 0) for file in files) for name in self._topics}

    def add(self, topic: Recorded) -> None:
        """Add a topic, before its first message."""
        with self._reported():
            self._open.add(topic)
        self._topics[topic.name] = topic

    def write(self, name: str, data: bytes, received: int, sent: int, sequence: int = 0) -> None:
        """Append a serialised message with its receive and publication times [ns]."""
        with self._reported():
            if self._open.is_full(received):
                self._end_file()
                self._begin_file()
            self._open.write(name, data, received, sent, sequence)

    def flush(self) -> None:
        """Hand everything so far to the operating system; fails also if the file was removed."""
        with self._reported():
            self._open.flush()
            self._hold(METADATA_ROOM + self._open.end_size)

    def close(self) -> None:
        """Finish the file and write metadata.yaml; a second call changes nothing."""
        if self._closed:
            return
        self._closed = True
        self._release()
        try:
            if not self.failed:
                with self._reported():
                    self._end_file()
        finally:
            with suppress(OSError) if self.failed else self._reported():
                self._describe()

    @property
    def _open(self) -> McapFile:
        assert self._file is not None, 'nothing can be written after a failure'
        return self._file

    def _begin_file(self) -> None:
        path = self.folder / f'{self.folder.name}_{len(self._ended)}.mcap'
        self._file = McapFile(path, self._topics.values(), self._storage)

    def _end_file(self) -> None:
        self._open.finish()
        self._ended.append(self._open.contents)
        self._file = None

    def _hold(self, size: int) -> None:
        """Hold room for the end of the bag; a disk without it will raise soon enough."""
        if size > self._reserved:
            with suppress(OSError), self._reserve.open('ab') as file:
                os.posix_fallocate(file.fileno(), 0, size + STEP)
                self._reserved = size + STEP

    def _release(self) -> None:
        with suppress(OSError):
            self._reserve.unlink()

    def _describe(self) -> None:
        if not self._ended:
            return
        path = self.folder / METADATA
        try:
            with path.open('w', encoding='utf-8') as file:
                file.write(metadata(self._topics.values(), self._ended, self.custom))
                if self._storage.fsync:
                    file.flush()
                    os.fsync(file.fileno())
        except OSError:
            path.unlink(missing_ok=True)  # better none than half of one
            raise

    def _rescue(self) -> str:
        """Return what to say of the messages so far."""
        self._release()
        if self._file is not None:
            try:
                self._file.rescue()
                self._ended.append(self._file.contents)
            except (McapError, OSError):
                self._ended.clear()  # metadata.yaml would not name all files
            self._file = None
        if not any(self.folder.glob('*.mcap')):
            return ''
        return ('; what it holds so far can be read, and `ros2 run dp_swing_ros recover '
                f'{shlex.quote(str(self.folder))}` makes a whole bag of it')

    @contextmanager
    def _reported(self) -> Iterator[None]:
        try:
            yield
        except FileExistsError as error:
            self.failed = True
            raise BagError(f'{error.filename!r} exists and is not overwritten; '
                           'choose another output or remove it') from None
        except OSError as error:
            self.failed = True
            raise BagError(f'cannot write the bag {str(self.folder)!r}: '
                           f'{error.strerror}{self._rescue()}') from None
