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
from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.subscription import Subscription
from rclpy.timer import Timer

from dp_swing_ros.nodes.taking import arguments

OFTEN = 0.02   # [s] at most between messages that come often
TURN = 0.02    # [s] for these, then it is the turn of all else


class FastLane:
    """Calls back for one subscription, and for what must not wait meanwhile; in one thread."""

    def __init__(self, context: Context, subscription: Subscription,
                 *others: Timer | GuardCondition) -> None:
        """Take what one node has made."""
        self.subscription = subscription
        self.timers = [each for each in others if isinstance(each, Timer)]
        self.guards = [each for each in others if isinstance(each, GuardCondition)]
        self.wait_set = rclpy_implementation.WaitSet(
            1, len(self.guards), len(self.timers), 0, 0, 0, context.handle)
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
            self._serve_once()

    def _serve_once(self) -> None:
        wait_set = self.wait_set
        wait_set.clear_entities()
        wait_set.add_subscription(self.subscription.handle)
        for timer in self.timers:
            wait_set.add_timer(timer.handle)
        for guard in self.guards:
            wait_set.add_guard_condition(guard.handle)
        wait_set.wait(round(OFTEN * 1e9))
        is_there = wait_set.is_ready('subscription', 0)
        timers = [each for n, each in enumerate(self.timers) if wait_set.is_ready('timer', n)]
        guards = [each for n, each in enumerate(self.guards)
                  if wait_set.is_ready('guard_condition', n)]
        for timer in timers:
            timer.handle.call_timer()
            timer.callback()
        for guard in guards:
            guard.callback()
        if is_there:
            self._take()
        else:   # a timer that is set anew ends the wait too
            self.is_busy = time.monotonic() - self.came < OFTEN

    def _take(self) -> None:
        taken = arguments(self.subscription)
        if taken is not None:
            self.subscription.callback(*taken)
