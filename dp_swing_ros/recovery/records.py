# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The records of an MCAP file, read without trusting any of them.

Source: the MCAP specification, "Records". All numbers are little-endian; a record is an opcode,
the length of its body (8 bytes) and the body.
"""

from collections.abc import Iterator
from io import BytesIO
import struct
from typing import Any, NamedTuple
import zlib

from mcap import records
from mcap.data_stream import ReadDataStream, RecordBuilder
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC as MAGIC

from dp_swing_ros.bags.mcap_reader import Data, LARGEST, STREAMS, unpack

HEAD = struct.Struct('<BQ')  # opcode, length
CHUNK = struct.Struct('<QQQII')  # its first and last time, size, checksum; length of a text
PRIVATE = 0x80  # opcodes from here on are anybody's, to be skipped
KINDS: dict[int, Any] = {   # MESSAGE_INDEX is a MessageIndex
    opcode: getattr(records, opcode.name.title().replace('_', ''))
    for opcode in Opcode if opcode is not Opcode.CHUNK}
OF_MESSAGES = (records.Schema, records.Channel, records.Message)


class ChunkHead(NamedTuple):
    """What a chunk says of itself, and where its data is."""

    first: int     # [ns] of its messages
    last: int
    size: int      # [bytes] unpacked
    checksum: int
    compression: str
    begin: int     # of the data
    end: int


class Record(NamedTuple):
    """Where a record is, and what is in it; None where it is anybody's."""

    opcode: int
    begin: int
    end: int
    content: records.McapRecord | ChunkHead | None

    @property
    def is_odd(self) -> bool:
        """Return whether it is a chunk whose two lengths differ."""
        return isinstance(self.content, ChunkHead) and self.content.end != self.end


def record_at(data: Data, place: int, exact: bool = False) -> Record | None:
    """
    Return the record at a place, of a chunk also one that the file is too short for.

    None where no record can be; `exact` refuses what a later version of MCAP may append to it.
    """
    if place + HEAD.size > len(data):
        return None
    opcode, length = HEAD.unpack(data[place:place + HEAD.size])
    begin, end = place + HEAD.size, place + HEAD.size + length
    content: records.McapRecord | ChunkHead | None = None
    if opcode == Opcode.CHUNK:
        content = _chunk_head(data, begin)
    elif opcode in KINDS and end <= min(len(data), begin + LARGEST):
        content = _content(opcode, data[begin:end], exact)
    is_private = PRIVATE <= opcode and end <= len(data)
    return Record(opcode, place, end, content) if content or is_private else None


def _content(opcode: int, body: bytes, exact: bool) -> records.McapRecord | None:
    """Return what the library reads in a body, if that is what it would write again."""
    stream, builder = ReadDataStream(BytesIO(body)), RecordBuilder()
    size = (len(body),) if opcode == Opcode.MESSAGE else ()
    try:
        content: records.McapRecord = KINDS[opcode].read(stream, *size)
        content.write(builder)
    except (EndOfFile, OverflowError, UnicodeDecodeError, struct.error):
        return None
    # the checksum of an attachment is not looked at
    written = builder.end()[HEAD.size:-4 if opcode == Opcode.ATTACHMENT else None]
    return content if body.startswith(written) and (
        not exact or stream.count == len(body)) else None


def _chunk_head(data: Data, place: int) -> ChunkHead | None:
    # A chunk says its size twice, which makes it known among anything else.
    begin = place + CHUNK.size
    if begin + 16 > len(data):
        return None
    first, last, size, checksum, length = CHUNK.unpack(data[place:begin])
    name, begin = data[begin:begin + min(length, 8)], begin + length + 8
    compression = name.decode(errors='replace')
    if compression not in STREAMS or length != len(name) or begin > len(data):
        return None
    return ChunkHead(first, last, size, checksum, compression, begin,
                     begin + int.from_bytes(data[begin - 8:begin], 'little'))


def walk(content: bytes) -> Iterator[Record]:
    """Yield the records of an unpacked chunk up to the first that cannot be in one."""
    place = 0
    while (record := record_at(content, place)) is not None:
        if record.content is not None and not isinstance(record.content, OF_MESSAGES):
            break
        yield record
        place = record.end


def index_fits(data: Data) -> bool:
    """Return whether a program that reads a whole file by its indexes finds its messages."""
    place = summary = len(MAGIC)   # where the summary begins
    chunks = set[tuple[int, int]]()
    messages = list[tuple[int, int, int]]()  # of the last chunk: time, place, channel
    while (record := record_at(data, place)) is not None:
        content, place = record.content, record.end
        if isinstance(content, ChunkHead):
            chunks.add((record.begin, record.end - record.begin))
            inside = unpack(data[content.begin:content.end], content.compression, content.size, 0)
            messages = [(each.content.log_time, each.begin, each.content.channel_id)
                        for each in walk(inside.content)
                        if isinstance(each.content, records.Message)]
            times = [time for time, _, _ in messages]
            if times and (content.first, content.last) != (min(times), max(times)):
                return False
        elif isinstance(content, records.MessageIndex):
            if sorted(content.records) != sorted(
                    (time, begin) for time, begin, channel in messages
                    if channel == content.channel_id):
                return False
        elif isinstance(content, records.ChunkIndex):
            if (content.chunk_start_offset, content.chunk_length) not in chunks:
                return False
        elif isinstance(content, records.DataEnd):
            summary = record.end
        elif isinstance(content, records.Footer):
            checksum = zlib.crc32(data[summary:len(data) - len(MAGIC) - 4])
            if content.summary_start not in (0, summary) \
                    or content.summary_crc not in (0, checksum):
                return False
    return True
