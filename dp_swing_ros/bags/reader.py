# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Reads the messages of a bag, topic by topic; needs no ROS."""

from pathlib import Path
import re
import shlex
from typing import Any, Callable, Iterator, NamedTuple, TypeVar

from mcap.records import Message

from dp_swing_ros.bags.channels import Channels
from dp_swing_ros.bags.damage import Damage, Reason
from dp_swing_ros.bags.metadata import Described, described, incomplete, RECOVERED, UNKNOWN
from dp_swing_ros.bags.records import MAGIC
from dp_swing_ros.bags.salvage import contents, Scan
from dp_swing_ros.errors import BagError
from dp_swing_ros.topics import JOINT_STATES, Topic

R = TypeVar('R')
ENDLESS = (Reason.CUT, Reason.NO_END)
SQLITE = b'SQLite format 3\0'
NAMED = 10  # files that an error names at most


class Entry(NamedTuple):
    """A message, decoded if it is asked for."""

    topic: str
    received: int  # [ns]
    sent: int      # [ns]
    sequence: int  # of its publisher
    data: bytes
    decode: Callable[[bytes], Any] | None  # None if it is not of ROS 2
    type: str  # noqa: A003  as its schema is called


class Offer(NamedTuple):
    """A topic as its publishers offered it."""

    type: str      # noqa: A003
    encoding: str  # of its messages
    qos: str       # YAML, a list of a profile per publisher; may be empty


class Bag:
    """The messages in a bag of one pendulum."""

    def __init__(self, path: Path | str, partial: bool = False,
                 namespace: str | None = None) -> None:
        """
        Read the folder of a bag, or its MCAP file.

        A file without an end, as a logger leaves that was killed, is read only if `partial`. Of
        several pendulums the namespace, such as '/second', says which.
        `incomplete` says how many messages are there of how many, and is empty where all are.
        Raises BagError, saying what was found, what is expected and what to do.
        """
        self.path, self.partial, self.namespace = Path(path), partial, namespace
        files = files_of(self.path)
        missing = missing_files(self.path, files)
        self._cut = bool(missing)
        if missing and not partial:
            raise BagError(f'{self} lacks {", ".join(missing)}, which its metadata.yaml names; '
                           'put the file there or ask for what is there (partial)')
        self.offers: dict[str, Offer] = {}  # by topic
        self.entries = [entry for file in files for entry in self._entries(file, partial)]
        self.topics = sorted({entry.topic for entry in self.entries})
        if namespace is not None and not self.has(JOINT_STATES):
            raise BagError(f'{self} has no {JOINT_STATES.name} in the namespace {namespace!r}: '
                           f'it holds messages of {", ".join(self.topics) or "no topic"}')
        self.incomplete = self._incomplete(described_or_none(self.path))

    def __repr__(self) -> str:
        return f'the bag {str(self.path)!r}'

    def _incomplete(self, about: Described | None) -> str:
        count = len(self.entries)
        counted = about.messages if about is not None else None
        before = about.custom.get(RECOVERED) if about is not None else None
        if before is not None:
            return incomplete(count, before)
        if counted is None:
            return incomplete(count, UNKNOWN) if self._cut else ''
        return incomplete(count, counted) if count < counted else ''

    def _entries(self, file: Path, partial: bool) -> Iterator[Entry]:
        data, channels, count = contents(file), Channels(), 0
        if data[:len(MAGIC)] != MAGIC:
            if data[:len(SQLITE)] == SQLITE:
                raise BagError(f'{str(file)!r} is of sqlite3; {_conversion(file.parent)}')
            raise BagError(f'{str(file)!r} is no MCAP file; if it was one, {_remedy(self.path)} '
                           'of what is left')
        for item in Scan(data):
            if isinstance(item, Damage):
                if item.reason in ENDLESS and partial:
                    self._cut = True
                    return
                self._object(file, item, count)
            elif isinstance(item.record, Message):
                line = channels.line(item.record.channel_id)
                if line is None:
                    raise self._damaged(file, count, 'then has a message of the unknown channel '
                                        f'{item.record.channel_id}')
                count += 1
                if line.topic not in self.offers:
                    self.offers[line.topic] = Offer(line.type, line.encoding, line.metadata.get(
                        'offered_qos_profiles', ''))
                yield Entry(line.topic, item.record.log_time, item.record.publish_time,
                            item.record.sequence, item.record.data, line.decode, line.type)
            elif not channels.tell(item.record):
                kind = type(item.record).__name__.lower()
                raise self._damaged(file, count, f'then has a second {kind} {item.record.id}')

    def _object(self, file: Path, damage: Damage, count: int) -> None:
        if damage.reason in ENDLESS:
            raise BagError(f'{str(file)!r} has {count} messages but no end, as if its logger was '
                           f'killed; ask for what is there (partial), or {_remedy(self.path)}')
        if damage.reason is not Reason.INDEX:  # nothing here is read by an index
            raise self._damaged(file, count, f'at byte {damage.begin}: {damage.reason.value}')

    def _damaged(self, file: Path, count: int, how: str) -> BagError:
        return BagError(f'{str(file)!r} is damaged after {count} messages, {how}; '
                        f'{_remedy(self.path)} of what is left')

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
            raise BagError(f'{self} has several pendulums: {found}; choose one with --namespace, '
                           f'as in --namespace {_namespace(names[-1], topic)}')
        entries = [entry for entry in self.entries if entry.topic == names[0]]
        for entry in entries:
            if entry.type.replace('/msg/', '/') != topic.type.replace('/msg/', '/'):
                raise BagError(f'{self} has {entry.topic} as {entry.type!r}; expected '
                               f'{topic.type}: record a run with the logger')
        return entries

    def _names(self, topic: Topic) -> list[str]:
        names = [name for name in self.topics
                 if name == topic.name or name.endswith('/' + topic.name.lstrip('/'))]
        if self.namespace is None or topic.name.startswith('/'):
            return names
        chosen = f'/{self.namespace.strip("/")}'
        return [name for name in names if _namespace(name, topic) == chosen]

    def decoded(self, entry: Entry) -> Any:
        """
        Return the message of an entry.

        Raises BagError where it is not one of ROS 2, or not one of its type.
        """
        if entry.decode is None:
            raise BagError(f'{self} has {entry.topic} in another encoding; '
                           'expected cdr messages with a ros2msg definition')
        try:
            return entry.decode(entry.data)
        except Exception as error:  # noqa: B902
            # A wrong body or definition fails in as many ways as there are kinds of fields.
            raise BagError(f'{self} has a message on {entry.topic}, received at {entry.received} '
                           f'ns, that is no {entry.type}: {_one_line(error)}; '
                           f'{_remedy(self.path)} without it') from None

    def parse(self, parse: Callable[..., R], *arguments: Any) -> R:
        """
        Call a function that reads what messages say.

        Raises BagError where it raises ValueError, as for a field that is not there, or numbers
        that no run has.
        """
        try:
            return parse(*arguments)
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
            raise BagError(f'{self} is not one of this pendulum: {_one_line(error)}') from None


def _namespace(name: str, topic: Topic) -> str:
    return f'/{name.removesuffix(topic.name).strip("/")}'


def _one_line(error: Exception) -> str:
    return ' '.join(str(error).split())[:300] or type(error).__name__


def _remedy(path: Path) -> str:
    return f'`ros2 run dp_swing_ros recover {shlex.quote(str(path))}` makes a whole one'


def files_of(path: Path) -> list[Path]:
    """
    Return the MCAP files of a bag, in their order.

    Raises BagError.
    """
    try:
        return _files(path)
    except OSError as error:
        raise BagError(f'cannot read {str(path)!r}: {error.strerror}') from None


def missing_files(path: Path, files: list[Path]) -> list[str]:
    """Return the files that metadata.yaml names and that are not there under any name."""
    names, there = listed_files(path) or [], {file.name for file in files}
    return [name for name in names if name not in there] if len(names) > len(there) else []


def listed_files(path: Path) -> list[str] | None:
    """Return the files that metadata.yaml names; None where it is missing or no metadata."""
    about = described_or_none(path) if path.is_dir() else None
    return None if about is None else about.files


def described_or_none(path: Path) -> Described | None:
    """Return what metadata.yaml says; None also where it is damaged: a bag is read without."""
    try:
        return described(path)
    except ValueError:
        return None


def _files(path: Path) -> list[Path]:
    if path.is_file():
        return [path]
    if not path.exists():
        raise BagError(f'there is no bag {str(path)!r}')
    if not path.is_dir():
        raise BagError(f'cannot read {str(path)!r}: it is neither a folder nor a regular file')
    files = sorted(path.glob('*.mcap'), key=_in_order)
    if not files:
        names = sorted(file.name for file in path.iterdir())
        found = ', '.join([*names[:NAMED], *(['...'] if len(names) > NAMED else [])]) or 'nothing'
        raise BagError(f'{str(path)!r} is no bag with an MCAP file, it holds {found}; '
                       f'a bag of another storage: {_conversion(path)}')
    return files


def _conversion(folder: Path) -> str:
    source, target = (shlex.quote(str(folder.resolve()) + end) for end in ('', '_mcap'))
    return (f'`rosbags-convert --src {source} --dst {target} --dst-storage mcap` (pip install '
            f'rosbags) makes one of MCAP, and so does `ros2 bag convert -i {source} -o mcap.yaml` '
            f'with `output_bags: [{{uri: {target}, storage_id: mcap, all_topics: true}}]` in '
            'mcap.yaml')


def _in_order(file: Path) -> list[int | str]:
    # bag_2 before bag_10
    return [int(part) if part.isdecimal() else part for part in re.split(r'(\d+)', file.name)]
