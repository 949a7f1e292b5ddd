# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What of a bag is played, and when; needs no ROS."""

from collections import Counter
from collections.abc import Iterable, Sequence

from dp_swing_ros.bags.fields import BILLION
from dp_swing_ros.bags.reader import Bag, Entry
from dp_swing_ros.errors import BagError

LATE = 5_000_000  # [ns] later than this a message is counted as late


def excerpt(bag: Bag, topics: Iterable[str] = (), start_offset: float = 0.0,
            duration: float = 0.0) -> list[Entry]:
    """
    Return the messages on some topics (none: all) in the order in which they were received.

    Those from start_offset [s] after the bag's first message on, over a duration [s] of the bag
    (0 or less: to its end). Raises BagError if there is no such topic or nothing is left.
    """
    names = {'/' + name.lstrip('/') for name in topics}
    unknown = sorted(names - set(bag.topics))
    if unknown:
        raise BagError(f'{bag} has nothing on {", ".join(unknown)}; '
                       f'it holds messages of {", ".join(bag.topics) or "no topic"}')
    if not bag.entries:
        raise BagError(f'{bag} holds no message; record a run with the logger')
    times = [entry.received for entry in bag.entries]
    begin = min(times) + round(start_offset * BILLION)
    end = begin + round(duration * BILLION) if duration > 0 else max(times)
    found = sorted((entry for entry in bag.entries if begin <= entry.received <= end
                    and (not names or entry.topic in names)), key=lambda entry: entry.received)
    if not found:
        span = (max(times) - min(times)) / BILLION
        raise BagError(f'{bag} lasts {span:.3f} s and has nothing to play from {start_offset:g} s '
                       'on; give another start_offset or playback_duration')
    return found


class Timeline:
    """
    The time of a bag as a function of a steady clock, both in nanoseconds; it can stand still.

    It is reckoned from a fixed origin, so that however late a message is, the next is not.
    """

    def __init__(self, start: int, rate: float) -> None:
        """Stand still at a time of the bag [ns]; later it runs at this many times real time."""
        self.rate = rate
        self._start = start
        self._began: int | None = None  # when the clock was at `start`; None: it stands still

    def at(self, now: int) -> int:
        """Return the time of the bag."""
        if self._began is None:
            return self._start
        return self._start + round((now - self._began) * self.rate)

    def due(self, time: int) -> int | None:
        """Return when a time of the bag comes; None while it stands still."""
        if self._began is None:
            return None
        return self._began + round((time - self._start) / self.rate)

    def run(self, now: int) -> None:
        """Go on from where it stands."""
        if self._began is None:
            self._began = now

    def stand(self, now: int) -> None:
        """Stand still at the time that it is."""
        self._start, self._began = self.at(now), None

    def jump(self, time: int, now: int) -> None:
        """Be at another time of the bag now, and go on or stand as before."""
        self._start = time
        if self._began is not None:
            self._began = now


class Playback:
    """The messages that are played, one after the other, by the clock of a timeline."""

    def __init__(self, entries: Sequence[Entry], rate: float, loop: bool = False) -> None:
        """Stand before the first message; in a loop, it comes again after the last."""
        self.timeline = Timeline(entries[0].received, rate)
        self.played = Counter[str]()           # messages by topic
        self.late = self.largest_lateness = 0  # messages; [ns]
        self._entries, self._loop = entries, loop
        self._number = 0                       # of the next message

    @property
    def done(self) -> bool:
        """Tell whether all have been played."""
        return self._number == len(self._entries)

    def due(self) -> int | None:
        """Return when the next message is due; None if nothing is to come or it stands still."""
        return None if self.done else self.timeline.due(self._entries[self._number].received)

    def at(self, now: int) -> int:
        """Return the time of the bag, which does not pass a message that is yet to come."""
        last = self._entries[-1] if self.done else self._entries[self._number]
        return min(self.timeline.at(now), last.received)

    def take(self, now: int) -> Entry:
        """Return the next message, which is due, and count it."""
        due = self.due()
        if due is not None:
            self.late += now - due > LATE
            self.largest_lateness = max(self.largest_lateness, now - due)
        entry = self._entries[self._number]
        self.played[entry.topic] += 1
        self._number += 1
        if self.done and self._loop:
            self._number = 0
            self.timeline.jump(self._entries[0].received, now)
        return entry

    def step(self, now: int) -> Entry:
        """Return the next message, due or not; it is the time of the message now."""
        self.timeline.jump(self._entries[self._number].received, now)
        return self.take(now)
