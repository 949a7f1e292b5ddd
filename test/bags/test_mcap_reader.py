# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whole files, as other writers make them, and what the mcap library would pass over."""

import struct
import subprocess
import sys
import zlib

import lz4.frame
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC as MAGIC
from mcap_files import body, chunk, COUNT, KINDS, make
import pytest
import zstandard

from dp_swing_ros.bags.mcap_reader import DamagedFile, read, unpack

CONTENT = b'some content ' * 1000
PACKED = {'': CONTENT, 'lz4': lz4.frame.compress(CONTENT), 'zstd': zstandard.compress(CONTENT)}


@pytest.mark.parametrize('compression', KINDS)
@pytest.mark.parametrize('chunks', [True, False])
def test_files_of_other_writers_are_read(compression, chunks):
    entries = read(make(compression, chunks))
    assert [entry.sequence for entry in entries] == [*range(COUNT)]
    assert all(entry.data == body(entry.sequence) for entry in entries)
    assert {entry.topic for entry in entries} == {'/a'}
    assert entries[0].channel.metadata == {'key': 'value'}


def first_chunk(data):
    """Return where the first chunk begins and ends."""
    place = len(MAGIC)
    while data[place] != Opcode.CHUNK:
        place += 9 + struct.unpack_from('<Q', data, place + 1)[0]
    return place, place + 9 + struct.unpack_from('<Q', data, place + 1)[0]


def second_chunk(data):
    """Return where the second chunk begins and ends."""
    _, end = first_chunk(data)
    return tuple(place + end - len(MAGIC) for place in first_chunk(MAGIC + data[end:]))


def test_a_chunk_less_is_not_what_the_file_counts():
    data = make()
    begin, end = second_chunk(data)   # the first declares the channel
    with pytest.raises(DamagedFile, match=f'after .* messages, then counts {COUNT} of them'):
        read(data[:begin] + data[end:])


def test_a_chunk_of_no_kind_is_missed_without_a_count():
    data = bytearray(make(statistics=False))
    data[second_chunk(data)[0]] ^= 0x10
    with pytest.raises(DamagedFile, match=f'then counts {COUNT} of them'):
        read(bytes(data))


def test_bytes_after_the_end_are_damage():
    with pytest.raises(DamagedFile, match='then goes on after its end'):
        read(make() + make())


@pytest.mark.parametrize('compression', KINDS)
def test_a_checksum_that_is_wrong_is_damage(compression):
    data = bytearray(make(compression))
    begin, _ = first_chunk(data)
    data[begin + 9 + 24] ^= 1
    with pytest.raises(DamagedFile, match='checksum or size is wrong'):
        read(bytes(data))


def test_a_second_channel_of_a_number_is_damage():
    inside = b''.join(struct.pack('<BQHHI', 4, 19 + len(name), 1, 0, len(name)) + name
                      + struct.pack('<II', 3, 0)[:4] + b'cdr' + bytes(4)
                      for name in (b'/a', b'/b'))
    with pytest.raises(DamagedFile, match='after 0 messages, then has a second channel 1'):
        read(MAGIC + chunk(inside, len(inside), b'', zlib.crc32(inside)))


def test_a_chunk_takes_no_more_memory_than_it_says(tmp_path):
    data = bytes(1 << 28)
    for name, packed in (('zstd', zstandard.compress(data)), ('lz4', lz4.frame.compress(data))):
        (tmp_path / name).write_bytes(MAGIC + chunk(packed, 1000, name.encode()))
    code = ('import resource, sys\nfrom dp_swing_ros.bags.mcap_reader import *\n'
            'from pathlib import Path\nbefore = resource.getrusage(0).ru_maxrss\n'
            f'for file in Path({str(tmp_path)!r}).iterdir():\n'
            ' try:\n  with contents(file) as data: read(data)\n'
            ' except DamagedFile: pass\n'
            'sys.exit(resource.getrusage(0).ru_maxrss - before > 1 << 15)')
    assert subprocess.run([sys.executable, '-c', code]).returncode == 0


@pytest.mark.parametrize('compression', PACKED)
def test_a_whole_chunk_is_verified_by_size_and_checksum(compression):
    packed, size, checksum = PACKED[compression], len(CONTENT), zlib.crc32(CONTENT)
    assert unpack(packed, compression, size, checksum) == (CONTENT, True, True)
    assert unpack(packed, compression, size, 0) == (CONTENT, True, True)
    assert unpack(packed, compression, size, checksum ^ 1) == (CONTENT, True, False)
    assert not unpack(packed, compression, size + 1, checksum).verified
    assert unpack(packed, compression, size - 1, 0) == (CONTENT[:-1], False, False)
    assert unpack(packed, 'zip', size, checksum) == (b'', False, False)


@pytest.mark.parametrize('compression', PACKED)
def test_a_chunk_of_no_bytes_is_nothing(compression):
    """Where zeros have overwritten the length of a chunk; zstandard reads it for ever."""
    assert unpack(b'', compression, 4830, 0) == (b'', False, False)
