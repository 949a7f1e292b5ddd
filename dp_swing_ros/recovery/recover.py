# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Saves what is whole of a damaged bag, and keeps account of what is not."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

from mcap.records import Channel, DataEnd, Message, Schema, Statistics

from dp_swing_ros.bags.mcap_reader import (
    ChannelInfo, contents, DamagedFile, Data, Declared, Definitions, Entry, read, UnreadableType,
    Wanted)
from dp_swing_ros.bags.metadata import (
    AS_IT_IS, Described, described, incomplete, LOST, Recorded, RECOVERED)
from dp_swing_ros.bags.reader import files_of
from dp_swing_ros.bags.writer import BagWriter
from dp_swing_ros.errors import BagError
from dp_swing_ros.parameters.files import parse, YamlError
from dp_swing_ros.recovery.scan import Damage, Found, scan, summary_is_verified

LATEST = 2 ** 63  # [ns] what the times of rosbag2 end at

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
        self.counted: int | None = 0    # messages by the files' own counts, where all have one
        self._about = about
        self._declared: dict[Path, Declared] = {}
        self._kinds: dict[str, tuple[Any, ...]] = {}   # of the topics' channels
        self._left_out = set[tuple[Path, int]]()  # messages by their number in the file

    @property
    def saved(self) -> int:
        """How many messages are to be saved."""
        return sum(account.saved for account in self.accounts.values())

    @property
    def recorded(self) -> str:
        """How many messages there once were, as far as known; nothing where all are saved."""
        known = self._about.messages or self.counted
        # with more than these some are there twice, and others may be missing
        about = self._about._replace(messages=known if known and self.saved <= known else None)
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
            broken = any(not damage.is_cut for damage in damages)
            for number, (entry, verified) in enumerate(self._messages(file, data)):
                if fault := self._add(entry, verified or not broken):
                    self.faults[fault] += 1
                    self._left_out.add((file, number))

    def entries(self, file: Path) -> Iterator[Entry]:
        """Yield the messages of a file that are to be saved, once it was examined."""
        with contents(file) as data:
            for number, (entry, _) in enumerate(self._messages(file, data)):
                if entry is not None and (file, number) not in self._left_out:
                    yield entry

    def _examine_bytes(self, file: Path, data: Data, progress: Progress) -> list[Damage]:
        """Return the damages of a file, and keep what it declares and counts."""
        damages, counted = list[Damage](), None
        # what is declared where a checksum verifies it, and where none does
        verified, unverified, summary = (dict[tuple[type, int], Any]() for _ in range(3))
        of_summary = verified if summary_is_verified(data) else summary
        place = unverified
        for item in progress(scan(data)):
            if isinstance(item, Damage):
                damages.append(item)
            elif isinstance(item.record, DataEnd):
                place = of_summary
            elif isinstance(item.record, (Schema, Channel)):
                # None for two things of a number, as where another file was appended
                declared = verified if item.verified else place
                key = type(item.record), item.record.id
                if declared.setdefault(key, item.record) != item.record:
                    declared[key] = None
            elif isinstance(item.record, Statistics):
                counted = item.record.message_count
        self._declared[file] = self._trusted({**unverified, **verified}, summary)
        self.damages += [f'{file.name}, bytes {item.begin} to {item.end} '
                         f'({item.end - item.begin}): {item.reason.value}' for item in damages]
        self.counted = None if self.counted is None or counted is None \
            else self.counted + counted
        if not damages:
            try:
                read(data, Wanted(ends=()))
            except DamagedFile as damage:
                self.notes.append(f'{file.name} is damaged {damage}')
        return damages

    def _trusted(self, declared: Declared, summary: Declared) -> Declared:
        """Return what is declared, and what only a summary says of topics of metadata.yaml."""
        known = {**summary, **declared}
        for key, channel in known.items():
            if isinstance(channel, Channel):
                of_schema = Schema, channel.schema_id
                schema = known.get(of_schema)
                named = self._about.types.get(channel.topic) == (schema.name if schema else '')
                if not named and {key, of_schema} & (known.keys() - declared.keys()):
                    known[key] = None
        return known

    def _messages(self, file: Path, data: Data) -> Iterator[tuple[Entry | None, bool]]:
        """Yield each message, unless nothing says whose it is, and whether it is verified."""
        # What the number of a channel means is what was declared last of it. After damage, which
        # may have taken the declaration, it is what is declared anywhere in the file.
        declared, compressed = self._declared[file], self._about.compressed
        definitions = Definitions(declared, compressed)
        for item in scan(data):
            if isinstance(item, Damage):
                definitions = Definitions(declared, compressed)
            elif isinstance(item.record, Message):
                yield definitions.entry(item.record), item.verified
            elif isinstance(item.record, (Schema, Channel)) and (
                    item.verified or declared.get((type(item.record), item.record.id)) is None):
                definitions.declare(item.record)

    def _add(self, entry: Entry | None, trusted: bool) -> str:
        """Account for a message, or return why it is left out."""
        if entry is None:
            return 'of a channel that nothing whole describes'
        name, kind = entry.topic, entry.channel.kind
        if fault := _fault(entry, trusted):
            return f'on {name} {fault}'
        if self._kinds.setdefault(name, kind) != kind:
            return f'on {name} of another type than the topic had before'
        self.topics.setdefault(name, _recorded(entry.channel))
        self.accounts[name] = self.accounts.get(name, Account()).with_message(entry)
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
        writer.custom |= {name: text for name, text in about.custom.items()
                          if name.startswith(LOST)}
        # until all is written there is less than this, too
        writer.custom[RECOVERED] = found.recorded or str(found.saved)
        for topic in found.topics.values():
            writer.add(topic)
        for file in files:
            for entry in found.entries(file):
                writer.write(entry.topic, entry.data, entry.received, entry.sent, entry.sequence)
        if not found.recorded:
            del writer.custom[RECOVERED]
    return found


def _fault(entry: Entry, trusted: bool) -> str:
    """Return why a message is none, or cannot be trusted to be one; else nothing."""
    if max(entry.received, entry.sent) >= LATEST:
        return 'at a time that cannot be'
    try:
        data = entry.data
    except ValueError:
        return 'that are compressed and do not decompress'
    # without a definition comes a type that the recorder did not know
    if entry.channel.is_ros and entry.channel.definition.strip():
        try:
            entry.channel.decode(data)
            return ''
        except UnreadableType:
            pass
        except Exception:  # as many kinds as there are fields
            return 'that are not what their type says'
    return '' if trusted else 'that neither a checksum nor their type verifies'


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
