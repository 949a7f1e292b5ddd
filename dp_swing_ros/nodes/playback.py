# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What of a bag is played, and when; needs no ROS."""

from collections import Counter
from collections.abc import Sequence, Set
from typing import NamedTuple

from dp_swing_ros.bags.mcap_reader import Entry
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.errors import BagError
from dp_swing_ros.messages.fields import BILLION
from dp_swing_ros.parameters.nodes import ReplayParameters, SENT

LATE = 5_000_000  # [ns] later than this a message is counted as late


class Scheduled(NamedTuple):
    """A message and when it is to be played."""

    time: int  # [ns] of the bag
    entry: Entry


def excerpt(bag: Bag, p: ReplayParameters, own: Set[str] = frozenset()) -> list[Scheduled]:
    """
    Return the messages of a bag that are to be played, as they were sent or as they were received.

    A logger that was kept waiting receives what was sent over a while all at once, so the time of
    sending is the closer to what the nodes saw; it is of each sender's own clock, though. What
    was sent before the recording began is played at its beginning. Topics that replay makes of its
    own are left out. Raises BagError if there is no such topic, or nothing to play.
    """
    if not bag.entries:
        raise BagError(f'{bag} holds no message; record a run with the logger')
    names = {'/' + name.lstrip('/') for name in p.topics if name}
    unknown = sorted(names - set(bag.topics))
    if unknown:
        raise BagError(f'{bag} has nothing on {", ".join(unknown)}; '
                       f'it holds messages of {", ".join(bag.topics)}')
    earliest = min(entry.received for entry in bag.entries)

    def time(entry: Entry) -> int:
        # some writers know no time of sending, and leave it zero
        as_sent = p.message_order == SENT and entry.sent
        return max(entry.sent, earliest) if as_sent else entry.received

    messages = sorted((Scheduled(time(entry), entry) for entry in bag.entries),
                      key=lambda scheduled: scheduled.time)
    first, last = messages[0].time, messages[-1].time
    begin = first + round(p.start_offset * BILLION)
    end = begin + round(p.playback_duration * BILLION) if p.playback_duration > 0 else last
    found = [message for message in messages
             if begin <= message.time <= end and message.entry.topic not in own
             and (not names or message.entry.topic in names)]
    if not found:
        raise BagError(f'{bag} lasts {(last - first) / BILLION:.3f} s and has '
                       f'nothing to play from {p.start_offset:g} s on; '
                       'give another start_offset or playback_duration')
    return found


class Playback:
    """
    The messages that are played one after the other, by a steady clock in nanoseconds.

    The time of the bag can stand still. It is reckoned from a fixed origin, so that however late a
    message is, the next is not.
    """

    def __init__(self, messages: Sequence[Scheduled], rate: float, loop: bool = False) -> None:
        """Stand still at first, then run at `rate` times real time; a loop begins again."""
        self.played = Counter[str]()           # messages by topic
        self.late = self.largest_lateness = 0  # messages; [ns]
        self._messages, self._rate, self._loop = messages, rate, loop
        self._number = 0                       # of the next message
        self._origin = messages[0].time
        self._began: int | None = None         # when it was at the origin; None: it stands still

    @property
    def done(self) -> bool:
        """Return whether all have been played."""
        return self._number == len(self._messages)

    def due(self) -> int | None:
        """Return when the next message is due; None if nothing is to come or it stands still."""
        if self.done or self._began is None:
            return None
        waits = self._messages[self._number].time - self._origin
        return self._began + round(waits / self._rate)

    def at(self, now: int) -> int:
        """Return the time of the bag, which does not pass a message that is yet to come."""
        following = self._messages[-1 if self.done else self._number]
        return min(self._time(now), following.time)

    def pause(self, now: int, paused: bool) -> None:
        """Let the time of the bag stand still, or go on from where it is."""
        self._origin, self._began = self._time(now), None if paused else now

    def take(self, now: int) -> Scheduled:
        """Return the next message, which is due, and count it."""
        due = self.due()
        if due is not None:
            self.late += now - due > LATE
            self.largest_lateness = max(self.largest_lateness, now - due)
        message = self._messages[self._number]
        self.played[message.entry.topic] += 1
        self._number += 1
        if self.done and self._loop:
            self._number = 0
            self._jump(now)
        return message

    def step(self, now: int) -> Scheduled:
        """Return the next message, due or not; it is the time of the message now."""
        self._jump(now)
        return self.take(now)

    def _time(self, now: int) -> int:
        passed = 0 if self._began is None else now - self._began
        return self._origin + round(passed * self._rate)

    def _jump(self, now: int) -> None:
        self._origin = self._messages[self._number].time
        if self._began is not None:
            self._began = now
