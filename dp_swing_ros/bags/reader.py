# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the messages of a bag, topic by topic; needs no ROS."""

from collections.abc import Iterable, Sequence
from pathlib import Path
import re
import shlex
from typing import Any, Callable, TypeVar

from mcap.writer import MCAP0_MAGIC as MAGIC

from dp_swing_ros.bags.mcap_reader import (
    ChannelInfo, compressed_file, contents, DamagedFile, Data, Entry, read, UnreadableType,
    Wanted)
from dp_swing_ros.bags.metadata import described, incomplete
from dp_swing_ros.errors import BagError, one_line
from dp_swing_ros.topics import JOINT_STATES, Topic, TOPICS

R = TypeVar('R')
SQLITE = b'SQLite format 3\0'
OURS = tuple(f'/{topic.name.lstrip("/")}' for topic in TOPICS)  # ends of names
NAMED = 10  # files that an error names at most


class Bag:
    """The messages in a bag of one pendulum."""

    def __init__(self, path: Path | str, partial: bool = False,
                 namespace: str | None = None, nodes: Sequence[str] = (),
                 topics: Iterable[str] = OURS) -> None:
        """
        Read the folder of a bag, or its MCAP file; arguments and errors as of `read_episode`.

        Of several nodes that do the same, `nodes` names those that count. Only of topics whose
        names end as some of `topics` do there is more than the times.

        `incomplete` says how many messages are there of how many, and is empty where all are.
        """
        self.path, self.partial, self.namespace = Path(path), partial, namespace
        self.nodes = {f'/{node.lstrip("/")}' for node in nodes}
        files, self.about = files_of(self.path), described(self.path)
        missing = self.about.missing(files)
        self._cut = bool(missing)
        if missing and not partial:
            raise BagError(f'{self} lacks {", ".join(missing)}, which its metadata.yaml names; '
                           'put the file there or ask for what is there (partial)')
        self._wanted = Wanted(tuple(topics), self.about.compressed)
        # a file need not hold them in the order in which they were received
        self.entries = sorted((entry for file in files for entry in self._read(file)),
                              key=lambda entry: entry.received)
        self.channels: dict[str, ChannelInfo] = {}  # by topic
        for entry in self.entries:
            self.channels.setdefault(entry.topic, entry.channel)
        self.topics = sorted(self.channels)
        if namespace is not None and not self.has(JOINT_STATES):
            raise BagError(f'{self} has no {JOINT_STATES.name} in the namespace {namespace!r}: '
                           f'{self._found()}')
        count = len(self.entries)
        self.incomplete = incomplete(count, self.about.recorded(count, self._cut))

    def __repr__(self) -> str:
        return f'the bag {str(self.path)!r}'

    def _read(self, file: Path) -> list[Entry]:
        with contents(file) as data:
            if data[:len(MAGIC)] != MAGIC:
                if data[:len(SQLITE)] == SQLITE:
                    raise BagError(f'{str(file)!r} is of sqlite3; {conversion(file.parent)}')
                raise BagError(f'{str(file)!r} is no MCAP file; if it was one, {self._remedy()} '
                               'of what is left')
            try:
                return read(data, self._wanted)
            except DamagedFile as error:
                return self._beginning(file, data, error)

    def _beginning(self, file: Path, data: Data, error: DamagedFile) -> list[Entry]:
        """Return the messages of a file whose logger was killed, if these are wanted."""
        # not above: a whole bag is read without what goes through damaged ones
        from dp_swing_ros.recovery.scan import beginning_of
        entries, damage = beginning_of(data, self._wanted)
        if damage is None or not damage.is_cut:
            where = error if damage is None else (
                f'after {len(entries)} messages, at byte {damage.begin}: '
                f'{damage.reason.value}')
            raise BagError(f'{str(file)!r} is damaged {where}; {self._remedy()} of what is left')
        if not self.partial:
            raise BagError(f'{str(file)!r} has {len(entries)} messages but no end, as if its '
                           f'logger was killed; ask for what is there (partial), or '
                           f'{self._remedy()}')
        self._cut = True
        return entries

    def _remedy(self) -> str:
        path = shlex.quote(str(self.path))
        return f'`ros2 run dp_swing_ros recover {path}` makes a whole one'

    def has(self, topic: Topic) -> bool:
        """Return whether there are messages on a topic."""
        return bool(self._names(topic))

    def of(self, topic: Topic) -> list[Any]:
        """Return the messages on a topic as they were received; raises as `entries_of`."""
        return [self.decoded(entry) for entry in self.entries_of(topic)]

    def any_of(self, topic: Topic) -> list[Any]:
        """Return the messages on a topic, which may have none; else raises as `entries_of`."""
        return self.of(topic) if self.has(topic) else []

    def entries_of(self, topic: Topic) -> list[Entry]:
        """Return a topic's entries; raises BagError for none, or those of several pendulums."""
        names = self._names(topic)
        if not names:
            raise BagError(f'{self} has nothing on {topic.name}: {self._found()}; '
                           'record a run with the logger')
        if len(names) > 1:
            raise BagError(f'{self} has several pendulums: {self._found()}; choose one with '
                           f'--namespace, as in --namespace {_namespace(names[-1], topic)}')
        entries = [entry for entry in self.entries if entry.topic == names[0]]
        for kind in {entry.channel.type for entry in entries}:
            if kind.replace('/msg/', '/') != topic.type.replace('/msg/', '/'):
                raise BagError(f'{self} has {names[0]} as {kind!r}; expected '
                               f'{topic.type}: record a run with the logger')
        return entries

    def _names(self, topic: Topic) -> list[str]:
        names = [name for name in self.topics
                 if name == topic.name or name.endswith('/' + topic.name.lstrip('/'))]
        if self.namespace is None or topic.name.startswith('/'):
            return names
        chosen = f'/{self.namespace.strip("/")}'
        return [name for name in names if _namespace(name, topic) == chosen]

    def chosen(self, role: str, names: Sequence[str]) -> str:
        """Return which node of some is to play a role; raises BagError where nobody said."""
        found = [name for name in names if f'/{name.lstrip("/")}' in self.nodes] or names
        if len(found) > 1:
            raise BagError(f'{self} has {len(found)} nodes of the kind {role}: '
                           f'{", ".join(found)}; choose one with --node, as in --node {found[0]}')
        return found[0]

    def _found(self) -> str:
        return f'it holds messages of {", ".join(self.topics) or "no topic"}'

    def decoded(self, entry: Entry) -> Any:
        """Return the message of an entry; raises BagError where it is none of its type."""
        if not entry.channel.is_ros:
            raise BagError(f'{self} has {entry.topic} in another encoding; '
                           'expected cdr messages with a ros2msg definition')
        try:
            return entry.channel.decode(entry.data)
        except UnreadableType as error:
            raise BagError(
                f'{self} has a message on {entry.topic} that is no {entry.channel.type} as far as '
                f'can be read: {one_line(error)}; record it anew') from None
        except Exception as error:
            # A wrong body or definition fails in as many ways as there are kinds of fields.
            raise BagError(f'{self} has a message on {entry.topic}, received at {entry.received} '
                           f'ns, that is no {entry.channel.type}: {one_line(error)}; '
                           f'{self._remedy()} without it') from None

    def parse(self, parse: Callable[..., R], *arguments: Any) -> R:
        """
        Call a function that reads what messages say.

        Raises BagError where it raises ValueError, as for a field that is not there, or numbers
        that no run has.
        """
        try:
            return parse(*arguments)
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
            raise BagError(f'{self} is not one of this pendulum: {one_line(error)}') from None


def _namespace(name: str, topic: Topic) -> str:
    return f'/{name.removesuffix(topic.name).strip("/")}'


def files_of(path: Path) -> list[Path]:
    """Return the MCAP files of a bag, in their order; raises BagError."""
    try:
        if path.is_file():
            return [path]
        if not path.exists():
            raise BagError(f'there is no bag {str(path)!r}')
        if not path.is_dir():
            raise BagError(f'cannot read {str(path)!r}: it is neither a folder nor a regular file')
        names = sorted(file.name for file in path.iterdir())
    except OSError as error:
        raise BagError(f'cannot read {str(path)!r}: {error.strerror}') from None
    files = sorted((path / name for name in names if name.endswith('.mcap')), key=_in_order)
    for name in names:
        if name.endswith('.mcap.zstd') and name.removesuffix('.zstd') not in names:
            raise compressed_file(path / name)
    if not files:
        found = ', '.join([*names[:NAMED], *(['...'] if len(names) > NAMED else [])]) or 'nothing'
        raise BagError(f'{str(path)!r} is no bag with an MCAP file, it holds {found}; '
                       f'a bag of another storage: {conversion(path)}')
    return files


def conversion(folder: Path) -> str:
    """Return the commands that make a bag of MCAP of one of another storage."""
    source, target = (shlex.quote(str(folder.resolve()) + end) for end in ('', '_mcap'))
    return (f'`rosbags-convert --src {source} --dst {target} --dst-storage mcap` (pip install '
            f'rosbags) makes one of MCAP, and so does `ros2 bag convert -i {source} -o mcap.yaml` '
            f'with `output_bags: [{{uri: {target}, storage_id: mcap, all_topics: true}}]` in '
            'mcap.yaml')


def _in_order(file: Path) -> list[int | str]:
    # bag_2 before bag_10
    return [int(part) if part.isdecimal() else part for part in re.split(r'(\d+)', file.name)]
