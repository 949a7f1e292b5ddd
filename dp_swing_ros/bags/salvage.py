# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Goes through an MCAP file whatever happened to it: what is whole, and what is damaged where.

Where no record can be, it goes on at the next place where one plausibly is, and a record after
it: a chunk is known by telling its size twice, and proved by its checksum.
"""

import mmap
import os
from pathlib import Path
import re
import stat
from typing import Iterator, NamedTuple

from mcap.opcode import Opcode
from mcap.records import Channel, Message, Schema

from dp_swing_ros.bags.chunks import unpack, Unpacked
from dp_swing_ros.bags.damage import Agreement, Damage, Reason, vouched_summary
from dp_swing_ros.bags.records import (
    Buffer, HEAD, LAYOUTS, MAGIC, Record, record_at, to_object, walk)
from dp_swing_ros.errors import BagError

CANDIDATE = re.compile(rb'(?=[\x01-\x0f].{4}\0{4}|\x89MCAP0\r\n)', re.DOTALL)
PATIENCE = 64  # times the size of the file is looked at in vain; a forged file ends there
COST = 64      # [bytes] to look for a record in vain costs as much as to read so many


class Found(NamedTuple):
    """
    A schema, channel or message, and whether a checksum vouches for it.

    Without one, as outside of chunks, its numbers may be wrong and nobody can tell.
    """

    record: Schema | Channel | Message
    verified: bool


def contents(file: Path) -> Buffer:
    """
    Return the bytes of a file, which stay on the disk until they are looked at.

    Raises BagError.
    """
    try:
        with open(file, 'rb', opener=_without_waiting) as stream:
            about = os.fstat(stream.fileno())
            if not stat.S_ISREG(about.st_mode):
                raise BagError(f'cannot read {str(file)!r}: it is not a regular file')
            size = about.st_size
            return mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) if size else b''
    except OSError as error:
        raise BagError(f'cannot read {str(file)!r}: {error.strerror}') from None


def _without_waiting(path: str, flags: int) -> int:
    # a named pipe would wait for its writer
    return os.open(path, flags | os.O_NONBLOCK)


class Scan:
    """The contents of a file in their order; ask for it once."""

    def __init__(self, data: Buffer) -> None:
        self._data, self._size = data, len(data)
        self._patience = PATIENCE * self._size
        self._agreement, self._vouched = Agreement(data), vouched_summary(data)
        self._last: int | None = None  # opcode
        self._ended = False
        self._damage: Damage | None = None  # the last one
        self.place = 0  # up to here it was looked at
        self.told: int | None = None  # messages, as the file itself counts them

    def __iter__(self) -> Iterator[Found | Damage]:
        while self.place < self._size:
            for item in self._step(self.place):
                if isinstance(item, int):
                    self.place = item
                    continue
                if isinstance(item, Damage):
                    self._damage = item
                elif isinstance(item.record, Message):
                    self._agreement.count()
                yield item
        if not self._ended and (self._damage is None or self._damage.reason is not Reason.CUT):
            yield Damage(self._size, self._size, Reason.NO_END)

    def _step(self, place: int) -> Iterator[Found | Damage | int]:
        """Tell what is here, and last where to go on."""
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
        yield from (self._of_chunk if record.opcode == Opcode.CHUNK else self._of_record)(record)
        self._last = record.opcode

    def _of_record(self, record: Record) -> Iterator[Found | Damage | int]:
        if not self._follows(record.end):
            # either it or what follows is damaged; inside of what is whole nothing is found
            limit = self._next(record.begin + 1)
            if limit < record.end:
                yield Damage(record.begin, limit, Reason.NO_RECORD)
                yield limit
                return
        known = to_object(self._data, record)
        if known is not None:
            yield Found(known, record.begin >= self._vouched)
        elif record.opcode == Opcode.STATISTICS:
            self.told = record.fields[0]
        reason = self._agreement.objection(record) if self._damage is None else None
        if reason is not None:
            yield Damage(record.begin, record.end, reason)
        yield record.end

    def _of_chunk(self, record: Record) -> Iterator[Found | Damage | int]:
        fits = _is_chunk(record) and record.end <= self._size
        limit, reason = record.end, None
        content = self._unpacked(record, limit) if fits else Unpacked(b'', False, False)
        if not content.verified:
            if not fits or not self._follows(limit):
                limit = self._next(self._inside(record))
                if fits and limit >= record.end:
                    limit = record.end
                else:
                    content = self._unpacked(record, limit)
            reason = Reason.CUT if limit == self._size and not fits else \
                Reason.CHECKSUM if content.complete else Reason.PACKED
        # Of a chunk that was cut short the beginning is good. Of one with other bytes it is not:
        # unpacking goes on past them, and may fail much later or never.
        short = not fits or limit < record.end
        inner = walk(content.content if content.verified or short and not content.complete
                     else b'')
        yield from (Found(item, content.verified and record.fields[3] != 0)
                    for _, item in inner.found)
        if content.verified:
            objection = self._agreement.enter(record, limit, inner)
            if reason is None:
                reason = Reason.NO_RECORD if inner.end < len(content.content) else objection
        if reason is not None:
            yield Damage(record.begin, limit, reason)
        yield limit

    def _unpacked(self, record: Record, limit: int) -> Unpacked:
        _, _, size, checksum, compression, begin, end = record.fields
        self._patience -= limit - begin
        return unpack(self._data[begin:min(end, limit)], compression, size, checksum)

    def _inside(self, record: Record) -> int:
        # What lies unpacked in a chunk looks like records of the file, as far as it is whole.
        begin, end = record.fields[-2:]
        if record.fields[4] or end - begin > self._patience:
            return record.begin + 1
        self._patience -= end - begin
        return begin + walk(self._data[begin:end]).end

    def _follows(self, place: int) -> bool:
        """Tell whether the file ends here, or goes on with a record."""
        if place == self._size or self._data[place:place + len(MAGIC)] == MAGIC:
            return True
        record = record_at(self._data, place)
        return record is not None and (record.opcode != Opcode.CHUNK or _is_chunk(record))

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
            if record is not None and (
                    _is_chunk(record) if record.opcode == Opcode.CHUNK
                    else self._follows(record.end)):
                return begin
        return self._size

    def _why(self, begin: int, end: int) -> Reason:
        # A killed process leaves half a record, a power cut zeros.
        rest = self._data[begin:end] if end == self._size else b''
        if rest and (MAGIC.startswith(rest) or not rest.strip(b'\0') or rest[0] in LAYOUTS and (
                len(rest) < HEAD.size or HEAD.unpack_from(rest)[1] > len(rest) - HEAD.size)):
            return Reason.CUT
        return Reason.NO_RECORD


def _is_chunk(record: Record) -> bool:
    return record.end == record.fields[-1]
