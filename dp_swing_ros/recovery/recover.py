# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Saves what is whole of a damaged bag, and keeps account of what is not."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

from mcap.records import Message

from dp_swing_ros.bags.mcap_reader import (
    ChannelInfo, contents, DamagedFile, Declared, Definitions, Entry, read)
from dp_swing_ros.bags.metadata import Described, described, incomplete, Recorded, RECOVERED
from dp_swing_ros.bags.reader import files_of
from dp_swing_ros.bags.writer import BagWriter
from dp_swing_ros.errors import BagError
from dp_swing_ros.parameters.files import parse, YamlError
from dp_swing_ros.recovery.records import index_fits
from dp_swing_ros.recovery.scan import Damage, Found, Scan

LATEST = 2 ** 63  # [ns] what the times of rosbag2 end at
PADDING = 12      # [bytes] that a body may have more than its definition asks for

Items = Sequence[Found | Damage]  # of a file, in their order


class Account(NamedTuple):
    """The messages of one topic that are saved."""

    saved: int
    first: int   # [ns] received
    last: int
    missing: int | None  # between first and last, by their numbers; None where these do not say


class Recovery:
    """What is whole of a bag and what is not."""

    def __init__(self, about: Described) -> None:
        """Begin with what metadata.yaml says of the bag."""
        self.topics: dict[str, Recorded] = {}
        self.entries: list[Entry] = []  # to save
        self.notes: list[str] = []      # on the files
        self.damages: list[str] = []    # of bytes
        self.faults = Counter[str]()    # of messages that are left out, by what is wrong
        self.counted: int | None = 0        # messages by the files' own counts, where all have one
        self.unverified = 0   # saved, but no checksum says whether they are as they were
        self._about = about
        self._seen: set[int] = set()        # hashes of the entries to save

    @property
    def recorded(self) -> str:
        """How many messages there once were, as far as known; nothing where all are saved."""
        about = self._about._replace(messages=self._about.messages or self.counted)
        return about.recorded(len(self.entries), bool(self.damages or self.faults))

    @property
    def incomplete(self) -> str:
        """What every tool says of a bag that lacks messages; nothing where all are saved."""
        return incomplete(len(self.entries), self.recorded)

    @property
    def whole(self) -> bool:
        """Whether nothing is wrong."""
        return not (self.damages or self.faults or self.notes)

    def accounts(self) -> dict[str, Account]:
        """Return what is saved of each topic."""
        return {topic: _account([entry for entry in self.entries if entry.topic == topic])
                for topic in self.topics}

    def losses(self) -> list[str]:
        """Return what is wrong or gone, a line for each."""
        return [*self.notes, *self.damages,
                *(f'{count} messages {fault}' for fault, count in self.faults.items())]

    def examine(self, file: Path, progress: Callable[[Items], Iterable[Found | Damage]]) -> None:
        """Add the messages of a file, and what is wrong with it."""
        data = contents(file)
        scan = Scan(data)
        items = list(scan)
        damages = [f'{file.name}, bytes {item.begin} to {item.end} ({item.end - item.begin}): '
                   f'{item.reason.value}' for item in items if isinstance(item, Damage)]
        if not damages:
            try:
                read(data)
                if not index_fits(data):
                    self.notes.append(f'{file.name} has an index that does not fit what it '
                                      'points to')
            except DamagedFile as damage:
                self.notes.append(f'{file.name} is damaged {damage}')
        self.damages += damages
        self.counted = None if self.counted is None or scan.counted is None \
            else self.counted + scan.counted
        # What the number of a channel means is what was declared last of it. After damage, which
        # may have taken the declaration, it is what is declared anywhere in the file.
        anywhere = _declared_anywhere(items)
        definitions = Definitions(anywhere)
        for item in progress(items):
            if isinstance(item, Damage):
                definitions = Definitions(anywhere)
            elif not isinstance(item.record, Message):
                definitions.declare(item.record)
            elif (entry := definitions.entry(item.record)) is not None:
                self._add(entry, item.verified)
            else:
                self.faults['of a channel that nothing whole describes'] += 1

    def _add(self, entry: Entry, verified: bool) -> None:
        fault = self._fault(entry)
        if fault:
            self.faults[f'on {entry.topic} {fault}'] += 1
            return
        if entry.topic not in self.topics:
            self.topics[entry.topic] = _recorded(entry.channel)
        self.entries.append(entry)
        self.unverified += not verified

    def _fault(self, entry: Entry) -> str:
        """Return why a message is left out: all that are saved are readable, each once."""
        channel, data, topic = entry.channel, entry.data, self.topics.get(entry.topic)
        if not channel.is_ros:
            return 'in another encoding than cdr with a ros2msg definition'
        if max(entry.received, entry.sent) >= LATEST:
            return 'at a time that cannot be'
        if not _is_decoded(data, channel) or _is_decoded(data[:-PADDING], channel):
            return 'that are not what their type says'
        if topic is not None and (topic.type, topic.definition) != (
                channel.type, channel.definition.decode()):
            return 'of another type than the topic had before'
        key = hash((entry.topic, *entry[1:]))
        if key in self._seen:
            return 'that are there twice'
        self._seen.add(key)
        return ''


def recover(path: Path, output: Path,
            progress: Callable[[Items], Iterable[Found | Damage]] = iter) -> Recovery:
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
    if not found.entries:
        raise BagError(f'{str(path)!r} has nothing to save: '
                       f'{"; ".join(found.losses()) or "no message"}')
    with closing(BagWriter(output)) as writer:
        writer.custom |= {RECOVERED: found.recorded} if found.recorded else {}
        for topic in found.topics.values():
            writer.add(topic)
        for entry in found.entries:
            writer.write(entry.topic, entry.data, entry.received, entry.sent, entry.sequence)
    return found


def _account(entries: Sequence[Entry]) -> Account:
    times, numbers = [each.received for each in entries], [each.sequence for each in entries]
    # every publisher numbers its own from 1 on: numbers that fall are those of several
    rising = all(before < number for before, number in zip([0, *numbers], numbers))
    return Account(len(entries), min(times), max(times),
                   numbers[-1] - numbers[0] + 1 - len(numbers) if rising else None)


def _is_decoded(data: bytes, channel: ChannelInfo) -> bool:
    try:
        channel.decode(data)
    except Exception:  # noqa: B902  as many kinds as there are fields
        return False
    return True


def _recorded(channel: ChannelInfo) -> Recorded:
    """Return the topic of a channel as it is written again."""
    try:
        profiles = parse(channel.qos)
    except YamlError:
        profiles = None
    return Recorded(channel.topic, channel.type, channel.definition.decode(),
                    channel.metadata.get('topic_type_hash', ''),
                    profiles if isinstance(profiles, list) else [])


def _declared_anywhere(items: Items) -> Declared:
    """Return what numbers mean; None for two things, as where another file was appended."""
    declared: dict[tuple[type, int], Any] = {}
    for item in items:
        if isinstance(item, Found) and not isinstance(item.record, Message):
            key = type(item.record), item.record.id
            if declared.setdefault(key, item.record) != item.record:
                declared[key] = None
    return declared
