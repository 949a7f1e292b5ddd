# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The last minute of a run, as it was heard: to look back, and to begin a bag in mid-run."""

from collections import deque
from collections.abc import Iterable, Sequence
import math
from pathlib import Path
from typing import Any, NamedTuple

from dp_swing_ros.bags.metadata import Recorded
from dp_swing_ros.bags.writer import BagWriter
from dp_swing_ros.console.scene import keep, number, numbers, Scene
from dp_swing_ros.messages.definitions import schema
from dp_swing_ros.topics import (
    CONFIGURATION, DIAGNOSTICS, DISTURBANCE, JOINT_STATES, ROBOT_DESCRIPTION, Topic)

SPAN = 60.0       # [s] of the run
SIZE = 64 << 20   # [bytes] of messages
ROWS = 3000       # states of an answer, at most
KEPT = (JOINT_STATES, DIAGNOSTICS, DISTURBANCE, CONFIGURATION, ROBOT_DESCRIPTION)   # for branches


class Entry(NamedTuple):
    """A message as it came."""

    t: float        # [s] of the newest state then
    topic: Topic
    whose: str      # of a latched topic, whose last message counts on
    data: bytes
    received: int   # [ns]
    sent: int       # [ns]


class Row(NamedTuple):
    """A state of the past."""

    t: float
    x: list[float]
    u: float | None
    force: float | None


class History:
    """Messages of the last minute, and of latched topics what was said before it."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self.rows = deque[Row]()
        self._entries = deque[Entry]()
        self._standing: dict[str, Entry] = {}   # which are older
        self._size = 0   # [bytes]

    def keep(self, entry: Entry) -> None:
        """Keep a message, and no more than a minute of them."""
        self._entries.append(entry)
        self._size += len(entry.data)
        while self._size > SIZE or self._entries[0].t < entry.t - SPAN:
            self._drop()

    def _drop(self) -> None:
        entry = self._entries.popleft()
        self._size -= len(entry.data)
        if entry.whose:
            keep(self._standing, f'{entry.topic.name} {entry.whose}', entry)

    def keep_state(self, scene: Scene) -> None:
        """Keep the newest state; where time goes back, another run has begun."""
        if self.rows and scene.t < self.rows[-1].t:
            self.rows.clear()
            self.forget()
        self.rows.append(row_of(scene))
        while self.rows[0].t < scene.t - SPAN:
            self.rows.popleft()

    def forget(self) -> None:
        """Forget the messages of a run, but not who ran it."""
        while self._entries:
            self._drop()

    def entries(self) -> list[Entry]:
        """Return all messages that are kept, in the order in which they came."""
        return [*self._standing.values(), *self._entries]


def row_of(scene: Scene) -> Row:
    """Return the newest state of a scene."""
    assert scene.x is not None
    return Row(scene.t, numbers(scene.x), number(scene.u), number(scene.force))


def answer(rows: Iterable[Row]) -> dict[str, Any]:
    """Return states of the past for the page, thinned to ROWS."""
    found = list(rows)
    found = found[::max(math.ceil(len(found) / ROWS), 1)]
    return {'kind': 'history', 't': [row.t for row in found], 'x': [row.x for row in found],
            'u': [row.u for row in found], 'force': [row.force for row in found]}


def write(entries: Sequence[Entry], folder: Path, names: dict[str, str]) -> None:
    """Write messages to a bag, under the full names of their topics; raises BagError."""
    bag = BagWriter(folder)
    for topic in KEPT:
        bag.add(Recorded(names[topic.name], topic.type, schema(topic.type), '', []))
    for n, entry in enumerate(entries, start=1):
        bag.write(names[entry.topic.name], entry.data, entry.received, entry.sent, n)
    bag.close()
