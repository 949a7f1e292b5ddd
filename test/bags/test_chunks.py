# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import zlib

import lz4.frame
import pytest
import zstandard

from dp_swing_ros.bags.chunks import unpack

CONTENT = b'some content ' * 1000
PACKED = {'': CONTENT, 'lz4': lz4.frame.compress(CONTENT), 'zstd': zstandard.compress(CONTENT)}


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
