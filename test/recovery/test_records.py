# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import struct

from mcap.opcode import Opcode
from mcap_files import KINDS, make
import pytest

from dp_swing_ros.recovery.records import index_fits


def place_of(data, opcode):
    """Return where the body of the first record of a kind begins."""
    place = 8
    while data[place] != opcode:
        place += 9 + struct.unpack_from('<Q', data, place + 1)[0]
    return place + 9


@pytest.mark.parametrize('compression', KINDS)
@pytest.mark.parametrize('chunks', [True, False])
def test_index_of_a_whole_file_fits(compression, chunks):
    assert index_fits(make(compression, chunks))


@pytest.mark.parametrize('opcode, offset', [
    (Opcode.MESSAGE_INDEX, 6), (Opcode.MESSAGE_INDEX, 14), (Opcode.CHUNK, 0), (Opcode.CHUNK, 8),
    (Opcode.CHUNK_INDEX, 16), (Opcode.CHUNK_INDEX, 24), (Opcode.FOOTER, 0)],
    ids=['time', 'message', 'first', 'last', 'chunk', 'size', 'summary'])
def test_index_that_points_elsewhere_is_found(opcode, offset):
    data = bytearray(make())
    data[place_of(data, opcode) + offset] ^= 1
    assert not index_fits(bytes(data))
