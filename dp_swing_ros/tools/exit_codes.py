# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How command lines end."""

from collections.abc import Callable
import sys

from dp_swing_ros.errors import UserError
from dp_swing_ros.parameters import ParameterError

OK, FAILED, MISUSED, INTERRUPTED = 0, 1, 2, 130


def exit_code(tool: str, work: Callable[[], int],
              failures: tuple[type[Exception], ...] = (), resume: str = '') -> int:
    """
    Do the work and return its exit code; what the user can put right is one line.

    `failures` are the errors that are no misuse; `resume` says how to go on after Ctrl-C.
    """
    try:
        return work()
    except failures as error:
        print(f'{tool}: error: {error}', file=sys.stderr)
        return FAILED
    except (UserError, ParameterError, OSError) as error:
        print(f'{tool}: error: {error}', file=sys.stderr)
        return MISUSED
    except KeyboardInterrupt:
        print(f'{tool}: interrupted{resume}', file=sys.stderr)
        return INTERRUPTED
