# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What ends a program with one line instead of a traceback."""


class UserError(Exception):
    """The user can put this right; the message says what was found, expected, and what to do."""


class BagError(UserError):
    """A bag cannot be written or read."""


def one_line(error: BaseException) -> str:
    """Return the text of an error, in one line and not too long."""
    return ' '.join(str(error).split())[:300] or type(error).__name__
