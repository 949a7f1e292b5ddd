# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Ways to forge a bag: what it holds is wrong, and its checksums fit."""

from collections.abc import Callable
import io
import struct
import zlib

from mcap.opcode import Opcode
from mcap.records import Channel, Message, Schema
from mcap.stream_reader import breakup_chunk, StreamReader
from mcap.writer import CompressionType, Writer
import numpy as np
import zstandard


def wrong_definition(content: bytearray, rng: np.random.Generator) -> bytes:
    """Damage the definition, name or encoding of a type."""
    def change(items: list) -> list:
        schema = _one(items, Schema, rng)
        what = rng.integers(4)
        if what == 0:
            text = bytearray(schema.data)
            for place in rng.integers(len(text), size=5):
                text[place] = int(rng.integers(256))
            schema.data = bytes(text)
        elif what == 1:
            schema.data = b''
        elif what == 2:
            schema.name = 'no/msg/Type'
        else:
            schema.encoding = 'ros2idl'
        return items
    return rewritten(bytes(content), change)


def other_type(content: bytearray, rng: np.random.Generator) -> bytes:
    """Give a topic another topic's type."""
    def change(items: list) -> list:
        _one(items, Channel, rng).schema_id = _one(items, Channel, rng).schema_id
        return items
    return rewritten(bytes(content), change)


def wrong_bodies(content: bytearray, rng: np.random.Generator) -> bytes:
    """Damage serialised messages."""
    def change(items: list) -> list:
        for _ in range(rng.integers(1, 20)):
            message = _one(items, Message, rng)
            body = bytearray(message.data)
            if rng.random() < 0.2:
                body = body[:rng.integers(len(body))]
            elif rng.random() < 0.5:
                place = int(rng.integers(len(body) // 4)) * 4
                body[place:place + 4] = struct.pack('<I', int(rng.integers(2 ** 32)))
            else:
                body[rng.integers(len(body))] ^= int(rng.integers(1, 256))
            message.data = bytes(body)
        return items
    return rewritten(bytes(content), change)


def wrong_times(content: bytearray, rng: np.random.Generator) -> bytes:
    """Let a message be at a time that cannot be."""
    def change(items: list) -> list:
        message = _one(items, Message, rng)
        message.log_time = int(rng.choice(np.array([0, 2 ** 63, 2 ** 64 - 1], dtype=np.uint64)))
        return items
    return rewritten(bytes(content), change)


def forged_chunk(content: bytearray, rng: np.random.Generator) -> bytes:
    """Let a chunk tell an impossible size, or hold anything."""
    chunks = [place for place in records(content) if content[place[0]] == Opcode.CHUNK]
    begin, end = chunks[rng.integers(len(chunks))]
    inside = rng.bytes(int(rng.integers(1, 3000)))
    data = zstandard.compress(inside)
    size = int(rng.choice(np.array([len(inside), 2 ** 60, 2 ** 31, 0], dtype=np.uint64)))
    body = struct.pack('<QQQII', 0, 0, size, zlib.crc32(inside), 4) + b'zstd' + struct.pack(
        '<Q', len(data)) + data
    return content[:begin] + struct.pack('<BQ', Opcode.CHUNK, len(body)) + body + content[end:]


def records(content: bytes | bytearray) -> list[tuple[int, int]]:
    """Return where the records of a whole file begin and end."""
    places, place = [], 8
    while place + 17 <= len(content):
        end = place + 9 + struct.unpack_from('<Q', content, place + 1)[0]
        places.append((place, end))
        place = end
    return places


def rewritten(content: bytes, change: Callable[[list], list]) -> bytes:
    """Return a file with other schemas, channels and messages, and all checksums right."""
    items: list = []
    for record in StreamReader(io.BytesIO(content), emit_chunks=True).records:
        items += breakup_chunk(record) if type(record).__name__ == 'Chunk' else []
    out = io.BytesIO()
    writer = Writer(out, chunk_size=1 << 16, compression=CompressionType.ZSTD)
    writer.start(profile='ros2', library='')
    schemas, channels = {}, {}
    items = change(items)
    for item in items:
        if isinstance(item, Schema):
            schemas[item.id] = writer.register_schema(item.name, item.encoding, item.data)
    for item in items:
        if isinstance(item, Channel):
            channels[item.id] = writer.register_channel(
                item.topic, item.message_encoding, schemas[item.schema_id], item.metadata)
    for item in items:
        if isinstance(item, Message):
            writer.add_message(channels[item.channel_id], item.log_time, item.data,
                               item.publish_time, item.sequence)
    writer.finish()
    return out.getvalue()


def _one(items: list, kind: type, rng: np.random.Generator):
    found = [item for item in items if isinstance(item, kind)]
    return found[rng.integers(len(found))]
