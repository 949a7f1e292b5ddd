# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Saves what is whole of a damaged bag, and keeps account of what is not."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing, suppress
from pathlib import Path
from typing import Any, NamedTuple

from mcap.records import Message

from dp_swing_ros.bags.mcap_reader import (
    ChannelInfo, contents, DamagedFile, Data, Declared, Definitions, Entry, read, UnreadableType,
    Wanted)
from dp_swing_ros.bags.metadata import (
    AS_IT_IS, Described, described, incomplete, Recorded, RECOVERED)
from dp_swing_ros.bags.reader import files_of
from dp_swing_ros.bags.writer import BagWriter
from dp_swing_ros.errors import BagError
from dp_swing_ros.parameters.files import parse, YamlError
from dp_swing_ros.recovery.records import index_fits
from dp_swing_ros.recovery.scan import Damage, Found, Reason, Scan

LATEST = 2 ** 63  # [ns] what the times of rosbag2 end at
PADDING = 12      # [bytes] that a body may have more than its definition asks for
WRONG = 'that are not what their type says'

Progress = Callable[[Iterable[Found | Damage]], Iterable[Found | Damage]]


class Account(NamedTuple):
    """The messages of one topic that are saved."""

    saved: int = 0
    first: int = LATEST   # [ns] received
    last: int = 0
    begin: int = 0        # by the number of its publisher
    end: int = 0
    rising: bool = True   # every publisher numbers its own from 1 on: else they are of several

    @property
    def missing(self) -> int | None:
        """Return how many are between first and last, by the numbers; None if these say none."""
        return self.end - self.begin + 1 - self.saved if self.rising else None

    def with_message(self, entry: Entry) -> 'Account':
        """Return the account with another message."""
        return Account(self.saved + 1, min(self.first, entry.received),
                       max(self.last, entry.received), self.begin or entry.sequence,
                       entry.sequence, self.rising and self.end < entry.sequence)


class Recovery:
    """What is whole of a bag and what is not; of messages only the accounts are in memory."""

    def __init__(self, about: Described) -> None:
        """Begin with what metadata.yaml says of the bag."""
        self.topics: dict[str, Recorded] = {}
        self.accounts: dict[str, Account] = {}   # by topic
        self.notes: list[str] = []      # on the files
        self.damages: list[str] = []    # of bytes
        self.faults = Counter[str]()    # of messages that are left out, by what is wrong
        self.unjudged = Counter[str]()  # saved as they are, by what nobody can read
        self.counted: int | None = 0        # messages by the files' own counts, where all have one
        self.unverified = 0   # saved, but no checksum says whether they are as they were
        self._about = about
        self._declared: dict[Path, Declared] = {}
        self._counts = Counter[Path]()   # messages
        self._kinds: dict[str, tuple[Any, ...]] = {}   # of the topics' channels
        self._left_out = set[tuple[Path, int]]()  # messages by their number in the file
        self._seen: set[int] = set()              # hashes of messages to save

    @property
    def saved(self) -> int:
        """How many messages are to be saved."""
        return sum(account.saved for account in self.accounts.values())

    @property
    def recorded(self) -> str:
        """How many messages there once were, as far as known; nothing where all are saved."""
        about = self._about._replace(messages=self._about.messages or self.counted)
        return about.recorded(self.saved, bool(self.damages or self.faults))

    @property
    def incomplete(self) -> str:
        """What every tool says of a bag that lacks messages; nothing where all are saved."""
        return incomplete(self.saved, self.recorded)

    @property
    def whole(self) -> bool:
        """Whether nothing is wrong."""
        return not (self.damages or self.faults or self.notes)

    def losses(self) -> list[str]:
        """Return what is wrong or gone, a line for each."""
        return [*self.notes, *self.damages,
                *(f'{count} messages {fault}' for fault, count in self.faults.items())]

    def examine(self, file: Path, progress: Progress) -> None:
        """Add the messages of a file, and what is wrong with it."""
        with contents(file) as data:
            damages = self._examine_bytes(file, data, progress)
            # what repeats itself was recorded so, unless the file holds another
            again = any(damage.reason is Reason.SECOND_FILE for damage in damages)
            seen = self._seen if again else set[int]()
            broken = any(not damage.is_cut for damage in damages)
            for number, (entry, verified) in enumerate(self._messages(file, data)):
                fault = self._add(entry, verified, broken, seen)
                if fault:
                    self.faults[fault] += 1
                    self._left_out.add((file, number))
            self._seen |= seen

    def entries(self, file: Path) -> Iterator[Entry]:
        """Yield the messages of a file that are to be saved, once it was examined."""
        with contents(file) as data:
            for number, (entry, _) in enumerate(self._messages(file, data)):
                if entry is not None and (file, number) not in self._left_out:
                    yield entry

    def _examine_bytes(self, file: Path, data: Data, progress: Progress) -> list[Damage]:
        """Return the damages of a file, and keep what it declares and counts."""
        scan, damages, declared = Scan(data), list[Damage](), dict[tuple[type, int], Any]()
        for item in progress(scan):
            if isinstance(item, Damage):
                damages.append(item)
            elif isinstance(item.record, Message):
                self._counts[file] += 1
            else:
                # None for two things of a number, as where another file was appended
                key = type(item.record), item.record.id
                if declared.setdefault(key, item.record) != item.record:
                    declared[key] = None
        self._declared[file] = declared
        self.damages += [f'{file.name}, bytes {item.begin} to {item.end} '
                         f'({item.end - item.begin}): {item.reason.value}' for item in damages]
        self.counted = None if self.counted is None or scan.counted is None \
            else self.counted + scan.counted
        if not damages:
            try:
                read(data, Wanted(ends=()))
                if not index_fits(data):
                    self.notes.append(f'{file.name} has an index that does not fit what it '
                                      'points to')
            except DamagedFile as damage:
                self.notes.append(f'{file.name} is damaged {damage}')
        return damages

    def _messages(self, file: Path, data: Data) -> Iterator[tuple[Entry | None, bool]]:
        """Yield each message, unless nothing says whose it is, and whether it is verified."""
        # What the number of a channel means is what was declared last of it. After damage, which
        # may have taken the declaration, it is what is declared anywhere in the file.
        anywhere, compressed = self._declared[file], self._about.compressed
        definitions = Definitions(anywhere, compressed)
        left = self._counts[file]   # after the last there may be GiB of nothing
        for item in Scan(data) if left else ():
            if isinstance(item, Damage):
                definitions = Definitions(anywhere, compressed)
            elif isinstance(item.record, Message):
                yield definitions.entry(item.record), item.verified
                left -= 1
                if not left:
                    return
            else:
                definitions.declare(item.record)

    def _add(self, entry: Entry | None, verified: bool, broken: bool, seen: set[int]) -> str:
        """Account for a message, or return why it is left out."""
        if entry is None:
            return 'of a channel that nothing whole describes'
        name, kind = entry.topic, entry.channel.kind
        fault, doubt = _judged(entry)
        key = hash((name, *entry[1:]))
        if max(entry.received, entry.sent) >= LATEST:
            fault = 'at a time that cannot be'
        elif self._kinds.get(name, kind) != kind:
            fault = 'of another type than the topic had before'
        elif doubt and broken and not verified:
            fault = f'{doubt}, and no checksum verifies them'
        elif not fault and key in self._seen:
            fault = 'that are there twice'
        if fault:
            return f'on {name} {fault}'
        seen.add(key)
        if name not in self.topics:
            self.topics[name], self._kinds[name] = _recorded(entry.channel), kind
        self.accounts[name] = self.accounts.get(name, Account()).with_message(entry)
        self.unverified += not verified
        self.unjudged.update([f'on {name} {doubt}'] if doubt else [])
        return ''


def recover(path: Path, output: Path, progress: Progress = iter) -> Recovery:
    """
    Write what is whole of a bag to a new one, unless all of it is.

    `progress` goes through the contents of a file. Raises BagError where there is nothing to
    save, or something at the output.
    """
    about, files = described(path), files_of(path)
    found = Recovery(about)
    if path.is_dir() and not about.files:
        found.notes.append('metadata.yaml is missing or damaged')
    found.notes += [f'{name}, which metadata.yaml names, is missing'
                    for name in about.missing(files)]
    for file in files:
        found.examine(file, progress)
    if found.whole:
        return found
    if not found.saved:
        raise BagError(f'{str(path)!r} has nothing to save: '
                       f'{"; ".join(found.losses()) or "no message"}')
    with closing(BagWriter(output)) as writer:
        writer.custom |= {RECOVERED: found.recorded} if found.recorded else {}
        for topic in found.topics.values():
            writer.add(topic)
        for file in files:
            for entry in found.entries(file):
                writer.write(entry.topic, entry.data, entry.received, entry.sent, entry.sequence)
    return found


def _judged(entry: Entry) -> tuple[str, str]:
    """Return why a message is none, and why nobody can say whether it is one; or nothing."""
    channel = entry.channel
    try:
        data = entry.data
    except ValueError:
        return 'that are compressed and do not decompress', ''
    if not channel.definition.strip():   # as that of a type that the recorder did not know, too
        return '', 'without a definition'
    if not channel.is_ros:
        return '', f'in {channel.encoding!r}, defined in {channel.definition_encoding!r}'
    try:
        channel.decode(data)
    except UnreadableType:
        return '', 'of a type whose definition or encoding cannot be read'
    except Exception:  # noqa: B902  as many kinds as there are fields
        return WRONG, ''
    with suppress(Exception):
        channel.decode(data[:-PADDING])
        return WRONG, ''
    return '', ''


def _recorded(channel: ChannelInfo) -> Recorded:
    """Return the topic of a channel as it is written again."""
    try:
        profiles = parse(channel.qos)
    except YamlError:
        profiles = None
    return Recorded(channel.topic, channel.type, channel.definition.decode(errors=AS_IT_IS),
                    channel.metadata.get('topic_type_hash', ''),
                    profiles if isinstance(profiles, list) else [], channel.encoding,
                    channel.definition_encoding)
