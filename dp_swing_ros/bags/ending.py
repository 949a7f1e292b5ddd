# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Gives an MCAP file an end where its writer could not go on. Source: the MCAP specification."""

from collections.abc import Sequence
import errno
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mcap.data_stream import RecordBuilder
from mcap.records import (
    Channel, Chunk, ChunkIndex, DataEnd, Footer, McapRecord, MessageIndex, Schema, Statistics)
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC


class Kept(NamedTuple):
    """A chunk of the file with the indexes of its messages."""

    chunk: ChunkIndex
    counts: dict[int, int]  # messages per channel


def end_after(path: Path, size: int, schemas: Sequence[Schema],
              channels: Sequence[Channel]) -> list[Kept]:
    """
    End a file after a size, where a whole record ends, and return what it holds then.

    Where the summary does not fit, the end has none; where not even that fits, it takes the place
    of the last chunk. Raises OSError if that fails, too; the chunks before are left as they are.
    """
    with path.open('rb') as stream:
        kept = _kept(stream, size)
    if _ended(path, size, _whole_end(size, schemas, channels, kept)) \
            or _ended(path, size, _bare_end()):
        return kept
    if kept and _ended(path, kept[-1].chunk.chunk_start_offset, _bare_end()):
        return kept[:-1]
    raise OSError(errno.ENOSPC, 'no room for an end')


def _kept(stream: BinaryIO, size: int) -> list[Kept]:
    kept: list[Kept] = []
    records = StreamReader(stream, emit_chunks=True).records
    while (start := stream.tell()) < size:
        record = next(records)
        length = stream.tell() - start
        if isinstance(record, Chunk):
            kept.append(Kept(_index(record, start, length), {}))
        elif isinstance(record, MessageIndex):  # of the chunk before
            kept[-1].chunk.message_index_offsets[record.channel_id] = start
            kept[-1].chunk.message_index_length += length
            kept[-1].counts[record.channel_id] = len(record.records)
    return kept


def _index(chunk: Chunk, start: int, length: int) -> ChunkIndex:
    return ChunkIndex(
        chunk_length=length, chunk_start_offset=start, compression=chunk.compression,
        compressed_size=len(chunk.data), message_end_time=chunk.message_end_time,
        message_index_length=0, message_index_offsets={},
        message_start_time=chunk.message_start_time, uncompressed_size=chunk.uncompressed_size)


def _ended(path: Path, position: int, end: bytes) -> bool:
    # It is cut last: the blocks behind may be all that a full disk has for the end.
    try:
        with path.open('r+b', buffering=0) as file:
            file.seek(position)
            while end:
                end = end[file.write(end):]
            file.truncate()
    except OSError:
        return False
    return True


def _whole_end(size: int, schemas: Sequence[Schema], channels: Sequence[Channel],
               kept: Sequence[Kept]) -> bytes:
    counts = {channel.id: sum(each.counts.get(channel.id, 0) for each in kept)
              for channel in channels}
    statistics = Statistics(
        attachment_count=0, channel_count=len(channels), channel_message_counts=counts,
        chunk_count=len(kept), message_count=sum(counts.values()),
        message_end_time=max((each.chunk.message_end_time for each in kept), default=0),
        message_start_time=min((each.chunk.message_start_time for each in kept), default=0),
        metadata_count=0, schema_count=len(schemas))
    before = _written(DataEnd(data_section_crc=0))
    summary = _written(*schemas, *channels, statistics, *(each.chunk for each in kept))
    return before + summary + _written(_footer(size + len(before))) + MCAP0_MAGIC


def _bare_end() -> bytes:
    return _written(DataEnd(data_section_crc=0), _footer(0)) + MCAP0_MAGIC


def _footer(summary: int) -> Footer:
    # neither offsets within the summary nor its checksum, which are optional
    return Footer(summary_start=summary, summary_offset_start=0, summary_crc=0)


def _written(*records: McapRecord) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return builder.end()
