# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The time since a start, by a clock that may be set."""

from dp_swing_ros.messages.fields import BILLION

JUMP = 2.0         # [s] between two looks at a clock: longer, and it was set


class Stopwatch:
    """The time since its start, which goes on where it was if the clock jumps."""

    def __init__(self, now: int) -> None:
        """Start at a time of the clock [ns]."""
        self.began = self.newest = now
        self.jumped = 0    # [ns] by which the clock jumped in all

    def elapsed(self, now: int) -> float:
        """Return the time since the start [s] at a time of the clock [ns]."""
        passed, self.newest = now - self.newest, now
        if not 0 <= passed <= JUMP * BILLION:
            self.began += passed
            self.jumped += passed
        return (now - self.began) / BILLION
