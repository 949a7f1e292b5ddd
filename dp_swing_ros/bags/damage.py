# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What can be wrong with an MCAP file, and what its own counts, indexes and checksums find."""

import enum
from typing import NamedTuple
import zlib

from mcap.opcode import Opcode
from mcap.records import Message

from dp_swing_ros.bags.records import Buffer, HEAD, MAGIC, Record, record_at, Walk

FOOTER = 29  # [bytes]


class Reason(enum.Enum):
    """What is wrong with a part of a file."""

    CUT = 'the file ends within it'
    NO_END = 'the file has no end'
    CHECKSUM = 'its checksum or size is wrong'
    PACKED = 'it cannot be unpacked to its end'
    NO_RECORD = 'nothing of MCAP'
    SECOND_FILE = 'another file begins here'
    COUNT = 'the file tells of another number of messages than it holds'
    INDEX = 'an index does not fit what it points to'  # costs readers that jump, but no message


class Damage(NamedTuple):
    """Bytes of a file that are not as they should be."""

    begin: int
    end: int
    reason: Reason


class Agreement:
    """Whether the records of a file that are whole also fit each other."""

    def __init__(self, data: Buffer) -> None:
        self._data = data
        self._messages = 0
        self._chunk = Walk([], 0)  # the last one
        self._chunks: set[tuple[int, int]] = set()  # where they begin and end
        self._checksum, self._summed = 0, 0  # of the file up to here

    def count(self) -> None:
        """Count a message."""
        self._messages += 1

    def enter(self, record: Record, end: int, chunk: Walk) -> Reason | None:
        """Remember a chunk; tell whether it says wrongly from when to when its messages are."""
        self._chunk = chunk
        self._chunks.add((record.begin, end))
        times = [item.log_time for _, item in chunk.found if isinstance(item, Message)]
        right = not times or record.fields[:2] == [min(times), max(times)]
        return None if right else Reason.INDEX

    def objection(self, record: Record) -> Reason | None:
        """Tell what a record says that is not so."""
        kind, fields = record.opcode, record.fields
        if kind == Opcode.STATISTICS and fields[0] != self._messages:
            return Reason.COUNT
        if kind == Opcode.DATA_END and fields[0] not in (0, self._checksum_to(record.begin)):
            return Reason.CHECKSUM
        if kind == Opcode.FOOTER and record.end + len(MAGIC) == len(self._data) \
                and 0 not in (fields[0], fields[2]) and vouched_summary(self._data) != fields[0]:
            return Reason.INDEX
        if kind == Opcode.CHUNK_INDEX and (fields[2], sum(fields[2:4])) not in self._chunks:
            return Reason.INDEX
        if kind == Opcode.MESSAGE_INDEX and not self._points_to_messages(*fields):
            return Reason.INDEX
        return None

    def _points_to_messages(self, channel: int, place: tuple[int, int]) -> bool:
        index = self._data[slice(*place)]
        numbers = [int.from_bytes(index[n:n + 8], 'little') for n in range(0, len(index), 8)]
        return sorted(zip(numbers[::2], numbers[1::2])) == sorted(
            (item.log_time, place) for place, item in self._chunk.found
            if isinstance(item, Message) and item.channel_id == channel)

    def _checksum_to(self, place: int) -> int:
        self._checksum = _sum(self._data, self._summed, place, self._checksum)
        self._summed = place
        return self._checksum


def vouched_summary(data: Buffer) -> int:
    """Return where the summary of a file begins, if a checksum vouches for it; else its end."""
    end = len(data) - len(MAGIC)
    footer = record_at(data, max(0, end - FOOTER))
    if footer is None or footer.opcode != Opcode.FOOTER or footer.end != end:
        return len(data)
    # not where the footer says: it may be that of another file, whose end was appended
    place = data.rfind(HEAD.pack(Opcode.DATA_END, 4))
    begin, checksum = place + HEAD.size + 4, footer.fields[2]
    vouched = place > 0 and checksum != 0 and checksum == _sum(data, begin, end - 4)
    return begin if vouched else len(data)


def _sum(data: Buffer, begin: int, end: int, before: int = 0) -> int:
    with memoryview(data) as view, view[begin:end] as part:
        return zlib.crc32(part, before)
