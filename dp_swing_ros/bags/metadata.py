# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The metadata.yaml of a bag. Source: version 9 of rosbag2's metadata, that of Jazzy."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import yaml

from dp_swing_ros.errors import BagError
from dp_swing_ros.parameters.files import parse_file

METADATA = 'metadata.yaml'
VERSION = 9
AS_IT_IS = 'surrogateescape'  # how a definition that is no text is kept as one
LOST = 'lost:'   # in custom_data, before a topic: how many of its messages a logger missed
RECOVERED = 'recovered_of'  # in custom_data: of how many messages a bag is what was left


class Recorded(NamedTuple):
    """A topic as it is recorded: its type and the QoS profiles of its publishers."""

    name: str
    type: str
    definition: str  # of the type and all that it is made of
    type_hash: str
    qos: list[dict[str, Any]]  # one profile per publisher, in rosbag2's words
    encoding: str = 'cdr'                 # of the messages
    definition_encoding: str = 'ros2msg'  # nothing where there is no definition, nor a type


class Contents(NamedTuple):
    """What one file of a bag holds."""

    path: str               # within the bag's folder
    counts: dict[str, int]  # messages per topic that has some
    first: int              # [ns] receive time, 0 without a message
    last: int               # [ns]

    @property
    def messages(self) -> int:
        """Messages on all topics."""
        return sum(self.counts.values())

    def with_message(self, name: str, received: int) -> 'Contents':
        """Return what it holds with another message."""
        return self._replace(counts={**self.counts, name: self.counts.get(name, 0) + 1},
                             first=min(self.first, received) if self.messages else received,
                             last=max(self.last, received))


def metadata(topics: Iterable[Recorded], files: Sequence[Contents],
             custom: Mapping[str, str]) -> str:
    """Return the text of metadata.yaml for a bag of these topics and files."""
    # a file without a message has no time either
    times = [(file.first, file.last) for file in files if file.messages]
    first = min((first for first, _ in times), default=0)
    last = max((last for _, last in times), default=0)
    return to_yaml({'rosbag2_bagfile_information': {
        'version': VERSION, 'storage_identifier': 'mcap',
        **_extent(first, last, sum(file.messages for file in files)),
        'topics_with_message_count': [
            {'topic_metadata': {'name': topic.name, 'type': topic.type,
                                'serialization_format': topic.encoding,
                                'offered_qos_profiles': topic.qos,
                                'type_description_hash': topic.type_hash},
             'message_count': sum(file.counts.get(topic.name, 0) for file in files)}
            for topic in topics],
        'compression_format': '', 'compression_mode': '',
        'relative_file_paths': [file.path for file in files],
        'files': [{'path': file.path, **_extent(file.first, file.last, file.messages)}
                  for file in files],
        'custom_data': dict(custom), 'ros_distro': 'jazzy'}})


def to_yaml(data: Any) -> str:
    """Return data as YAML that people read, too."""
    return yaml.dump(data, Dumper=_PlainDumper, sort_keys=False, allow_unicode=True)


def _extent(first: int, last: int, count: int) -> dict[str, Any]:
    return {'duration': {'nanoseconds': last - first},
            'starting_time': {'nanoseconds_since_epoch': first}, 'message_count': count}


class _PlainDumper(yaml.SafeDumper):
    """rosbag2 reads anchors and aliases, but people do not."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


class Described(NamedTuple):
    """What metadata.yaml says of a bag's folder, or of one of its files."""

    messages: int | None = None     # None where it does not say
    files: Sequence[str] = ()       # of the folder; none of a file
    custom: Mapping[str, str] = MappingProxyType({})
    compressed: bool = False        # each message by itself, with zstd
    types: Mapping[str, str] = MappingProxyType({})   # of the topics, by name
    malformed: bool = False         # it is there, but not what rosbag2 writes

    def recorded(self, count: int, damaged: bool) -> str:
        """Return of how many messages these are what is left; nothing where they are all."""
        if RECOVERED in self.custom:
            return self.custom[RECOVERED]
        if self.messages:
            return str(self.messages) if count < self.messages else ''
        return 'unknown' if damaged else ''

    def missing(self, files: Iterable[Path]) -> list[str]:
        """Return the files that it names and that are not there under any name."""
        there = {file.name for file in files}
        lacking = [name for name in self.files if name not in there]
        return lacking if len(self.files) > len(there) else []


def described(path: Path) -> Described:
    """
    Return what metadata.yaml says of a bag's folder, or of its file; nothing without one.

    Raises BagError for messages that are compressed with anything but zstd.
    """
    file = (path if path.is_dir() else path.parent) / METADATA
    if not file.is_file():
        return Described()
    try:
        about = parse_file(file)['rosbag2_bagfile_information']
        files = {str(each['path']): each for each in about.get('files') or ()}
        names = [str(name) for name in about['relative_file_paths']]
        custom = about.get('custom_data') or {}
        count = (about if path.is_dir() else files.get(path.name, {})).get('message_count')
        mode, form = (str(about.get(f'compression_{each}') or '') for each in ('mode', 'format'))
        compressed = mode.upper() == 'MESSAGE'
        if compressed and form != 'zstd':
            raise BagError(f'the messages of {str(path)!r} are compressed with {form[:40]!r}; '
                           'expected zstd: `ros2 bag convert` makes a bag without compression')
        topics = [each['topic_metadata'] for each in about.get('topics_with_message_count') or ()]
        return Described(None if count is None else int(count), names if path.is_dir() else (),
                         {str(key): str(value) for key, value in custom.items()}, compressed,
                         {str(topic['name']): str(topic['type']) for topic in topics})
    except (AttributeError, KeyError, OSError, TypeError, ValueError):
        return Described(malformed=True)


def incomplete(count: int, recorded: str) -> str:
    """Return what every tool says of a bag that lacks some of its messages; else nothing."""
    return f'Incomplete: {count} of {recorded} messages' if recorded else ''
