# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Goes through an MCAP file whatever happened to it: what is whole, and what is damaged where.

Where no record can be, it goes on at the next place where one plausibly is, and a record after
it: a chunk is known by saying its size twice, and proved by its checksum.
"""

from contextlib import suppress
import enum
import re
from typing import Iterator, NamedTuple

from mcap.opcode import Opcode
from mcap.records import Channel, Message, Schema, Statistics
from mcap.writer import MCAP0_MAGIC as MAGIC

from dp_swing_ros.bags.mcap_reader import (
    Data, Entry, LARGEST, Mapped, Messages, unpack, Unpacked, Wanted)
from dp_swing_ros.recovery.records import (
    ChunkHead, HEAD, KINDS, OF_MESSAGES, Record, record_at, walk)

CANDIDATE = re.compile(rb'(?=[\x01-\x0f].{4}\0{4}|\x89MCAP0\r\n)', re.DOTALL)
PATIENCE = 64  # times the size of the file is looked at in vain; a forged file ends there
ZEROS = bytes(1 << 20)  # a power cut leaves GiB of them, or a file that is mostly holes
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

    @property
    def is_cut(self) -> bool:
        """Return whether it is only that the file ends too early."""
        return self.reason in (Reason.CUT, Reason.NO_END)


class Found(NamedTuple):
    """
    A schema, channel or message, and whether a checksum verifies it.

    Without one, as outside of chunks, its numbers may be wrong and nobody can know.
    """

    record: Schema | Channel | Message
    verified: bool


class Scan:
    """The contents of a file in their order; ask for it once."""

    def __init__(self, data: Data) -> None:
        self._data, self._size = data, len(data)
        self._patience = PATIENCE * self._size
        self._last: int | None = None  # opcode
        self._ended = self._cut = False
        self.place = 0  # up to here it was looked at
        self.counted: int | None = None  # messages, by the file's own count

    def __iter__(self) -> Iterator[Found | Damage]:
        while self.place < self._size:
            yield from self._step()
        if not self._ended and not self._cut:
            yield self._damage(self._size, Reason.NO_END)

    def _step(self) -> Iterator[Found | Damage]:
        """Yield what is here, and go on to where the next can be."""
        if self._begins(self.place):
            end, follows = self.place + len(MAGIC), self._last == Opcode.FOOTER
            if self.place > 0 and not follows:
                yield self._damage(end, Reason.SECOND_FILE)
            self._ended, self._last, self.place = follows, None, end
            return
        if self._ended:
            yield self._damage(self.place, Reason.SECOND_FILE)
            self._ended = False
        record = record_at(self._data, self.place)
        if record is None:
            limit = self._next(self.place + 1)
            yield self._damage(limit, self._why(limit))
            return
        self._last = record.opcode
        if isinstance(record.content, ChunkHead):
            yield from self._of_chunk(record, record.content)
        else:
            yield from self._of_record(record)

    def _damage(self, end: int, reason: Reason) -> Damage:
        """Return the damage that begins here, and go on after it."""
        damage = Damage(self.place, end, reason)
        self.place, self._cut = end, reason is Reason.CUT
        return damage

    def _of_record(self, record: Record) -> Iterator[Found | Damage]:
        if not self._follows(record.end):
            # either it or what follows is damaged; inside of what is whole nothing is found
            limit = self._next(record.begin + 1)
            if limit < record.end:
                yield self._damage(limit, Reason.NO_RECORD)
                return
        self.place = record.end
        if isinstance(record.content, OF_MESSAGES):
            yield Found(record.content, verified=False)
        elif isinstance(record.content, Statistics):
            self.counted = record.content.message_count

    def _of_chunk(self, record: Record, head: ChunkHead) -> Iterator[Found | Damage]:
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
        usable = content.verified or short and not content.complete
        verified, end = content.verified and head.checksum != 0, 0
        for each in walk(content.content if usable else b''):
            end = each.end
            if isinstance(each.content, OF_MESSAGES):
                yield Found(each.content, verified)
        if reason is None and end < len(content.content):
            reason = Reason.NO_RECORD
        if reason is not None:
            yield self._damage(limit, reason)
        self.place = limit

    def _unpacked(self, head: ChunkHead, limit: int) -> Unpacked:
        self._patience -= limit - head.begin
        if min(head.end, limit) - head.begin > LARGEST:
            return Unpacked(b'', False, False)
        return unpack(self._data[head.begin:min(head.end, limit)], head.compression, head.size,
                      head.checksum)

    def _inside(self, record: Record, head: ChunkHead) -> int:
        # What lies unpacked in a chunk looks like records of the file, as far as it is whole.
        if head.compression or head.end - head.begin > min(self._patience, LARGEST):
            return record.begin + 1
        self._patience -= head.end - head.begin
        return head.begin + max((each.end for each in walk(self._data[head.begin:head.end])),
                                default=0)

    def _begins(self, place: int) -> bool:
        """Return whether a file begins or ends here."""
        return self._data[place:place + len(MAGIC)] == MAGIC

    def _follows(self, place: int) -> bool:
        """Return whether the file ends here, or goes on with a record."""
        if place == self._size or self._begins(place):
            return True
        record = record_at(self._data, place)
        return record is not None and not record.is_odd

    def _next(self, place: int) -> int:
        """Return the next place where a record plausibly is, or the end."""
        place = self._after_zeros(place)
        # not finditer, which would hold on to the map of a file
        while (match := CANDIDATE.search(self._data, place)) is not None:
            begin = match.start()
            if self._begins(begin):
                return begin
            if self._patience < 0:
                break
            self._patience -= COST
            place, record = begin + 1, record_at(self._data, begin, exact=True)
            if record is None or record.is_odd:
                continue
            if record.opcode == Opcode.CHUNK or self._follows(record.end):
                return begin
            self._patience -= record.end - begin
        return self._size

    def _after_zeros(self, place: int) -> int:
        """Return a place after which there is something else than zeros soon, or the end."""
        while place < self._size:
            place = self._data.after_hole(place) if isinstance(self._data, Mapped) else place
            block = self._data[place:place + len(ZEROS)]
            if block != ZEROS[:len(block)]:
                break
            place += len(block)
        return place

    def _why(self, end: int) -> Reason:
        # A killed process leaves half a record, a power cut zeros.
        if end < self._size or end == self.place:
            return Reason.NO_RECORD
        left, head = end - self.place, self._data[self.place:self.place + HEAD.size]
        if MAGIC.startswith(head) or self._after_zeros(self.place) == end \
                or head[0] in (*KINDS, Opcode.CHUNK) and (
                    left < HEAD.size or HEAD.unpack(head)[1] > left - HEAD.size):
            return Reason.CUT
        return Reason.NO_RECORD


def beginning_of(data: Data, wanted: Wanted) -> tuple[list[Entry], Damage | None]:
    """
    Return the messages of a file up to the first damage: all that a killed logger left.

    Without damage all can be read, or nothing says whose a message is.
    """
    messages = Messages(wanted)
    with suppress(ValueError):   # of a channel: the reader has said so already
        for item in Scan(data):
            if isinstance(item, Damage):
                return messages.entries, item
            messages.add(item.record)
    return messages.entries, None
