# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
When a state was measured, when the force for it will act, and when no state came in time.

Nobody can see from a stamp which clock it was read from. So the controller learns it, by its
parameter `clock`, or from whoever publishes the states, on the topic `configuration`.
"""

from collections import deque
from collections.abc import Collection
from enum import Enum
import math
from statistics import median
from typing import NamedTuple

from dp_swing_ros.messages.configuration import Configuration, is_of_plant

OLDEST = 1.0       # [s] a state older than this cannot be: no plan reaches much further
AHEAD = 0.005      # [s] a stamp may be this far in the future, where clocks are kept together
LONGEST_TRANSPORT = 0.05  # [s]; beyond, the clocks of two machines differ
BUSY = 0.8         # of the states' period, the longest tick
SLACK = 1e-3       # [s] of that which is not waited for: what a machine may hold it up beside
TICKS, LONGER = 20, 1     # of the last ticks, so many may take longer than the next is given
WINDOW = 5.0       # [s] in which the state that came fastest gives the offset of the clocks
SPARE = 0.025      # [s] at least, beyond a period, to a first silence; one every period follows
PATIENCE = 0.5     # periods, where that is longer
LATELY = 10.0      # [s]
AGAIN, MOST = 3, 1000   # jumps back in that time that are too many, and that are counted
PERIODS = 9        # that are remembered; some of them may be those of losses
PLANTS = 100       # that may have announced themselves


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


class Fastest:
    """Remembers by how much the messages of the last seconds seemed to be late."""

    def __init__(self) -> None:
        """Begin with none."""
        # arrival, and how late it seemed [s]; without those before one that was less so
        self.seen = deque[tuple[float, float]]()

    def least(self, now: float, seeming: float) -> float:
        """Take how late a message seems that came now [s]; return the least of late."""
        while self.seen and self.seen[0][0] < now - WINDOW:
            self.seen.popleft()
        if self.seen and abs(seeming - self.seen[-1][1]) > OLDEST:
            self.seen.clear()   # a clock was set
        while self.seen and self.seen[-1][1] >= seeming:
            self.seen.pop()
        self.seen.append((now, seeming))
        return self.seen[0][1]


class Timing:
    """Computes when states were measured; remembers how fast they came."""

    def __init__(self, clock: str) -> None:
        """Take the parameter `clock` of the controller."""
        self.configured = None if clock == 'announced' else Clock[clock.upper()]
        # by plant, the newest last: the clock of its stamps, and the age of states in lockstep [s]
        self.announced = dict[str, tuple[Clock, float]]()
        self.obeyed, self.senders = '', frozenset[str]()   # nodes: whose states count, of states
        self.reset()

    def reset(self) -> None:
        """Forget the states before."""
        self.stamps, self.sendings = Fastest(), Fastest()   # by the stamps, and by the sender
        self.stamp = -math.inf

    @property
    def clock(self) -> Clock:
        """Return which clock the stamps are of."""
        return self.configured or self._said()[0]

    @property
    def delay(self) -> float:
        """Return the age of states in lockstep [s]."""
        return self._said()[1]

    def _said(self) -> tuple[Clock, float]:
        """Return what a plant announced: whose states are obeyed, or of the recording of one."""
        if self.obeyed in self.announced:
            return self.announced[self.obeyed]
        return next((said for node, said in reversed(self.announced.items())
                     if not self.is_stranger(node)), (Clock.ARRIVAL, 0.0))

    def is_stranger(self, node: str) -> bool:
        """Return whether a node sends states that are not obeyed, as far as names are known."""
        return self.obeyed.startswith('/') and node in self.senders - {self.obeyed}

    @property
    def lockstep(self) -> bool:
        """Return whether time waits for the forces."""
        return self.clock is Clock.LOCKSTEP

    def learn(self, configuration: Configuration, senders: Collection[str] = ()) -> None:
        """
        Take over what a plant announces, while nodes send states.

        Raises TypeError or ValueError for a bad delay.
        """
        self.senders = frozenset(senders)
        if is_of_plant(configuration):
            said = (Clock.LOCKSTEP if configuration.parameters['lockstep'] else Clock.STAMPS,
                    float(configuration.parameters.get('delay', 0.0)))
            self.announced.pop(configuration.node, None)   # to be the newest
            self.announced[configuration.node] = said
            if len(self.announced) > PLANTS:
                del self.announced[next(iter(self.announced))]

    def measured(self, stamp: float, now: float, sent: float) -> Measured:
        """
        Return when a state was measured that came now [s] with a stamp [s].

        It was sent at a time [s] that is right but for a constant offset of the sender's clock.
        """
        if self.lockstep:
            return Measured(stamp, self.delay)
        relative = self.relative_age(stamp, now, sent)
        if self.clock is Clock.ARRIVAL:
            return relative
        apart = self.sendings.least(now, now - sent)
        if -AHEAD <= apart <= LONGEST_TRANSPORT:
            apart = 0.0   # one clock, or two that are kept together
        age = now - apart - stamp
        if -AHEAD <= age <= OLDEST:
            where = 'behind' if apart > 0 else 'ahead'
            return Measured(stamp + apart, max(age, 0.0), '' if apart == 0.0 else (
                f"the sender's clock is {abs(apart):.3g} s {where}, which is made up for but for "
                'the way here; synchronise the clocks'))
        age = now - stamp
        return relative._replace(complaint=(
            f'the stamp is {abs(age):.3g} s {"old" if age > 0 else "ahead"}; expected one of this '
            f"node's clock, at most {OLDEST:g} s old; set the parameter clock to arrival"))

    def relative_age(self, stamp: float, now: float, sent: float) -> Measured:
        """Return how much later a state came than the fastest of late, whatever its clock."""
        stands_still, self.stamp = stamp == self.stamp, stamp
        offset = now - (sent if stands_still else stamp)
        age = offset - self.stamps.least(now, offset)
        return Measured(now - age, age, 'the stamps stand still; the time of sending counts'
                        if stands_still else '')


class Setbacks:
    """How often a clock jumped back of late."""

    def __init__(self) -> None:
        """Begin with none."""
        self.times = deque[float](maxlen=MOST)   # [s] of a steady clock

    def complaint(self, now: float) -> str:
        """Return what is wrong with a clock that jumps back again and again; now [s] is steady."""
        while self.times and self.times[0] < now - LATELY:
            self.times.popleft()
        return '' if len(self.times) < AGAIN else (
            f'the clock jumped back {len(self.times)} times in {LATELY:g} s; expected a single '
            'publisher of /clock: ros2 topic info -v /clock names them')


class Latency:
    """
    How long after the arrival of a state its force acts: as long as nearly every tick needs.

    A plan begins where its force will act, and three links are dropped for a few milliseconds of
    error. So a force that is ready early waits: the logical execution time of Henzinger,
    Horowitz and Kirsch (Giotto, 2003).
    """

    def __init__(self, tick_time: float) -> None:
        """Take how long a tick has taken before the first [s]."""
        self.ticks = deque([tick_time], maxlen=TICKS)     # [s] from a state's arrival to its plan
        self.allotted = tick_time                            # [s] to this one
        self.reports = deque[float](maxlen=TICKS)         # [s] that a report took after a force
        self.transports = deque[float](maxlen=TICKS)      # [s] from a state's sender to here

    def add_transport(self, duration: float) -> None:
        """Remember how long a state was on its way [s], by two clocks that may differ."""
        if 0 < duration < LONGEST_TRANSPORT:
            self.transports.append(duration)

    def transport(self) -> float:
        """Return how long a force will be on its way [s]: as long as states are."""
        return median(self.transports) if self.transports else 0.0

    def left(self, period: float, waited: float) -> float:
        """
        Return the time that a tick may take [s], so that the next state need not wait.

        States come once in a period [s], and this one has waited for a time [s] already; a report
        will follow the force.
        """
        return BUSY * period - waited - (median(self.reports) if self.reports else 0.0)

    def expected(self, left: float) -> float:
        """
        Return the time from a state's arrival until its force acts [s].

        Where hardly more time is left until the next state comes, the tick is given less than
        nearly all need, but no less than half of them do.
        """
        longest = sorted(self.ticks)[max(len(self.ticks) - 1 - LONGER, 0)]
        self.allotted = min(longest, max(left - SLACK, median(self.ticks)))
        return self.allotted + self.transport()

    def remaining(self, taken: float, first: bool) -> float:
        """
        Return what is left of the time that the tick was given [s], after what it has taken [s].

        The first of a run solves from more starts than others, so it says nothing about them.
        """
        if not first:
            self.ticks.append(taken)
        return max(self.allotted - taken, 0.0)


class Watchdog:
    """Learns the period of the states, by the controller's clock, and how long to wait for one."""

    def __init__(self, period: float) -> None:
        """Take the period [s] until one is known."""
        self.first = period
        self.reset()

    def reset(self) -> None:
        """Forget the period."""
        self.periods: deque[float] = deque([self.first], maxlen=PERIODS)

    @property
    def period(self) -> float:
        """Return the period [s] as it is known."""
        return float(median(self.periods))

    def feed(self, period: float) -> float:
        """Take that the last state was a time [s] ago; return how long [s] the next may take."""
        if period > 0:
            self.periods.append(period)
        return self.period + max(PATIENCE * self.period, SPARE)
