# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Ways to damage a bag, each by random numbers: of its bytes, records, files and messages."""

from collections.abc import Callable
import io
from pathlib import Path
import struct

from mcap.records import Channel, Message, Schema
from mcap.stream_reader import breakup_chunk, StreamReader
from mcap.writer import CompressionType, Writer
import numpy as np

Mutation = Callable[[Path, np.random.Generator], None]


def on_bytes(change: Callable[[bytearray, np.random.Generator], bytes]) -> Mutation:
    """Change the first MCAP file of a bag."""
    def mutate(bag: Path, rng: np.random.Generator) -> None:
        file = next(bag.glob('*.mcap'))
        file.write_bytes(change(bytearray(file.read_bytes()), rng))
    return mutate


def truncated(content: bytearray, rng: np.random.Generator) -> bytes:
    """Cut it off anywhere."""
    return content[:rng.integers(len(content))]


def truncated_end(content: bytearray, rng: np.random.Generator) -> bytes:
    """Cut off a part of the summary, where small records lie."""
    return content[:-int(rng.integers(1, 14_000))]


def flipped(content: bytearray, rng: np.random.Generator) -> bytes:
    """Flip bits in 1 to 50 bytes."""
    for place in rng.integers(len(content), size=rng.integers(1, 51)):
        content[place] ^= int(rng.integers(1, 256))
    return content


def flipped_once(content: bytearray, rng: np.random.Generator) -> bytes:
    """Flip one bit at the beginning of a record."""
    places = [n for begin, end in records(content) for n in range(begin, min(begin + 60, end))]
    content[places[rng.integers(len(places))]] ^= 1 << int(rng.integers(8))
    return content


def zeroed(content: bytearray, rng: np.random.Generator) -> bytes:
    """Fill a block with zeros, as a file system leaves it after a power cut."""
    begin, size = _block(content, rng)
    content[begin:begin + size] = bytes(len(content[begin:begin + size]))
    return content


def duplicated(content: bytearray, rng: np.random.Generator) -> bytes:
    """Insert a block of it anywhere."""
    begin, size = _block(content, rng)
    place = rng.integers(len(content))
    return content[:place] + content[begin:begin + size] + content[place:]


def removed(content: bytearray, rng: np.random.Generator) -> bytes:
    """Take a block out."""
    begin, size = _block(content, rng)
    return content[:begin] + content[begin + size:]


def swapped(content: bytearray, rng: np.random.Generator) -> bytes:
    """Swap two records."""
    places = records(content)
    first, second = sorted(rng.choice(len(places), 2, replace=False))
    (a, b), (c, d) = places[first], places[second]
    return content[:a] + content[c:d] + content[b:c] + content[a:b] + content[d:]


def repeated(content: bytearray, rng: np.random.Generator) -> bytes:
    """Have a record twice."""
    begin, end = records(content)[rng.integers(len(records(content)))]
    return content[:end] + content[begin:end] + content[end:]


def spliced(content: bytearray, rng: np.random.Generator) -> bytes:
    """Go on with another file, whose channels have other numbers, from anywhere in it."""
    other = reversed_items(bytes(content))
    return content[:rng.integers(len(content))] + other[rng.integers(len(other)):]


def empty(content: bytearray, rng: np.random.Generator) -> bytes:
    """Leave nothing, or zeros."""
    return bytes(int(rng.choice([0, 1, 8, 4096])))


def without_files(bag: Path, rng: np.random.Generator) -> None:
    """Remove the file, the metadata or all, or put something else there."""
    file = next(bag.glob('*.mcap'))
    what = rng.integers(5)
    if what == 0:
        file.unlink()
    elif what == 1:
        (bag / 'metadata.yaml').unlink()
    elif what == 2:
        (bag / 'metadata.yaml').write_bytes(rng.bytes(500))
    elif what == 3:
        file.rename(file.with_suffix('.txt'))
        file.mkdir()
    else:
        file.write_text('this is no bag')


def records(content: bytes | bytearray) -> list[tuple[int, int]]:
    """Return where the records of a whole file begin and end."""
    places, place = [], 8
    while place + 17 <= len(content):
        end = place + 9 + struct.unpack_from('<Q', content, place + 1)[0]
        places.append((place, end))
        place = end
    return places


def reversed_items(content: bytes) -> bytes:
    """Return a file with the schemas, channels and messages of another in the reverse order."""
    items: list = []
    for record in StreamReader(io.BytesIO(content), emit_chunks=True).records:
        items += breakup_chunk(record) if type(record).__name__ == 'Chunk' else []
    items.reverse()
    out = io.BytesIO()
    writer = Writer(out, chunk_size=1 << 16, compression=CompressionType.ZSTD)
    writer.start(profile='ros2', library='')
    schemas = {item.id: writer.register_schema(item.name, item.encoding, item.data)
               for item in items if isinstance(item, Schema)}
    channels = {item.id: writer.register_channel(
        item.topic, item.message_encoding, schemas[item.schema_id], item.metadata)
        for item in items if isinstance(item, Channel)}
    for item in items:
        if isinstance(item, Message):
            writer.add_message(channels[item.channel_id], item.log_time, item.data,
                               item.publish_time, item.sequence)
    writer.finish()
    return out.getvalue()


def _block(content: bytearray, rng: np.random.Generator) -> tuple[int, int]:
    size = int(rng.choice([1, 37, 512, 4096, 65536]))
    return int(rng.integers(len(content))), size


MUTATIONS: dict[str, Mutation] = {
    'cut off anywhere': on_bytes(truncated), 'cut off in the summary': on_bytes(truncated_end),
    '1 to 50 bytes changed': on_bytes(flipped),
    'a bit of a header changed': on_bytes(flipped_once),
    'a block of zeros': on_bytes(zeroed), 'a block twice': on_bytes(duplicated),
    'a block missing': on_bytes(removed), 'two records swapped': on_bytes(swapped),
    'a record twice': on_bytes(repeated), 'continued by another file': on_bytes(spliced),
    'empty or zeros': on_bytes(empty), 'files missing or others': without_files}
