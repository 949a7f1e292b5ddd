# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What ends a program with one line instead of a traceback."""

from pathlib import Path
import traceback

SHOWN = 200  # [characters] of a value in an error


class UserError(Exception):
    """The user can put this right; the message says what was found, expected, and what to do."""


class BagError(UserError):
    """A bag cannot be written or read."""


def one_line(error: BaseException) -> str:
    """Return the text of an error, in one line and not too long."""
    return ' '.join(str(error).split())[:300] or type(error).__name__


def failure(error: Exception) -> str:
    """Return in one line what failed, and where."""
    place = traceback.extract_tb(error.__traceback__)[-1:]
    where = ''.join(f' ({Path(each.filename).name}, line {each.lineno})' for each in place)
    return f'{type(error).__name__}: {one_line(error)[:SHOWN]}{where}'
