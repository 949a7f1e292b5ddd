# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Saves what is whole of a damaged bag, and keeps account of what is not."""

import dataclasses
import enum
from pathlib import Path
from typing import Callable, Iterator, NamedTuple

from mcap.records import Message

from dp_swing_ros.bags.channels import Channels, has_surplus, Line, recorded
from dp_swing_ros.bags.damage import Damage, Reason
from dp_swing_ros.bags.metadata import incomplete, RECOVERED, UNKNOWN
from dp_swing_ros.bags.reader import (
    described_or_none, files_of, listed_files, missing_files)
from dp_swing_ros.bags.salvage import contents, Scan
from dp_swing_ros.bags.writer import BagWriter, Recorded
from dp_swing_ros.errors import BagError

LATEST = 2 ** 63  # [ns] what the times of rosbag2 end at

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
    told: int | None = 0  # messages by the bag's own count, if it is whole
    counted: int | None = None  # messages as metadata.yaml counts them
    before: str | None = None   # of how many the bag was already what was left
    unvouched: int = 0    # saved, but no checksum tells whether they are as they were

    @property
    def saved(self) -> int:
        """The number of messages."""
        return sum(account.saved for account in self.topics.values())

    @property
    def recorded(self) -> str | None:
        """How many messages there once were, as far as known; None where all are saved."""
        known = [count for count in (self.counted, self.told) if count]
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


class Survivor(NamedTuple):
    """A message to save, and the topic it is on."""

    topic: Recorded
    message: Message


def recover(path: Path, output: Path, progress: Progress = lambda done, size: None) -> Recovery:
    """
    Write what is whole of a bag to a new one, unless all of it is.

    Raises BagError where there is nothing to save, or something at the output.
    """
    definitions = {file: Channels() for file in files_of(path)}
    found = _examine(path, definitions)
    if found.whole:
        list(_survivors(definitions, found, progress))
        if found.whole:
            return found
        found.topics, found.faults, found.unvouched = {}, {}, 0
    writer: BagWriter | None = None
    try:
        for topic, message in _survivors(definitions, found, progress):
            writer = writer or BagWriter(output)
            if topic.name not in writer.counts:
                writer.add(topic)
            writer.write(topic.name, message.data, message.log_time, message.publish_time,
                         message.sequence)
    finally:
        if writer is not None:
            writer.custom |= {RECOVERED: found.recorded} if found.recorded else {}
            writer.close()
    if writer is None:
        raise BagError(f'{str(path)!r} has nothing to save: '
                       f'{"; ".join([*found.notes, *described(found)]) or "no message"}')
    return found


def described(found: Recovery) -> Iterator[str]:
    """Return what is gone, a line for each loss."""
    for file, damage in found.damages:
        yield (f'{file.name}, bytes {damage.begin} to {damage.end} '
               f'({damage.end - damage.begin}): {damage.reason.value}')
    for (fault, topic), count in found.faults.items():
        yield f'{count} messages{f" on {topic}" if topic else ""} {fault.value}'


def _examine(path: Path, definitions: dict[Path, Channels]) -> Recovery:
    """Look for damage, and gather what each file says of its channels anywhere."""
    found, about = Recovery(), described_or_none(path)
    if about is not None:
        found.counted, found.before = about.messages, about.custom.get(RECOVERED)
    if path.is_dir() and listed_files(path) is None:
        found.notes.append('metadata.yaml is missing or damaged')
    found.notes += [f'{name}, which metadata.yaml names, is missing'
                    for name in missing_files(path, list(definitions))]
    for file, channels in definitions.items():
        scan = Scan(contents(file))
        for item in scan:
            if isinstance(item, Damage):
                found.damages.append((file, item))
            elif not isinstance(item.record, Message) and not channels.tell(
                    item.record, item.verified):
                note = f'{file.name} tells two things of a channel or schema'
                found.notes += [note] if note not in found.notes else []
        found.told = None if found.told is None or scan.told is None else found.told + scan.told
    return found


def _survivors(definitions: dict[Path, Channels], found: Recovery,
               progress: Progress) -> Iterator[Survivor]:
    judge = _Judge()
    size = sum(len(contents(file)) for file in definitions)
    before = 0
    for file, elsewhere in definitions.items():
        data = contents(file)
        scan, channels = Scan(data), Channels(elsewhere)
        for item in scan:
            if isinstance(item, Damage):
                if item.reason is not Reason.INDEX:
                    channels.doubt()
            elif not isinstance(item.record, Message):
                channels.tell(item.record, item.verified)
            else:
                line = channels.line(item.record.channel_id)
                verdict = judge.verdict(item.record, line)
                if isinstance(verdict, Recorded):
                    found.topics.setdefault(verdict.name, Account()).enter(item.record)
                    found.unvouched += not item.verified
                    yield Survivor(verdict, item.record)
                else:
                    key = verdict, line.topic if line else ''
                    found.faults[key] = found.faults.get(key, 0) + 1
            progress(before + scan.place, size)
        before += len(data)


class _Judge:
    """Tells which messages to save."""

    def __init__(self) -> None:
        self._topics: dict[str, Recorded] = {}
        self._seen: set[int] = set()

    def verdict(self, message: Message, line: Line | None) -> Recorded | Fault:
        """Return the topic of a message, or why it is left out."""
        if line is None:
            return Fault.CHANNEL
        if line.decode is None:
            return Fault.ENCODING
        if max(message.log_time, message.publish_time) >= LATEST:
            return Fault.TIME
        try:
            line.decode(message.data)
        except Exception:  # noqa: B902  as many kinds as there are fields
            return Fault.BODY
        if has_surplus(line.decode, message.data):
            return Fault.BODY
        topic = self._topics.get(line.topic)
        if topic is None:
            topic = self._topics[line.topic] = recorded(line)
        if (topic.type, topic.definition) != (line.type, line.definition.decode()):
            return Fault.TYPE
        key = hash((line.topic, message.log_time, message.publish_time, message.sequence,
                    message.data))
        if key in self._seen:
            return Fault.AGAIN
        self._seen.add(key)
        return topic
