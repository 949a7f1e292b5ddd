# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Goes through an MCAP file whatever happened to it: what is whole, and what is damaged where.

Where no record can be, it goes on at the next chunk, or the next record that another follows.
Source: the MCAP specification, "Records". All numbers are little-endian; a record is an opcode,
the length of its body (8 bytes) and the body.
"""

from collections.abc import Generator, Iterator
from contextlib import suppress
import enum
from io import BytesIO
import re
import struct
from typing import Any, NamedTuple
import zlib

from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Channel, DataEnd, McapRecord, Message, Schema
from mcap.writer import MCAP0_MAGIC as MAGIC

from dp_swing_ros.bags.mcap_reader import (
    Data, Entry, LARGEST, Mapped, Messages, STREAMS, unpack, Wanted)

HEAD = struct.Struct('<BQ')  # opcode, length
CHUNK = struct.Struct('<QQQII')  # its first and last time, size, checksum; length of a text
PRIVATE = 0x80  # opcodes from here on are anybody's, to be skipped
KINDS: dict[int, Any] = {   # MESSAGE_INDEX is a MessageIndex
    opcode: getattr(records, opcode.name.title().replace('_', '')) for opcode in Opcode}
NEXT_RECORD = re.compile(rb'[\x01-\x0f].{4}\0{4}|\x89MCAP0\r\n', re.DOTALL)
NEXT_OF_CHUNKS = re.compile(rb'[\x06-\x0f].{4}\0{4}|\x89MCAP0\r\n', re.DOTALL)
DATA_END = HEAD.pack(Opcode.DATA_END, 4)   # the summary begins after it and its checksum
OF_MESSAGES = (Schema, Channel, Message)
ZEROS = bytes(1 << 20)  # a power cut leaves GiB of them, or a file that is mostly holes


class Reason(enum.Enum):
    """What is wrong with a part of a file."""

    CUT = 'the file ends within it'
    NO_END = 'the file has no end'
    CHECKSUM = 'its checksum or size is wrong'
    NO_RECORD = 'nothing of MCAP'
    TWICE = 'the same chunk is there before'


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
    A whole record, and whether a checksum verifies it.

    Without one, as outside of chunks, its numbers may be wrong and nobody can know.
    """

    record: McapRecord
    verified: bool


class Chunk(NamedTuple):
    """What a chunk says of itself, and where its data begins."""

    compression: str
    size: int      # [bytes] unpacked
    checksum: int
    begin: int


class Record(NamedTuple):
    """Where a record ends, and what is in it; None where it is anybody's, or MAGIC."""

    end: int
    content: McapRecord | Chunk | None


Ended = Generator[Found, None, tuple[int, Reason | None]]   # where it ends, and what is wrong


def scan(data: Data) -> Iterator[Found | Damage]:
    """Yield the contents of a file in their order."""
    begin, chunked, reason, chunks = 0, False, None, set[int]()
    while begin < len(data):
        record = record_at(data, begin)
        if record and isinstance(record.content, Chunk):
            chunked = True
            end, reason = yield from _of_chunk(data, begin, record.end, record.content, chunks)
        else:
            chunked = chunked and not (record and isinstance(record.content, DataEnd))
            end, reason = yield from _of_other(data, begin, record, chunked)
        if reason:
            yield Damage(begin, end, reason)
        begin = end
    if reason is not Reason.CUT and data[max(len(data) - len(MAGIC), len(MAGIC)):] != MAGIC:
        yield Damage(begin, begin, Reason.NO_END)


def _of_chunk(data: Data, begin: int, end: int, chunk: Chunk, before: set[int]) -> Ended:
    """Yield what is in a chunk if it is whole, or the beginning of one that the file ends in."""
    verified = False
    if not (is_cut := end > len(data)):
        content = unpack(data[chunk.begin:end], *chunk[:3])
        if not (verified := content.verified):
            if not _follows(data, end):
                end = _next(data, begin + 1, chunked=True)
            return end, Reason.CHECKSUM
        if content.content and hash(content.content) in before:
            return end, Reason.TWICE
        before.add(hash(content.content))
    elif (end := _next(data, begin + 1, chunked=True)) < len(data):
        return end, Reason.CHECKSUM
    else:
        content = unpack(data[chunk.begin:], *chunk[:3])
    place = 0
    while (record := record_at(content.content, place)) and (
            record.content is None or isinstance(record.content, OF_MESSAGES)):
        if record.content:
            yield Found(record.content, verified and chunk.checksum != 0)
        place = record.end
    return end, Reason.CUT if is_cut else Reason.NO_RECORD if place < chunk.size else None


def _of_other(data: Data, begin: int, record: Record | None, chunked: bool) -> Ended:
    """Yield what is in a record outside of chunks, unless it is damaged."""
    if record is None:
        end = _next(data, begin + 1, chunked)
        return end, Reason.CUT if end == len(data) and _is_cut(data, begin) else Reason.NO_RECORD
    if not _follows(data, record.end):
        # it or what follows is damaged; inside of what is whole nothing is found
        end = _next(data, begin + 1, chunked, record.end)
        if end < record.end:
            return end, Reason.NO_RECORD
    if isinstance(record.content, McapRecord):
        yield Found(record.content, verified=False)
    return record.end, None


def record_at(data: Data, begin: int) -> Record | None:
    """Return the record at a place, of a chunk also one that the file is too short for."""
    if data[begin:begin + len(MAGIC)] == MAGIC:
        return Record(begin + len(MAGIC), None)
    opcode, length = _head(data, begin)
    begin, end = begin + HEAD.size, begin + HEAD.size + length
    if opcode == Opcode.CHUNK:
        chunk = _chunk(data, begin, end)
        return chunk and Record(end, chunk)
    if opcode >= PRIVATE and end <= len(data):
        return Record(end, None)
    if opcode not in KINDS or end > min(len(data), begin + LARGEST):
        return None
    stream = ReadDataStream(BytesIO(data[begin:end]))
    with suppress(EndOfFile, OverflowError, UnicodeDecodeError, struct.error):
        return Record(end, KINDS[opcode].read(
            stream, *([length] if opcode == Opcode.MESSAGE else [])))
    return None


def _head(data: Data, begin: int) -> tuple[int, int]:
    """Return opcode and length of the record at a place; no opcode is 0."""
    head = data[begin:begin + HEAD.size]
    return HEAD.unpack(head) if len(head) == HEAD.size else (0, 0)


def _chunk(data: Data, begin: int, end: int) -> Chunk | None:
    """Return what a chunk says of itself, if its two sizes agree, which makes it known."""
    text = begin + CHUNK.size
    if text > len(data):
        return None
    _, _, size, checksum, length = CHUNK.unpack(data[begin:text])
    compression, begin = data[text:text + min(length, 8)], text + length + 8
    if begin > len(data) or end - begin != int.from_bytes(data[begin - 8:begin], 'little') \
            or end - begin > LARGEST or compression.decode(errors='replace') not in STREAMS:
        return None
    return Chunk(compression.decode(), size, checksum, begin)


def _follows(data: Data, place: int) -> bool:
    """Return whether the file ends here, or goes on with what looks like a record."""
    if place == len(data) or data[place:place + len(MAGIC)] == MAGIC:
        return True
    opcode, length = _head(data, place)
    if opcode == Opcode.CHUNK:
        return record_at(data, place) is not None
    return (opcode in KINDS or opcode >= PRIVATE) and place + HEAD.size + length <= len(data)


def _next(data: Data, place: int, chunked: bool, limit: int | None = None) -> int:
    """Return the next place where a record plausibly is, or the limit, by default the end."""
    limit = len(data) if limit is None else limit
    # among chunks what looks like a message, or declares one, may be of a damaged chunk
    pattern = NEXT_OF_CHUNKS if chunked else NEXT_RECORD
    place = _after_zeros(data, place)
    # not finditer, which would hold on to the map of a file
    while match := pattern.search(data, place, limit):
        place = match.start()
        if _follows(data, place):
            opcode, length = _head(data, place)
            if data[place] == MAGIC[0] or opcode == Opcode.CHUNK or (
                    _follows(data, place + HEAD.size + length) and record_at(data, place)):
                return place
        place += 1
    return limit


def _after_zeros(data: Data, place: int) -> int:
    """Return a place after which there is something else than zeros soon, or the end."""
    while place < len(data):
        place = data.after_hole(place) if isinstance(data, Mapped) else place
        block = data[place:place + len(ZEROS)]
        if block != ZEROS[:len(block)]:
            break
        place += len(block)
    return place


def _is_cut(data: Data, begin: int) -> bool:
    """Return whether the rest is half a record, as of a killed process, or zeros."""
    opcode, length = _head(data, begin)
    return MAGIC.startswith(data[begin:begin + len(MAGIC)]) \
        or _after_zeros(data, begin) == len(data) \
        or data[begin] in KINDS and (opcode == 0 or begin + HEAD.size + length > len(data))


def summary_is_verified(data: Data) -> bool:
    """Return whether the checksum in the footer, where there is one, fits the summary."""
    end = len(data) - len(MAGIC) - 4
    begin = data.rfind(DATA_END, max(end - LARGEST, 0)) + len(DATA_END) + 4
    checksum = int.from_bytes(data[max(end, 0):end + 4], 'little')
    return checksum != 0 and zlib.crc32(data[begin:end]) == checksum


def beginning_of(data: Data, wanted: Wanted) -> tuple[list[Entry], Damage | None]:
    """
    Return the messages of a file up to the first damage: all that a killed logger left.

    Without damage all can be read, or nothing says whose a message is.
    """
    messages = Messages(wanted)
    with suppress(ValueError):   # of a channel: the reader has said so already
        for item in scan(data):
            if isinstance(item, Damage):
                return messages.entries, item
            messages.add(item.record)
    return messages.entries, None
