# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who is around a controller, and when its first state can be answered."""

from typing import NamedTuple

from dp_swing_ros.messages.configuration import Configuration, is_of_plant
from dp_swing_ros.runtime.schedule import Arrived
from dp_swing_ros.runtime.timing import Timing

PATIENCE = 2.0   # [s] at most, to learn who sends the states, and for them to find the forces


class Peers(NamedTuple):
    """The nodes around a controller, by their full names."""

    senders: set[str]      # of states
    announcers: set[str]   # of what they run with
    hearers: set[str]      # of the forces, once all that are there are connected


class Handshake:
    """Keeps the first state until the clock of its stamp is known and the force will be heard."""

    def __init__(self) -> None:
        """Begin without any."""
        self.done = False
        self.waiting: Arrived | None = None   # the newest state, until it can be answered
        self.until = 0.0                      # [s] of a steady clock, and then all the same
        self.resets = dict[str, int]()        # of the nodes that have announced themselves
        self.plants = set[str]()              # the names of those that are plants of ours

    def keep(self, arrived: Arrived, now: float) -> None:
        """Keep a state that came now [s] until it can be answered."""
        if self.waiting is None:
            self.until = now + PATIENCE
        self.waiting = arrived

    def is_late(self, now: float) -> bool:
        """Return whether a state has waited for long at a time [s]."""
        return not self.done and self.waiting is not None and now > self.until

    def learn(self, configured: Configuration) -> bool:
        """
        Take what a node announces; return whether it is a pendulum that begins again.

        A plan from before leads from where that is no more; a plant that is started again is
        another one, of which nothing is known yet.
        """
        is_plant = is_of_plant(configured)
        if is_plant:
            self.plants.add(configured.node)
        before = self.resets.get(configured.node)
        self.resets[configured.node] = configured.resets
        return before is not None and (
            configured.resets != before or is_plant and configured.revision == 0)

    def complete(self, peers: Peers, timing: Timing, is_timed: bool,
                 now: float) -> Arrived | None:
        """
        Return the state to answer at a time [s], once, if it can be, or after a while.

        Before a simulated clock is heard nobody knows when that was, nor when it is too long ago.
        """
        if self.done or self.waiting is None or not is_timed or not (
                now > self.until or self._is_complete(peers, timing)):
            return None
        self.done = True
        return self.waiting

    def _is_complete(self, peers: Peers, timing: Timing) -> bool:
        announcers = peers.senders & peers.announcers
        if timing.configured is None and not announcers <= self.resets.keys():
            return False
        # a plant in lockstep would wait forever for a force that it did not hear
        wanted = peers.senders if timing.lockstep else announcers & self.plants
        return not (timing.lockstep or wanted) or bool(wanted) and wanted <= peers.hearers
