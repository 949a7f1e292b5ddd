# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The way of a command to the actuator: it may be lost, come late, be overtaken or expire."""

from collections import deque
import math
from typing import NamedTuple

from dp_swing_ros.simulation.parameters import PlantParameters
from dp_swing_ros.streams import Stream, stream


class Command(NamedTuple):
    """A force [N], the time at which it begins to act, and for how long it does [s]."""

    begins: float
    force: float
    lasts: float


class Commands:
    """
    The force that the actuator obeys, and the commands on their way to it.

    A command is never obeyed after a newer one: what would begin later than a newer one is stale.
    """

    def __init__(self, parameters: PlantParameters) -> None:
        """Take how commands fare, and the seed of their fates."""
        self.parameters = parameters
        self.loss = stream(parameters.seed, Stream.COMMAND_LOSS)
        self.lateness = stream(parameters.seed, Stream.COMMAND_JITTER)
        self.force = 0.0            # [N] held until the next
        self.expires = math.inf     # [s] when it no longer is
        self.expired = False        # whether the force is zero for want of a command
        self.coming: deque[Command] = deque()   # in the order in which they will act

    def send(self, now: float, force: float, lasts: float = math.inf) -> bool:
        """Send a force [N] that acts for a time [s] at most, and return whether it will arrive."""
        # drawn whether needed or not, so that one fault does not change the numbers of another
        begins = now + self.lateness.uniform(0.0, self.parameters.command_jitter)
        if self.loss.random() < self.parameters.command_loss:
            return False
        while self.coming and self.coming[-1].begins >= begins:
            self.coming.pop()
        self.coming.append(Command(begins, force, lasts))
        return True

    def next_change(self) -> float:
        """Return when the force changes next [s], infinity if it does not."""
        return min(self.coming[0].begins if self.coming else math.inf, self.expires)

    def change(self) -> None:
        """Let the change happen: the next command acts, or the present one expires."""
        if self.coming and self.coming[0].begins <= self.expires:
            begins, self.force, lasts = self.coming.popleft()
            self.expires, self.expired = begins + lasts, False
        else:
            self.force, self.expires, self.expired = 0.0, math.inf, True
