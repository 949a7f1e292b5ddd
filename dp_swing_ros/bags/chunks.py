# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Unpacks chunks as far as that goes, in no more memory than they fill."""

from io import BytesIO
from typing import Any, Iterator, NamedTuple
import zlib

import lz4.frame
import zstandard

PIECE = 1 << 16    # [bytes] unpacked at a time: what an error costs besides its own block
LARGEST = 1 << 29  # [bytes] of a chunk; writers make them of a few MiB
STREAMS: dict[str, Any] = {'': BytesIO, 'lz4': lambda data: lz4.frame.LZ4FrameFile(BytesIO(data)),
                           'zstd': zstandard.ZstdDecompressor().stream_reader}


class Unpacked(NamedTuple):
    """The beginning of a chunk, and how it compares with what the chunk says of itself."""

    content: bytes
    complete: bool  # of the size that it says
    verified: bool  # complete, and with the checksum that it says, if any


def unpack(data: bytes, compression: str, size: int, checksum: int) -> Unpacked:
    """Unpack what is to give `size` bytes, up to the first error; a checksum of 0 is none."""
    pieces, missing = [], size
    if size <= LARGEST and compression in STREAMS:
        for piece in _pieces(data, compression):
            pieces.append(piece)
            missing -= len(piece)
            if missing < 0:
                break
    content = b''.join(pieces)
    complete = len(content) == size
    return Unpacked(content[:size], complete,
                    complete and (checksum == 0 or zlib.crc32(content) == checksum))


def _pieces(data: bytes, compression: str) -> Iterator[bytes]:
    if not data:
        return   # of nothing at all zstandard would read for ever
    stream = STREAMS[compression](data)
    try:
        while piece := stream.read1(PIECE):
            yield piece
    except (zstandard.ZstdError, RuntimeError, EOFError, MemoryError):
        return  # what follows is lost
