# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A channel with faults: which messages come through, when, and in which order; needs no ROS."""

from collections import deque
from collections.abc import Iterable, Iterator
import dataclasses
from typing import Any, NamedTuple

import numpy as np

from dp_swing_ros.messages.fields import BILLION
from dp_swing_ros.nodes.parameters import ChannelParameters


@dataclasses.dataclass
class Counts:
    """How many messages were heard, and how many of them met with a fault."""

    heard: int = 0
    lost: int = 0
    delayed: int = 0
    duplicated: int = 0
    reordered: int = 0


class Waiting(NamedTuple):
    """A message on its way."""

    due: int    # [ns]
    message: Any


class Channel:
    """
    A queue of messages, some of which are lost, come late, twice, or after the next one.

    What is in the queue keeps its order, however late each is; a message that is held back enters
    it after the next one.
    """

    def __init__(self, parameters: ChannelParameters, random: np.random.Generator) -> None:
        """Take the faults, and the random numbers that say whom they befall."""
        self.parameters, self.random = parameters, random
        self.counts = Counts()
        self.queue = deque[Waiting]()
        self.held: list[Waiting] = []   # a message, or the two that were made of it
        self.newest = 0                 # [ns] when the last message came

    def put(self, message: Any, now: int) -> None:
        """Let a message come at a time [ns]."""
        p, counts = self.parameters, self.counts
        # drawn whether needed or not, so that one fault does not change the numbers of another
        loss, jitter, duplication, reordering = self.random.random(4)
        if now < self.newest:   # a simulated clock begins anew, and so does the run
            self.queue, self.held = deque(), []
        self.newest = now
        counts.heard += 1
        if loss < p.loss:
            counts.lost += 1
            return
        copies = [Waiting(now + round((p.delay + p.jitter * jitter) * BILLION), message)]
        counts.delayed += copies[0].due > now
        if duplication < p.duplication:
            counts.duplicated += 1
            copies *= 2
        if reordering < p.reordering and not self.held:
            counts.reordered += 1
            self.held = copies
        else:
            self._enter(copies)
            self._enter(self.held)
            self.held = []

    def _enter(self, messages: Iterable[Waiting]) -> None:
        for each in messages:
            last = self.queue[-1].due if self.queue else each.due
            self.queue.append(each._replace(due=max(each.due, last)))

    @property
    def due(self) -> int | None:
        """Return when the next message is due [ns], or None if none is on its way."""
        return self.queue[0].due if self.queue else None

    def take(self, now: int) -> Iterator[Any]:
        """Yield the messages that are due at a time [ns]."""
        while self.queue and self.queue[0].due <= now:
            yield self.queue.popleft().message
