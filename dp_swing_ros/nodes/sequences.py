# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Counts lost messages by the gaps in the sequence numbers that their publishers give them."""


class Tally:
    """
    The messages of one topic that came and that did not.

    Each publisher counts its messages, but a message does not say whose it is. So a number
    belongs to the publisher whose last one is closest below it: exact for one publisher, an
    estimate for several. What was sent before the first message that came is not counted.
    """

    def __init__(self) -> None:
        self.came = 0
        self.lost = 0
        self._last: list[int] = []  # number of the last message of each publisher

    def count(self, number: int, publishers: int) -> None:
        """Count the message of this number, on a topic with so many publishers now."""
        self.came += 1
        if number - 1 in self._last:
            gap = 0
        elif len(self._last) < publishers or number <= min(self._last):
            self._last.append(number)  # the first of a publisher
            return
        else:
            gap = number - 1 - max(last for last in self._last if last < number)
        self._last[self._last.index(number - 1 - gap)] = number
        self.lost += gap
