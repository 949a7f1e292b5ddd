# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Goes through an MCAP file whatever happened to it: what is whole, and what is damaged where.

Where no record can be, it goes on at the next place where one plausibly is, and a record after
it: a chunk is known by saying its size twice, and proved by its checksum.
"""

import enum
import re
from typing import Iterator, NamedTuple

from mcap.opcode import Opcode
from mcap.records import Channel, Message, Schema, Statistics
from mcap.writer import MCAP0_MAGIC as MAGIC

from dp_swing_ros.bags.chunks import unpack, Unpacked
from dp_swing_ros.bags.mcap_reader import Buffer
from dp_swing_ros.recovery.records import (
    ChunkHead, HEAD, KINDS, OF_MESSAGES, Record, record_at, walk)

CANDIDATE = re.compile(rb'(?=[\x01-\x0f].{4}\0{4}|\x89MCAP0\r\n)', re.DOTALL)
PATIENCE = 64  # times the size of the file is looked at in vain; a forged file ends there
COST = 64      # [bytes] to look for a record in vain costs as much as to read so many


class Reason(enum.Enum):
    """What is wrong with a part of a file."""

    CUT = 'the file ends within it'
    NO_END = 'the file has no end'
    CHECKSUM = 'its checksum or size is wrong'
    PACKED = 'it cannot be unpacked to its end'
    NO_RECORD = 'nothing of MCAP'
    SECOND_FILE = 'another file begins here'


class Damage(NamedTuple):
    """Bytes of a file that are not as they should be."""

    begin: int
    end: int
    reason: Reason


class Found(NamedTuple):
    """
    A schema, channel or message, and whether a checksum verifies it.

    Without one, as outside of chunks, its numbers may be wrong and nobody can know.
    """

    record: Schema | Channel | Message
    verified: bool


class Scan:
    """The contents of a file in their order; ask for it once."""

    def __init__(self, data: Buffer) -> None:
        self._data, self._size = data, len(data)
        self._patience = PATIENCE * self._size
        self._last: int | None = None  # opcode
        self._ended = False
        self.place = 0  # up to here it was looked at
        self.counted: int | None = None  # messages, by the file's own count

    def __iter__(self) -> Iterator[Found | Damage]:
        damage: Damage | None = None  # the last one
        while self.place < self._size:
            for item in self._step(self.place):
                if isinstance(item, int):
                    self.place = item
                    continue
                if isinstance(item, Damage):
                    damage = item
                yield item
        if not self._ended and (damage is None or damage.reason is not Reason.CUT):
            yield Damage(self._size, self._size, Reason.NO_END)

    def _step(self, place: int) -> Iterator[Found | Damage | int]:
        """Yield what is here, and last where to go on."""
        if self._data[place:place + len(MAGIC)] == MAGIC:
            if place > 0 and self._last != Opcode.FOOTER:
                yield Damage(place, place + len(MAGIC), Reason.SECOND_FILE)
            self._ended, self._last = self._last == Opcode.FOOTER, None
            yield place + len(MAGIC)
            return
        if self._ended:
            yield Damage(place, place, Reason.SECOND_FILE)
            self._ended = False
        record = record_at(self._data, place)
        if record is None:
            limit = self._next(place + 1)
            yield Damage(place, limit, self._why(place, limit))
            yield limit
            return
        if isinstance(record.content, ChunkHead):
            yield from self._of_chunk(record, record.content)
        else:
            yield from self._of_record(record)
        self._last = record.opcode

    def _of_record(self, record: Record) -> Iterator[Found | Damage | int]:
        if not self._follows(record.end):
            # either it or what follows is damaged; inside of what is whole nothing is found
            limit = self._next(record.begin + 1)
            if limit < record.end:
                yield Damage(record.begin, limit, Reason.NO_RECORD)
                yield limit
                return
        if isinstance(record.content, OF_MESSAGES):
            yield Found(record.content, verified=False)
        elif isinstance(record.content, Statistics):
            self.counted = record.content.message_count
        yield record.end

    def _of_chunk(self, record: Record, head: ChunkHead) -> Iterator[Found | Damage | int]:
        fits = not record.is_odd and record.end <= self._size
        limit, reason = record.end, None
        content = self._unpacked(head, limit) if fits else Unpacked(b'', False, False)
        if not content.verified:
            if not fits or not self._follows(limit):
                limit = self._next(self._inside(record, head))
                if fits and limit >= record.end:
                    limit = record.end
                else:
                    content = self._unpacked(head, limit)
            reason = Reason.CUT if limit == self._size and not fits else \
                Reason.CHECKSUM if content.complete else Reason.PACKED
        # Of a chunk that was cut short the beginning is good. Of one with other bytes it is not:
        # unpacking goes on past them, and may fail much later or never.
        short = not fits or limit < record.end
        inner = walk(content.content if content.verified or short and not content.complete
                     else b'')
        yield from (Found(item, content.verified and head.checksum != 0)
                    for _, item in inner.found)
        if reason is None and inner.end < len(content.content):
            reason = Reason.NO_RECORD
        if reason is not None:
            yield Damage(record.begin, limit, reason)
        yield limit

    def _unpacked(self, head: ChunkHead, limit: int) -> Unpacked:
        self._patience -= limit - head.begin
        return unpack(self._data[head.begin:min(head.end, limit)], head.compression, head.size,
                      head.checksum)

    def _inside(self, record: Record, head: ChunkHead) -> int:
        # What lies unpacked in a chunk looks like records of the file, as far as it is whole.
        if head.compression or head.end - head.begin > self._patience:
            return record.begin + 1
        self._patience -= head.end - head.begin
        return head.begin + walk(self._data[head.begin:head.end]).end

    def _follows(self, place: int) -> bool:
        """Return whether the file ends here, or goes on with a record."""
        if place == self._size or self._data[place:place + len(MAGIC)] == MAGIC:
            return True
        record = record_at(self._data, place)
        return record is not None and not record.is_odd

    def _next(self, place: int) -> int:
        """Return the next place where a record plausibly is, or the end."""
        for match in CANDIDATE.finditer(self._data, place):
            begin = match.start()
            if self._data[begin:begin + len(MAGIC)] == MAGIC:
                return begin
            if self._patience < 0:
                break
            self._patience -= COST
            record = record_at(self._data, begin, exact=True)
            if record is None or record.is_odd:
                continue
            if record.opcode == Opcode.CHUNK or self._follows(record.end):
                return begin
            self._patience -= record.end - begin
        return self._size

    def _why(self, begin: int, end: int) -> Reason:
        # A killed process leaves half a record, a power cut zeros.
        rest = self._data[begin:end] if end == self._size else b''
        if rest and (MAGIC.startswith(rest) or not rest.strip(b'\0')
                     or rest[0] in (*KINDS, Opcode.CHUNK) and (
                         len(rest) < HEAD.size
                         or HEAD.unpack_from(rest)[1] > len(rest) - HEAD.size)):
            return Reason.CUT
        return Reason.NO_RECORD
