# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Writes a bag as rosbag2 does: a folder with an MCAP file and metadata.yaml.

Source: the MCAP specification, its ROS 2 profile, and version 9 of rosbag2's metadata.
"""

from contextlib import contextmanager, suppress
import errno
import os
from pathlib import Path
from typing import Any, Iterator, NamedTuple

from mcap.writer import CompressionType, Writer
import yaml

from dp_swing_ros.errors import BagError

METADATA = 'metadata.yaml'
VERSION = 9  # of the metadata, that of Jazzy


class Recorded(NamedTuple):
    """A topic as its publishers offer it."""

    name: str
    type: str        # noqa: A003
    definition: str  # of the type and all that it is made of
    type_hash: str
    qos: list[dict[str, Any]]  # one profile per publisher, in rosbag2's words


class BagWriter:
    """A bag that is being written; `close` finishes it, and what was flushed survives anything."""

    def __init__(self, folder: Path) -> None:
        """
        Make the folder and begin the file.

        Raises BagError if there is something already, or if it cannot be made.
        """
        self.folder = folder
        self.counts: dict[str, int] = {}  # messages per topic
        self.failed = False
        self._topics: dict[str, Recorded] = {}
        self._channels: dict[str, int] = {}
        self._first = self._last = 0  # [ns] receive times
        self._path = folder / f'{folder.name}_0.mcap'
        with self._reported():
            folder.mkdir(parents=True)
            self._file = self._path.open('xb')
            self._writer = Writer(self._file, compression=CompressionType.ZSTD)
            self._writer.start(profile='ros2', library='dp_swing_ros')
            self._writer.flush()

    def add(self, topic: Recorded) -> None:
        """
        Add a topic, before its first message.

        Raises BagError.
        """
        with self._reported():
            schema_id = self._writer.register_schema(topic.type, 'ros2msg',
                                                     topic.definition.encode())
            self._channels[topic.name] = self._writer.register_channel(
                topic.name, 'cdr', schema_id, {'offered_qos_profiles': _yaml(topic.qos),
                                               'topic_type_hash': topic.type_hash})
        self._topics[topic.name] = topic
        self.counts[topic.name] = 0

    def write(self, name: str, data: bytes, received: int, sent: int, sequence: int = 0) -> None:
        """
        Append a serialised message with its receive and publication times [ns].

        Raises BagError.
        """
        with self._reported():
            self._writer.add_message(self._channels[name], received, data, sent, sequence)
        if not any(self.counts.values()):
            self._first = self._last = received
        self._first, self._last = min(self._first, received), max(self._last, received)
        self.counts[name] += 1

    def flush(self) -> None:
        """
        Hand everything so far to the operating system.

        Raises BagError, also when the file was removed, which the system would not mind.
        """
        with self._reported():
            self._writer.flush()
            if os.fstat(self._file.fileno()).st_nlink == 0:
                raise FileNotFoundError(errno.ENOENT, 'it was removed')

    def close(self) -> None:
        """
        Finish the file and write metadata.yaml; a second call changes nothing.

        Raises BagError; what was flushed before can still be read.
        """
        if self._file.closed:
            return
        if self.failed:
            # The end would come after a gap; without one, a reader takes what was flushed.
            with suppress(OSError):
                self._file.close()
            return
        with self._reported():
            with self._file:
                self._writer.finish()
            (self.folder / METADATA).write_text(_yaml(self._metadata()), encoding='utf-8')

    def _metadata(self) -> dict[str, Any]:
        start = {'nanoseconds_since_epoch': self._first}
        duration = {'nanoseconds': self._last - self._first}
        count = sum(self.counts.values())
        topics = [{'topic_metadata': {'name': topic.name, 'type': topic.type,
                                      'serialization_format': 'cdr',
                                      'offered_qos_profiles': topic.qos,
                                      'type_description_hash': topic.type_hash},
                   'message_count': self.counts[topic.name]} for topic in self._topics.values()]
        files = [{'path': self._path.name, 'starting_time': start, 'duration': duration,
                  'message_count': count}]
        return {'rosbag2_bagfile_information': {
            'version': VERSION, 'storage_identifier': 'mcap', 'duration': duration,
            'starting_time': start, 'message_count': count, 'topics_with_message_count': topics,
            'compression_format': '', 'compression_mode': '',
            'relative_file_paths': [self._path.name], 'files': files, 'custom_data': None,
            'ros_distro': 'jazzy'}}

    @contextmanager
    def _reported(self) -> Iterator[None]:
        try:
            yield
        except FileExistsError as error:
            raise BagError(f'{error.filename!r} exists and is not overwritten; '
                           'choose another output or remove it') from None
        except OSError as error:
            self.failed = True
            rest = '; what it holds so far can be read' if self._path.exists() else ''
            raise BagError(f'cannot write the bag {str(self.folder)!r}: '
                           f'{error.strerror}{rest}') from None


class _PlainDumper(yaml.SafeDumper):
    """rosbag2 reads anchors and aliases, but people do not."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def _yaml(data: Any) -> str:
    return yaml.dump(data, Dumper=_PlainDumper, sort_keys=False)
