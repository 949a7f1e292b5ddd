# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The records of an MCAP file, read without trusting any of them.

Source: the MCAP specification, "Records". All numbers are little-endian; a record is an opcode,
the length of its body (8 bytes) and the body.
"""

import mmap
import struct
from typing import Any, NamedTuple

from mcap.opcode import Opcode
from mcap.records import Channel, Message, Schema

Buffer = mmap.mmap | bytes

MAGIC = b'\x89MCAP0\r\n'
HEAD = struct.Struct('<BQ')  # opcode, length
PRIVATE = 0x80  # opcodes from here on are anybody's, to be skipped

# Letters of `struct` are numbers; s is a text and m pairs of texts, each with their length before
# them; of bytes only the place is read: b up to 4 GiB and r more by their length, * all the rest.
LAYOUTS: dict[int, str] = {
    Opcode.HEADER: 'ss', Opcode.FOOTER: 'QQI', Opcode.SCHEMA: 'Hssb', Opcode.CHANNEL: 'HHssm',
    Opcode.MESSAGE: 'HIQQ*', Opcode.CHUNK: 'QQQIsr', Opcode.MESSAGE_INDEX: 'Hb',
    Opcode.CHUNK_INDEX: 'QQQQbQsQQ', Opcode.ATTACHMENT: 'QQssrI', Opcode.STATISTICS: 'QHIIIIQQb',
    Opcode.ATTACHMENT_INDEX: 'QQQQQss', Opcode.METADATA: 'sm', Opcode.METADATA_INDEX: 'QQs',
    Opcode.SUMMARY_OFFSET: 'BQQ', Opcode.DATA_END: 'I'}
TEXT, PAIRS = 1 << 16, 1 << 18  # [bytes] at most; what looks longer is something else
NUMBERS = {'B': 1, 'H': 2, 'I': 4, 'Q': 8}
COMPRESSIONS = ('', 'lz4', 'zstd')


class Record(NamedTuple):
    """Where a record is, and what is in it."""

    opcode: int
    begin: int
    end: int
    fields: list[Any]


class Walk(NamedTuple):
    """The records inside a chunk, up to the first that is none."""

    found: list[tuple[int, Schema | Channel | Message]]  # with their offsets
    end: int  # of the last whole one


def record_at(data: Buffer, place: int, exact: bool = False) -> Record | None:
    """
    Return the record at a place, of a chunk also one that the file is too short for.

    None where no record can be; `exact` refuses what a later version of MCAP may append to it.
    """
    if place + HEAD.size > len(data):
        return None
    opcode, length = HEAD.unpack(data[place:place + HEAD.size])
    begin, end = place + HEAD.size, place + HEAD.size + length
    if opcode == Opcode.CHUNK:
        return _chunk_at(data, place, begin, end)
    if end > len(data) or opcode not in LAYOUTS:
        return Record(opcode, place, end, []) if PRIVATE <= opcode and end <= len(data) else None
    try:
        fields, stop = read(data, begin, end, LAYOUTS[opcode])
    except ValueError:
        return None
    return None if exact and stop != end else Record(opcode, place, end, fields)


def _chunk_at(data: Buffer, place: int, begin: int, end: int) -> Record | None:
    # A chunk tells its size twice, which makes it known among anything else.
    try:
        fields, stop = read(data, begin, len(data), 'QQQIsQ')
    except ValueError:
        return None
    if fields[4] not in COMPRESSIONS:
        return None
    size = fields.pop()
    return Record(Opcode.CHUNK, place, end, [*fields, stop, stop + size])


def read(data: Buffer, place: int, end: int, layout: str) -> tuple[list[Any], int]:
    """
    Read fields from a place on; return them, and where they end.

    Raises ValueError if they go beyond `end` or a text is not UTF-8.
    """
    fields: list[Any] = []

    def place_of(size: int, limit: int) -> tuple[int, int]:
        nonlocal place
        if size > min(end - place, limit):
            raise ValueError('a field ends after its record')
        place += size
        return place - size, place

    def number(size: int) -> int:
        return int.from_bytes(data[slice(*place_of(size, size))], 'little')

    for letter in layout:
        if letter in NUMBERS:
            fields.append(number(NUMBERS[letter]))
        elif letter == 's':
            fields.append(data[slice(*place_of(number(4), TEXT))].decode())
        elif letter == 'm':
            fields.append(_pairs(data, *place_of(number(4), PAIRS)))
        else:
            size = end - place if letter == '*' else number(4 if letter == 'b' else 8)
            fields.append(place_of(size, end))
    return fields, place


def _pairs(data: Buffer, place: int, end: int) -> dict[str, str]:
    pairs = {}
    while place < end:
        (key, value), place = read(data, place, end, 'ss')
        pairs[key] = value
    return pairs


def to_object(data: Buffer, record: Record) -> Schema | Channel | Message | None:
    """Return a record that says something of messages as an object; None for any other."""
    if record.opcode == Opcode.SCHEMA:
        number, name, encoding, place = record.fields
        return Schema(id=number, name=name, encoding=encoding, data=data[slice(*place)])
    if record.opcode == Opcode.CHANNEL:
        number, schema, topic, encoding, metadata = record.fields
        return Channel(id=number, schema_id=schema, topic=topic, message_encoding=encoding,
                       metadata=metadata)
    if record.opcode == Opcode.MESSAGE:
        channel, sequence, received, sent, place = record.fields
        return Message(channel_id=channel, sequence=sequence, log_time=received,
                       publish_time=sent, data=data[slice(*place)])
    return None


def walk(content: bytes) -> Walk:
    """Return the schemas, channels and messages of an unpacked chunk, as far as they go."""
    found: list[tuple[int, Schema | Channel | Message]] = []
    place = 0
    while (record := record_at(content, place)) is not None:
        if record.opcode < PRIVATE:
            item = to_object(content, record)
            if item is None:
                break
            found.append((place, item))
        place = record.end
    return Walk(found, place)
