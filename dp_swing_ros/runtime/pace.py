# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""When a plant in lockstep goes on: at once, at a pace, a period at a step, or not at all."""

from typing import NamedTuple


class Answer(NamedTuple):
    """What a service answers."""

    success: bool
    message: str


class Pace:
    """Knows when a period may pass, which is `ready` once its force is known."""

    def __init__(self) -> None:
        """Begin with none."""
        self.paused = self.stepping = self.ready = False
        self.due = 0   # [ns] of a steady clock: the period may pass

    def begin(self, now: int, lasts: int) -> None:
        """Begin a period that is to last for a time [ns] at least."""
        self.ready = self.stepping = False
        # what one took too long the next makes up for, but no more than one
        self.due = max(self.due, now - lasts) + lasts

    def change(self, now: int, lasts: int) -> None:
        """Let the present period, too, last for no more than a time [ns] from now on."""
        self.due = min(self.due, now + lasts)

    def wait(self, now: int) -> int | None:
        """Return for how long the period is to wait [ns]; None: for something to come."""
        if not self.ready or self.paused and not self.stepping:
            return None
        return 0 if self.stepping else max(self.due - now, 0)

    def pause(self, paused: bool) -> Answer:
        """Stop, or go on."""
        self.paused = paused
        return Answer(True, 'paused' if paused else 'going on')

    def step(self) -> Answer:
        """Let one period pass."""
        if not self.paused:
            return Answer(False, 'not paused; call plant/pause first')
        self.stepping = True
        return Answer(True, 'a period has passed' if self.ready
                      else 'a period passes with the next force')
