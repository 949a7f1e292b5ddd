# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whether the indexes of an otherwise whole file fit what they point to."""

import zlib

from mcap.records import Chunk, ChunkIndex, DataEnd, Footer, Message, MessageIndex
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC as MAGIC

from dp_swing_ros.bags.mcap_reader import Buffer, stream_of, unpack
from dp_swing_ros.recovery.records import CHUNK, HEAD, walk


def index_fits(data: Buffer) -> bool:
    """Return whether a program that reads a whole file by its indexes finds its messages."""
    stream, summary = stream_of(data), 0   # where the summary begins
    chunks, messages = set[tuple[int, int]](), list[tuple[int, Message]]()  # of the last chunk
    for record in StreamReader(stream, emit_chunks=True).records:
        if isinstance(record, Chunk):
            length = HEAD.size + CHUNK.size + len(record.compression) + 8 + len(record.data)
            chunks.add((stream.tell() - length, length))
            content = unpack(record.data, record.compression, record.uncompressed_size, 0).content
            messages = [(each.begin, each.content) for each in walk(content)
                        if isinstance(each.content, Message)]
            times = [message.log_time for _, message in messages]
            if times and (record.message_start_time, record.message_end_time) != (
                    min(times), max(times)):
                return False
        elif isinstance(record, MessageIndex):
            if sorted(record.records) != sorted(
                    (message.log_time, place) for place, message in messages
                    if message.channel_id == record.channel_id):
                return False
        elif isinstance(record, ChunkIndex) and (
                record.chunk_start_offset, record.chunk_length) not in chunks:
            return False
        elif isinstance(record, DataEnd):
            summary = stream.tell()
        elif isinstance(record, Footer):
            checksum = zlib.crc32(data[summary:len(data) - len(MAGIC) - 4])
            if record.summary_start not in (0, summary) \
                    or record.summary_crc not in (0, checksum):
                return False
    return True
