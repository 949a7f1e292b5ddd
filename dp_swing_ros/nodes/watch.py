# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A watch over something that should come every period: it tells when that does not."""

from collections import deque
from typing import Callable

import numpy as np
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node

PATIENCE = 1.5   # periods until the first call; from then on there is one every period
REMEMBERED = 9   # periods; some of them may be those of losses


class Watch:
    """Learns the period from what comes; calls back where nothing came."""

    def __init__(self, node: Node, callback: Callable[[], None]) -> None:
        """Take the node whose timer it is, and what to call."""
        self.callback = callback
        self.timer = node.create_timer(
            1.0, self.on_time, clock=Clock(clock_type=ClockType.STEADY_TIME), autostart=False)
        self.forget()

    def forget(self) -> None:
        """Stop, and forget the period."""
        self.timer.cancel()
        self.periods: deque[float] = deque(maxlen=REMEMBERED)

    def heard(self, period: float) -> None:
        """Wait anew; the last one came this time [s] ago."""
        if period > 0:
            self.periods.append(period)
        if self.periods:
            self.wait(PATIENCE)

    def wait(self, periods: float) -> None:
        """Call after so many periods."""
        self.timer.timer_period_ns = round(periods * float(np.median(self.periods)) * 1e9)
        self.timer.reset()

    def on_time(self) -> None:
        """Call, after a wait for the next."""
        self.wait(1.0)
        self.callback()

    def stop(self) -> None:
        """Call no more until something comes."""
        self.timer.cancel()
