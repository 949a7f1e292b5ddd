# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Saves what is whole of a damaged bag, and keeps account of what is not."""

from collections.abc import Sequence
import dataclasses
import enum
from pathlib import Path
from typing import Any, Callable, Iterator, NamedTuple

from mcap.records import Message

from dp_swing_ros.bags.channels import ChannelInfo, Definitions
from dp_swing_ros.bags.folder import (
    described_or_none, files_of, incomplete, missing_files, RECOVERED, UNKNOWN)
from dp_swing_ros.bags.mcap_reader import Buffer, contents, DamagedFile, read
from dp_swing_ros.bags.metadata import Recorded
from dp_swing_ros.bags.writer import BagWriter
from dp_swing_ros.errors import BagError
from dp_swing_ros.parameters.plain_yaml import parse, YamlError
from dp_swing_ros.recovery.index import index_fits
from dp_swing_ros.recovery.scan import Damage, Found, Scan

LATEST = 2 ** 63  # [ns] what the times of rosbag2 end at
PADDING = 12      # [bytes] that a body may have more than its definition asks for

Progress = Callable[[int, int], None]  # bytes that were read, of how many


class Fault(enum.Enum):
    """Why a message is left out."""

    CHANNEL = 'of a channel that nothing whole describes'
    ENCODING = 'in another encoding than cdr with a ros2msg definition'
    BODY = 'that are not what their type says'
    TIME = 'at a time that cannot be'
    AGAIN = 'that are there twice'
    TYPE = 'of another type than the topic had before'


@dataclasses.dataclass
class Account:
    """The messages of one topic."""

    saved: int = 0
    first: int = 0  # [ns] received
    last: int = 0
    missing: int | None = 0  # between the first and the last, by their numbers
    number: int = 0          # the last one

    def enter(self, message: Message) -> None:
        """Count a message that is saved."""
        self.first = min(self.first, message.log_time) if self.saved else message.log_time
        self.last = max(self.last, message.log_time)
        # every publisher numbers its own from 1 on: numbers that fall are those of several
        if self.missing is None or message.sequence <= self.number:
            self.missing = None
        elif self.saved:
            self.missing += message.sequence - self.number - 1
        self.number = message.sequence
        self.saved += 1


@dataclasses.dataclass
class Recovery:
    """What is whole of a bag and what is not."""

    topics: dict[str, Account] = dataclasses.field(default_factory=dict)
    damages: list[tuple[Path, Damage]] = dataclasses.field(default_factory=list)
    faults: dict[tuple[Fault, str], int] = dataclasses.field(default_factory=dict)
    notes: list[str] = dataclasses.field(default_factory=list)
    counted: int | None = 0     # messages by the files' own counts, where all have one
    described: int | None = None  # messages as metadata.yaml counts them
    before: str | None = None   # of how many the bag was already what was left
    unverified: int = 0   # saved, but no checksum says whether they are as they were

    @property
    def saved(self) -> int:
        """The number of messages."""
        return sum(account.saved for account in self.topics.values())

    @property
    def recorded(self) -> str | None:
        """How many messages there once were, as far as known; None where all are saved."""
        known = [count for count in (self.described, self.counted) if count]
        if self.before is not None:
            return self.before
        if known:
            return str(known[0]) if self.saved < known[0] else None
        return UNKNOWN if self.damages or self.faults else None

    @property
    def incomplete(self) -> str:
        """What every tool says of a bag that lacks messages; empty where all are saved."""
        return '' if self.recorded is None else incomplete(self.saved, self.recorded)

    @property
    def whole(self) -> bool:
        """Whether nothing is wrong."""
        return not (self.damages or self.faults or self.notes)

    def losses(self) -> list[str]:
        """Return what is wrong or gone, a line for each."""
        return [*self.notes,
                *(f'{file.name}, bytes {damage.begin} to {damage.end} '
                  f'({damage.end - damage.begin}): {damage.reason.value}'
                  for file, damage in self.damages),
                *(f'{count} messages{f" on {topic}" if topic else ""} {fault.value}'
                  for (fault, topic), count in self.faults.items())]


class Survivor(NamedTuple):
    """A message to save, and the topic it is on."""

    topic: Recorded
    message: Message


class MessageFilter:
    """Passes the messages to save: each once, readable, and all of a topic of one type."""

    def __init__(self) -> None:
        self._topics: dict[str, Recorded] = {}
        self._seen: set[int] = set()

    def topic_of(self, message: Message, channel: ChannelInfo | None) -> Recorded | Fault:
        """Return the topic of a message, or why it is left out."""
        if channel is None:
            return Fault.CHANNEL
        if not channel.is_ros:
            return Fault.ENCODING
        if max(message.log_time, message.publish_time) >= LATEST:
            return Fault.TIME
        if not _is_readable(message.data, channel):
            return Fault.BODY
        topic = self._topics.get(channel.topic)
        if topic is None:
            topic = self._topics[channel.topic] = _recorded(channel)
        if (topic.type, topic.definition) != (channel.type, channel.definition.decode()):
            return Fault.TYPE
        key = hash((channel.topic, message.log_time, message.publish_time, message.sequence,
                    message.data))
        if key in self._seen:
            return Fault.AGAIN
        self._seen.add(key)
        return topic


def _is_readable(data: bytes, channel: ChannelInfo) -> bool:
    """Return whether a message is as long as its definition asks for, and no longer."""
    try:
        channel.decode(data)
    except Exception:  # noqa: B902  as many kinds as there are fields
        return False
    try:
        channel.decode(data[:-PADDING])
    except Exception:  # noqa: B902
        return True
    return False


def _recorded(channel: ChannelInfo) -> Recorded:
    """Return the topic of a channel as it is written again."""
    try:
        profiles = parse(channel.qos)
    except YamlError:
        profiles = None
    return Recorded(channel.topic, channel.type, channel.definition.decode(),
                    channel.metadata.get('topic_type_hash', ''),
                    profiles if isinstance(profiles, list) else [])


def recover(path: Path, output: Path, progress: Progress = lambda done, size: None) -> Recovery:
    """
    Write what is whole of a bag to a new one, unless all of it is.

    Raises BagError where there is nothing to save, or something at the output.
    """
    found, survivors, messages = Recovery(), list[Survivor](), MessageFilter()
    about, files = described_or_none(path), files_of(path)
    if about is not None:
        found.described, found.before = about.messages, about.custom.get(RECOVERED)
    elif path.is_dir():
        found.notes.append('metadata.yaml is missing or damaged')
    found.notes += [f'{name}, which metadata.yaml names, is missing'
                    for name in missing_files(path, files)]
    for file in files:
        survivors += _survivors(_examined(file, found, progress), found, messages)
    if found.whole:
        return found
    if not survivors:
        raise BagError(f'{str(path)!r} has nothing to save: '
                       f'{"; ".join(found.losses()) or "no message"}')
    writer = BagWriter(output)
    writer.custom |= {RECOVERED: found.recorded} if found.recorded else {}
    try:
        for topic, message in survivors:
            if topic.name not in writer.counts:
                writer.add(topic)
            writer.write(topic.name, message.data, message.log_time, message.publish_time,
                         message.sequence)
    finally:
        writer.close()
    return found


def _examined(file: Path, found: Recovery, progress: Progress) -> list[Found | Damage]:
    """Return what is in a file, and add what is wrong with it as a whole."""
    data = contents(file)
    scan, items = Scan(data), list[Found | Damage]()
    for item in scan:
        items.append(item)
        progress(scan.place, len(data))
    damages = [item for item in items if isinstance(item, Damage)]
    if not all(map(Definitions().declare, (each.record for each in _declarations(items)))):
        found.notes.append(f'{file.name} declares two things of a channel or schema')
    elif not damages:
        found.notes += [f'{file.name} {text}' for text in _complaints(data)]
    found.damages += [(file, damage) for damage in damages]
    found.counted = None if found.counted is None or scan.counted is None \
        else found.counted + scan.counted
    return items


def _complaints(data: Buffer) -> Iterator[str]:
    """Yield what is wrong with a file whose bytes are all those of records."""
    try:
        read(data)
    except DamagedFile as damage:
        yield f'is damaged {damage}'
    else:
        if not index_fits(data):
            yield 'has an index that does not fit what it points to'


def _survivors(items: Sequence[Found | Damage], found: Recovery,
               messages: MessageFilter) -> Iterator[Survivor]:
    """
    Yield the messages of a file to save, and account for all.

    What the number of a channel means is what was declared last of it. After damage, which may
    have taken the declaration, it is what is declared anywhere in the file.
    """
    definitions = Definitions(_declared_anywhere(items))
    for item in items:
        if isinstance(item, Damage):
            definitions.invalidate()
        elif not isinstance(item.record, Message):
            definitions.declare(item.record)
        else:
            channel = definitions.channel(item.record.channel_id)
            topic = messages.topic_of(item.record, channel)
            if isinstance(topic, Recorded):
                found.topics.setdefault(topic.name, Account()).enter(item.record)
                found.unverified += not item.verified
                yield Survivor(topic, item.record)
            else:
                key = topic, channel.topic if channel else ''
                found.faults[key] = found.faults.get(key, 0) + 1


def _declared_anywhere(items: Sequence[Found | Damage]) -> dict[tuple[type, int], Any]:
    """Return what numbers mean, if possible where a checksum verifies it; None if two things."""
    declared: dict[bool, dict[tuple[type, int], Any]] = {False: {}, True: {}}
    for record, verified in _declarations(items):
        known, key = declared[verified], (type(record), record.id)
        if known.setdefault(key, record) != record:
            known[key] = None
    return declared[False] | declared[True]


def _declarations(items: Sequence[Found | Damage]) -> list[Any]:
    return [item for item in items
            if isinstance(item, Found) and not isinstance(item.record, Message)]
