# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""When the state of a tick was measured, when its force is to act, and until when to solve."""

import math
from typing import Any, NamedTuple, Protocol

from dp_swing_ros.messages.fields import BILLION, nanoseconds
from dp_swing_ros.runtime.timing import Latency, Measured, Timing, Watchdog

SMOOTHING = 0.1        # share of the newest tick in the mean pace
PACES = (0.01, 100.0)  # slowest and fastest of a simulated clock, in seconds a second


class Clocks(Protocol):
    """The clocks of a controller."""

    @property
    def simulated(self) -> bool:
        """Return whether its own is a simulated one, which may go at any pace."""

    def now(self) -> int:
        """Return the time of its own clock [ns]."""

    def today(self) -> float:
        """Return the time of day [s], by which messages are sent and received."""

    def steady(self) -> float:
        """Return the time of a clock that is never set [s], that of time.perf_counter()."""

    def sleep(self, duration: float) -> None:
        """Let a time [s] of the steady clock pass."""


class Arrived(NamedTuple):
    """A JointState, and how it came."""

    message: Any
    publisher: bytes   # its GID
    number: int        # that its publisher gave it
    sent: int          # [ns] by the clock of its publisher
    received: int      # [ns] by the time of day


class Arrival(NamedTuple):
    """When a state came."""

    measured: Measured   # by the clock of the controller
    now: float           # [s] by the same
    steady: float        # [s]


class Slot(NamedTuple):
    """The time of a tick [s]."""

    t: float               # when its state was measured, by the clock of the controller
    age: float = 0.0       # of the state when it came
    delay: float = 0.0     # from the measurement until the force is to act
    began: float = 0.0     # by the steady clock
    deadline: float = math.inf   # by that, too
    period: float = 0.0    # from state to state
    again: int = 0         # forces sent again since the tick before


class Schedule:
    """
    The times of a controller's ticks.

    In lockstep there is no latency to make up for and no deadline, so that the result does not
    depend on the machine.
    """

    def __init__(self, clocks: Clocks, clock: str, period: float) -> None:
        """Take clocks, the parameter `clock`, and the period [s] of states until it is known."""
        self.clocks = clocks
        self.timing, self.watchdog = Timing(clock), Watchdog(period)
        self.tick_time = 0.0   # [s] that a tick has taken before the first
        self.again = 0         # forces sent again since the last tick
        self.reset()

    def reset(self) -> None:
        """Forget the states before."""
        self.timing.reset()
        self.watchdog.reset()
        self.latency = Latency(self.tick_time)
        self.pace = 1.0          # seconds of the controller's clock in a second
        self.missed_total = 0    # states that others overtook
        self.is_first = True     # the next plan is
        self.number = self.sent = 0   # of the last state, and when [ns]
        self.last: Arrival | None = None

    @property
    def lockstep(self) -> bool:
        """Return whether time waits for the forces."""
        return self.timing.lockstep

    def arrival(self, arrived: Arrived) -> Arrival:
        """Return when a state came that has just been taken."""
        now, steady = self.clocks.now() / BILLION, self.clocks.steady()
        sent = now - (self.clocks.today() - arrived.sent / BILLION) * self.pace
        stamp = nanoseconds(arrived.message.header.stamp) / BILLION
        return Arrival(self.timing.measured(stamp, now, sent), now, steady)

    def slot(self, arrived: Arrived, arrival: Arrival, time_limit: float) -> Slot:
        """Return the time of the tick for a state, whose solve has a limit [s]."""
        before, self.last = self.last, arrival
        # what the publisher sent in between was overwritten while a solve went on
        steps = max(arrived.number - self.number, 1)
        self.missed_total += steps - 1 if self.number else 0
        self.number, self.sent = arrived.number, arrived.sent
        (t, age, _), began = arrival.measured, arrival.steady
        period = (t - before.measured.t) / steps if before is not None else math.nan
        if self.lockstep:
            again, self.again = self.again, 0
            return Slot(t, age, age, began, period=period, again=again)
        if before is not None and self.clocks.simulated:
            self.pace = self.pace_since(before, arrival)
        self.latency.add_transport((arrived.received - arrived.sent) / BILLION)
        # it may have waited for the tick before; this one catches up
        left = self.latency.left(self.watchdog.period / self.pace,
                                 self.clocks.today() - arrived.received / BILLION)
        return Slot(t, age, age + self.latency.expected(left) * self.pace, began,
                    began + min(time_limit / self.pace, left), period)

    def ask_again(self, arrived: Arrived) -> None:
        """Take that the last state came again, and that its force is sent again."""
        self.number, self.sent = arrived.number, arrived.sent
        self.again += 1

    def silent_slot(self) -> Slot:
        """Return the time of a tick without a state."""
        return Slot(self.clocks.now() / BILLION, delay=self.latency.transport() * self.pace,
                    began=self.clocks.steady())

    def pace_since(self, before: Arrival, last: Arrival) -> float:
        """Return the pace of a simulated clock."""
        passed = last.steady - before.steady
        if passed <= 0:
            return self.pace
        pace = (last.now - before.now) / passed
        return self.pace + SMOOTHING * (min(max(pace, PACES[0]), PACES[1]) - self.pace)

    def wait(self, slot: Slot) -> None:
        """Let the time pass that remains of what a tick was given."""
        self.clocks.sleep(self.latency.remaining(self.clocks.steady() - slot.began, self.is_first))
        self.is_first = False

    def taken(self, slot: Slot) -> float:
        """Return how long a tick has taken so far [s], by the controller's clock."""
        return (self.clocks.steady() - slot.began) * self.pace
