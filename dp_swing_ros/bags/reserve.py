# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Room on the disk, held back for the end of a bag."""

from contextlib import suppress
import os
from pathlib import Path

NAME = '.reserve'
STEP = 1 << 16  # [bytes] more than is asked for, so that it grows rarely


class Reserve:
    """A file of nothing in a bag's folder, removed when its place is needed."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / NAME
        self._size = 0

    def hold(self, size: int) -> None:
        """Hold at least so many bytes; a disk without room for them will tell soon enough."""
        if size <= self._size:
            return
        with suppress(OSError), self._path.open('ab') as file:
            os.posix_fallocate(file.fileno(), 0, size + STEP)
            self._size = size + STEP

    def release(self) -> None:
        """Give it back."""
        with suppress(OSError):
            self._path.unlink()
