# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""When a plant in lockstep goes on: at once, at a pace, a period at a step, or not at all."""

from collections.abc import Callable
import math
import time

from dp_swing_ros.nodes.process import ProcessNode, STEADY


class Pace:
    """Lets the periods of a plant pass, each of which is `ready` once its force is known."""

    def __init__(self, node: ProcessNode, go_on: Callable[[], None]) -> None:
        """Take whose timer it is, and what to do when a period is to pass."""
        self.go_on = go_on
        self.paused = self.stepping = self.ready = False
        self.due = -math.inf   # [s] of the steady clock: the period may pass
        self.timer = node.create_timer(1.0, self.on_timer, clock=STEADY, autostart=False)

    def begin(self, lasts: float) -> None:
        """Begin a period that is to last for a time [s] at least."""
        self.ready = self.stepping = False
        # what one took too long the next makes up for, but no more than one
        self.due = max(self.due, time.monotonic() - lasts) + lasts

    def change(self, lasts: float) -> None:
        """Let the present period, too, last for no more than a time [s] from now on."""
        self.due = min(self.due, time.monotonic() + lasts)
        self.look()

    def let_pass(self) -> None:
        """Let the period pass, now or when it is time."""
        self.ready = True
        self.look()

    def look(self) -> None:
        """Let the period pass if it is ready and its time has come; else wait for that."""
        if not self.ready or self.paused and not self.stepping:
            return
        wait = self.due - time.monotonic()
        if wait > 0 and not self.stepping:
            self.timer.timer_period_ns = max(round(wait * 1e9), 1)
            self.timer.reset()
            return
        self.ready = False
        self.go_on()

    def on_timer(self) -> None:
        """See whether it is time."""
        self.timer.cancel()
        self.look()

    def pause(self, paused: bool) -> tuple[bool, str]:
        """Stop, or go on."""
        self.paused = paused
        self.look()
        return True, 'paused' if paused else 'going on'

    def step(self) -> tuple[bool, str]:
        """Let one period pass."""
        if not self.paused:
            return False, 'not paused; call plant/pause first'
        passes = self.ready
        self.stepping = True
        self.look()
        return True, 'a period has passed' if passes else 'a period passes with the next force'
