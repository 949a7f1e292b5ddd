# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
When a state was measured, by its stamp and its arrival.

Nobody can see from a stamp which clock it was read from. So the controller learns it, by its
parameter `clock`, or from whoever publishes the states, on the topic `configuration`.
"""

from collections import deque
from enum import Enum
import math
from typing import NamedTuple

from dp_swing_ros.messages.configuration import Configuration

OLDEST = 1.0       # [s] a state older than this cannot be: no plan reaches much further
AHEAD = 0.005      # [s] a stamp may be this far in the future, where clocks are kept together
WINDOW = 5.0       # [s] in which the state that came fastest gives the offset of the clocks


class Clock(Enum):
    """What the stamps are; the value says what follows from it."""

    STAMPS = 'stamps are of the clock of this node: a state is as old as its stamp'
    ARRIVAL = 'stamps are of some clock: a state is as old as it came later than others did'
    LOCKSTEP = 'stamps are simulated time, which waits for the answer'


class Measured(NamedTuple):
    """When a state was measured [s], how old it is [s], and what is wrong with its stamp."""

    t: float
    age: float
    complaint: str = ''


class Timing:
    """Computes when states were measured; remembers how fast they came."""

    def __init__(self, clock: str) -> None:
        """Take the parameter `clock` of the controller."""
        self.given = None if clock == 'announced' else Clock[clock.upper()]
        self.announced = Clock.ARRIVAL
        self.delay = 0.0   # [s] age of the states in lockstep
        self.reset()

    def reset(self) -> None:
        """Forget the states before."""
        self.offsets: deque[tuple[float, float]] = deque()   # of the last states: arrival, offset
        self.stamp = -math.inf

    @property
    def clock(self) -> Clock:
        """Return which clock the stamps are of."""
        return self.given or self.announced

    def learn(self, configuration: Configuration) -> None:
        """
        Take over what a plant announces; of other nodes the configuration changes nothing.

        Raises TypeError or ValueError where the delay is no number.
        """
        lockstep = configuration.parameters.get('lockstep')
        if lockstep is not None:
            self.delay = float(configuration.parameters.get('delay', 0.0))
            self.announced = Clock.LOCKSTEP if lockstep else Clock.STAMPS

    def measured(self, stamp: float, now: float, sent: float) -> Measured:
        """
        Return when a state was measured that came now [s] with a stamp [s].

        It was sent at a time [s] that is right but for a constant offset of the sender's clock.
        """
        if self.clock is Clock.LOCKSTEP:
            return Measured(stamp, self.delay)
        age = now - stamp
        relative = self.relative_age(stamp, now, sent)
        if self.clock is Clock.ARRIVAL:
            return relative
        if -AHEAD <= age <= OLDEST:
            return Measured(stamp, max(age, 0.0))
        return relative._replace(complaint=(
            f'the stamp is {abs(age):.3g} s {"old" if age > 0 else "ahead"}; expected one of this '
            f"node's clock, at most {OLDEST:g} s old; set the parameter clock to arrival"))

    def relative_age(self, stamp: float, now: float, sent: float) -> Measured:
        """Return how much later a state came than the fastest of late, whatever its clock."""
        while self.offsets and self.offsets[0][0] < now - WINDOW:
            self.offsets.popleft()
        stands_still, self.stamp = stamp == self.stamp, stamp
        offset = now - (sent if stands_still else stamp)
        if self.offsets and abs(offset - self.offsets[-1][1]) > OLDEST:
            self.offsets.clear()   # a clock was set
        self.offsets.append((now, offset))
        age = offset - min(before for _, before in self.offsets)
        return Measured(now - age, age, 'the stamps stand still; the time of sending counts'
                        if stands_still else '')
