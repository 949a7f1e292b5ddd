# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import gc
import struct
import time
import tracemalloc
import zlib

from mcap.records import Message
from mcap.writer import CompressionType, MCAP0_MAGIC as MAGIC
from mcap_files import body, chunk, COUNT, KINDS, make
import numpy as np
import pytest
import zstandard

from dp_swing_ros.recovery.scan import Damage, Reason, scan


def scanned(data):
    """Return the numbers of the messages and the damages; what is verified is as written."""
    items = list(scan(bytes(data)))
    found = [item for item in items
             if not isinstance(item, Damage) and isinstance(item.record, Message)]
    assert all(item.record.data == body(item.record.sequence) for item in found if item.verified)
    return [item.record.sequence for item in found], [
        item for item in items if isinstance(item, Damage)]


@pytest.mark.parametrize('compression', KINDS)
@pytest.mark.parametrize('chunks', [True, False])
def test_whole_file_is_whole(compression, chunks):
    assert scanned(make(compression, chunks)) == (list(range(COUNT)), [])


@pytest.mark.parametrize('compression', KINDS)
@pytest.mark.parametrize('chunks', [True, False])
def test_what_is_before_a_cut_is_found(compression, chunks):
    data = make(compression, chunks)
    counts = []
    for size in range(0, len(data) - 1, 97):
        numbers, damages = scanned(data[:size])
        assert numbers == list(range(len(numbers)))
        assert [damage.reason for damage in damages] in ([Reason.CUT], [Reason.NO_END])
        counts.append(len(numbers))
    assert counts == sorted(counts)
    assert counts[-1] == COUNT


def test_whole_messages_of_a_chunk_without_its_end_are_found():
    data = make(CompressionType.NONE, chunk_size=1 << 20)
    numbers, _ = scanned(data[:len(data) // 2])
    assert 10 < len(numbers) < COUNT


@pytest.mark.parametrize('compression', KINDS)
def test_changed_bytes_cost_their_chunk_and_no_other(compression, rng):
    data = make(compression)
    for _ in range(100):
        damaged = bytearray(data)
        damaged[rng.integers(len(data))] ^= 1 << int(rng.integers(8))
        numbers, damages = scanned(damaged)
        # of a few bytes, as in the name of the writer, no message depends
        assert damages or numbers == list(range(COUNT))
        assert len(numbers) >= COUNT - 40


@pytest.mark.parametrize('compression', KINDS)
@pytest.mark.parametrize('size', [1, 100, 3000])
def test_it_goes_on_after_a_block_that_is_gone_or_garbage(compression, size, rng):
    data = make(compression)
    for place in rng.integers(len(data) // 2, size=30):
        for block in (b'', bytes(size), rng.bytes(size)):
            numbers, damages = scanned(data[:place] + block + data[place + size:])
            assert damages or numbers == list(range(COUNT))
            assert len(set(numbers)) > COUNT // 3


def test_forged_size_takes_no_memory():
    small = zstandard.compress(b'x' * 100)
    bomb = zstandard.compress(bytes(1 << 26))
    tracemalloc.start()
    for size in (2 ** 60, 2 ** 31, 0):
        numbers, damages = scanned(MAGIC + chunk(small, size))
        assert not numbers
        assert damages
    assert scanned(MAGIC + chunk(bomb, 1000))[1]
    assert tracemalloc.get_traced_memory()[1] < 2 ** 22
    tracemalloc.stop()


@pytest.mark.parametrize('piece', [
    chunk(b'', 0, b'', 1), struct.pack('<BQ', 5, 22) + bytes(8), b'\x04' + bytes(8),
    struct.pack('<BQI', 12, 60_009, 60_000), b'\x05' + bytes(8), MAGIC],
    ids=['chunks', 'messages', 'channels', 'metadata', 'empty', 'magic'])
def test_time_grows_with_the_size_only(piece):
    def taken(size):
        data = MAGIC + piece * (size // len(piece))
        gc.disable()   # which looks through all that the tests before have left
        start = time.process_time()
        list(scan(data))
        gc.enable()
        return time.process_time() - start

    assert taken(800_000) < 8 * taken(200_000) + 0.5


def test_chunks_in_chunks_end():
    size, heads = 57 * 20_000, b''
    for n in range(20_000):
        heads += chunk(b'', 1, b'', 1, 40 + size - 57 * (n + 1))[:-8] + struct.pack(
            '<Q', size - 57 * (n + 1))
    start = time.process_time()
    assert list(scan(MAGIC + heads))
    assert time.process_time() - start < 5


def test_chunk_that_is_not_what_its_checksum_says_gives_nothing():
    inside = struct.pack('<BQHIQQ', 5, 22 + 32, 0, 3, 3, 3) + body(3)
    good = MAGIC + chunk(inside, len(inside), b'', zlib.crc32(inside))
    assert scanned(good)[0] == [3]
    for place in np.linspace(len(good) - len(inside), len(good) - 1, 20, dtype=int):
        damaged = bytearray(good)
        damaged[place] ^= 1
        assert scanned(damaged)[0] == []


def test_nothing_of_it_is_anything(rng):
    for data in (b'', b'\x89', bytes(5000), rng.bytes(5000), MAGIC, MAGIC + bytes(100)):
        numbers, damages = scanned(data)
        assert not numbers
        assert damages
