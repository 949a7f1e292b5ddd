# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A way past the executor for what comes often.

For each message rclpy's executor looks through all that its nodes have, services and events too.
That takes 0.4 ms: at hundreds of messages a second, as long as it takes to answer them.
"""

from collections.abc import Callable
import time

from rclpy.context import Context
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.subscription import Subscription
from rclpy.timer import Timer

from dp_swing_ros.nodes.taking import arguments

OFTEN = 0.02   # [s] at most between messages that come often
TURN = 0.02    # [s] for these, then it is the turn of all else


class FastLane:
    """Calls back for one subscription, and for what must not wait meanwhile; in one thread."""

    def __init__(self, context: Context, subscription: Subscription,
                 *others: Subscription | Timer) -> None:
        """Take what one node has made; with simulated time, /clock is among the others."""
        self.subscription = subscription
        self.subscriptions = [
            *(each for each in others if isinstance(each, Subscription)), subscription]
        self.timers = [each for each in others if isinstance(each, Timer)]
        self.wait_set = rclpy_implementation.WaitSet(
            len(self.subscriptions), 0, len(self.timers), 0, 0, 0, context.handle)
        self.came = -OFTEN      # [s] of time.monotonic()
        self.is_busy = False

    def note(self) -> None:
        """Take that a message has come; to be called by the subscription's callback."""
        now = time.monotonic()
        self.is_busy, self.came = now - self.came < OFTEN, now

    def serve(self, is_over: Callable[[], bool]) -> None:
        """
        Call back for a turn, or until all is over, if messages come often; else not at all.

        A turn ends after a message, so that all else has the time until the next.
        """
        end = time.monotonic() + TURN
        while self.is_busy and not is_over() and time.monotonic() < end:
            self.serve_once()

    def serve_once(self) -> None:
        """Wait for a message or a timer, but not for long, and call back."""
        wait_set = self.wait_set
        wait_set.clear_entities()
        for subscription in self.subscriptions:
            wait_set.add_subscription(subscription.handle)
        for timer in self.timers:
            wait_set.add_timer(timer.handle)
        wait_set.wait(round(OFTEN * 1e9))
        came = [each for n, each in enumerate(self.subscriptions)
                if wait_set.is_ready('subscription', n)]
        timers = [each for n, each in enumerate(self.timers) if wait_set.is_ready('timer', n)]
        for timer in timers:
            timer.handle.call_timer()
            timer.callback()
        for subscription in came:
            self._take(subscription)
        if self.subscription not in came:   # a timer that is set anew ends the wait too
            self.is_busy = time.monotonic() - self.came < OFTEN

    @staticmethod
    def _take(subscription: Subscription) -> None:
        taken = arguments(subscription)
        if taken is not None:
            subscription.callback(*taken)
