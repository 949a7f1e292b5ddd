# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A watchdog on something that should come every period."""

from collections import deque
from typing import Callable

import numpy as np

from dp_swing_ros.nodes.process import ProcessNode

SPARE = 0.025    # [s] at least, beyond a period, before the first bark; one every period follows
PATIENCE = 0.5   # periods, where that is longer
REMEMBERED = 9   # periods; some of them may be those of losses


class Watchdog:
    """Learns the period of its feedings, by the node's clock; barks where none came."""

    def __init__(self, node: ProcessNode, period: float, bark: Callable[[], None]) -> None:
        """Take the node whose timer it is, the period [s] until one is known, and what to call."""
        self.bark, self.first = bark, period
        # a clock that is set must not look like silence, and simulated time may stand still
        self.timer = node.create_timer(1.0, self.on_time, clock=node.pace_clock, autostart=False)
        self.forget()

    def forget(self) -> None:
        """Stop, and forget the period."""
        self.timer.cancel()
        self.periods: deque[float] = deque([self.first], maxlen=REMEMBERED)

    @property
    def period(self) -> float:
        """Return the period [s] as it is known."""
        return float(np.median(self.periods))

    def feed(self, period: float) -> None:
        """Wait anew; the last feeding was this time [s] ago."""
        if period > 0:
            self.periods.append(period)
        self.wait(self.period + max(PATIENCE * self.period, SPARE))

    def wait(self, duration: float) -> None:
        """Bark after a time [s]."""
        self.timer.timer_period_ns = round(duration * 1e9)
        self.timer.reset()

    def on_time(self) -> None:
        """Bark, after a wait for the next."""
        self.wait(self.period)
        self.bark()

    def stop(self) -> None:
        """Bark no more until it is fed."""
        self.timer.cancel()
