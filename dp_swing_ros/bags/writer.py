# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Writes a bag as rosbag2 does: a folder with MCAP files and metadata.yaml.

What was flushed survives the end of its process. Where the disk is full, the bag gets an end all
the same, in room that was held for it.
"""

from contextlib import contextmanager, suppress
import os
from pathlib import Path
import shlex
from typing import Iterator

from mcap.exceptions import McapError

from dp_swing_ros.bags.folder import METADATA
from dp_swing_ros.bags.mcap_writer import McapFile, Storage
from dp_swing_ros.bags.metadata import Contents, metadata, Recorded
from dp_swing_ros.errors import BagError
from dp_swing_ros.provenance import package_version

METADATA_ROOM = 1 << 16  # [bytes] on the disk, held for metadata.yaml
STEP = 1 << 16  # [bytes] held more than is needed, so that it is done rarely


class BagWriter:
    """A bag that is being written; `close` finishes it, and what was flushed survives anything."""

    def __init__(self, folder: Path, storage: Storage = Storage()) -> None:
        """
        Make the folder and begin the file.

        Raises BagError if there is something already, or if it cannot be made.
        """
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
        """
        Add a topic, before its first message.

        Raises BagError.
        """
        with self._reported():
            self._open.add(topic)
        self._topics[topic.name] = topic

    def write(self, name: str, data: bytes, received: int, sent: int, sequence: int = 0) -> None:
        """
        Append a serialised message with its receive and publication times [ns].

        Raises BagError.
        """
        with self._reported():
            if self._open.is_full(received):
                self._end_file()
                self._begin_file()
            self._open.write(name, data, received, sent, sequence)

    def flush(self) -> None:
        """
        Hand everything so far to the operating system.

        Raises BagError, also when the file was removed, which the system would not mind.
        """
        with self._reported():
            self._open.flush()
            self._hold(METADATA_ROOM + self._open.end_size)

    def close(self) -> None:
        """
        Finish the file and write metadata.yaml; a second call changes nothing.

        Raises BagError; what was flushed before can still be read.
        """
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
