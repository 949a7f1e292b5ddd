# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""MCAP files of numbered messages, as bytes."""

import io
import struct

from mcap.writer import CompressionType, Writer

COUNT, CHUNK = 200, 1000  # messages, and bytes of a chunk
KINDS = [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD]


def body(n):
    return struct.pack('<d', n) * 4


def make(compression=CompressionType.ZSTD, chunks=True, chunk_size=CHUNK, statistics=True):
    """Return a file with COUNT numbered messages."""
    out = io.BytesIO()
    writer = Writer(out, chunk_size=chunk_size, compression=compression, use_chunking=chunks,
                    use_statistics=statistics)
    writer.start(profile='ros2', library='test')
    schema = writer.register_schema('std_msgs/msg/Float64', 'ros2msg', b'float64 data')
    channel = writer.register_channel('/a', 'cdr', schema, {'key': 'value'})
    for n in range(COUNT):
        writer.add_message(channel, n, body(n), n, n)
    writer.finish()
    return out.getvalue()


def chunk(data, size, compression=b'zstd', checksum=0, length=None):
    rest = struct.pack('<QQQII', 0, 0, size, checksum, len(compression)) + compression
    rest += struct.pack('<Q', len(data)) + data
    return struct.pack('<BQ', 6, len(rest) if length is None else length) + rest
