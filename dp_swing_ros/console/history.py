# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The last minute of a run, as it was heard: to look back, and to begin a bag in mid-run."""

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
import math
from pathlib import Path
import re
from typing import Any, NamedTuple

from dp_swing_ros.bags.metadata import Recorded
from dp_swing_ros.bags.writer import BagWriter
from dp_swing_ros.console.scene import is_figure, keep, Kept, LASTS, number, numbers, Scene
from dp_swing_ros.messages.definitions import schema
from dp_swing_ros.topics import (
    COMMAND_TOPICS, CONFIGURATION, DIAGNOSTICS, DISTURBANCE, JOINT_STATES, PLAN, ROBOT_DESCRIPTION,
    Topic, TRIES)

SPAN = 60.0       # [s] of the run
SIZE = 64 << 20   # [bytes] of messages for branches, and of those that are only seen
ROWS = 3000       # states of an answer, at most
NEAREST = 0.9 * SPAN / ROWS   # [s] between two rows of a live run
EARLY = 1e-6      # [s] by which a time in JSON may be early
KEPT = (JOINT_STATES, DIAGNOSTICS, DISTURBANCE, CONFIGURATION, ROBOT_DESCRIPTION)   # for branches
SEEN = (PLAN, TRIES, *COMMAND_TOPICS)   # beside these, to look back
NEWEST = 12       # of these that an instant needs: two plans, two clouds, forces between them
PLOTTED = re.compile('cost.*|.*_time|latency|iterations')   # values of a tick
MOST = 60         # of them


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
    push: float | None
    figures: dict[str, Any]   # that the plots show of its tick


class Ring:
    """Messages in the order in which they came, of a minute and SIZE at most."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self.entries = deque[Entry]()
        self._size = 0   # [bytes]

    def keep(self, entry: Entry) -> list[Entry]:
        """Keep a message; return those that it leaves no room for."""
        self.entries.append(entry)
        self._size += len(entry.data)
        dropped = list[Entry]()
        while self._size > SIZE or self.entries[0].t < entry.t - SPAN:
            dropped.append(self.entries.popleft())
            self._size -= len(dropped[-1].data)
        return dropped

    def clear(self) -> list[Entry]:
        """Forget all messages; return them."""
        dropped = list(self.entries)
        self.entries.clear()
        self._size = 0
        return dropped


class History:
    """Messages of the last minute, and of latched topics what was said before it."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self.rows = deque[Row](maxlen=ROWS)
        self._needed, self._seen = Ring(), Ring()   # KEPT and SEEN
        self._standing: dict[str, Entry] = {}   # which are older

    def keep(self, entry: Entry) -> None:
        """Keep a message of KEPT or SEEN, and no more than a minute of them."""
        ring = self._seen if entry.topic in SEEN else self._needed
        self._let_stand(ring.keep(entry))

    def _let_stand(self, dropped: Iterable[Entry]) -> None:
        for entry in dropped:
            if entry.whose:
                keep(self._standing, f'{entry.topic.name} {entry.whose}', entry)

    def keep_state(self, scene: Scene) -> None:
        """Keep the newest state; where time goes back, another run has begun."""
        if self.rows and scene.t < self.rows[-1].t:
            self.begin()
        if self.rows and scene.t - self.rows[-1].t < NEAREST:
            return
        self.rows.append(row_of(scene))
        while self.rows[0].t < scene.t - SPAN:
            self.rows.popleft()

    def keep_answer(self, scene: Scene) -> None:
        """Keep the tick that answers the newest state."""
        if self.rows and self.rows[-1].t == scene.t:
            self.rows[-1] = row_of(scene)

    def begin(self) -> None:
        """Forget a run, but not who ran it."""
        self.rows.clear()
        self._let_stand(self._needed.clear())
        self._seen.clear()

    def entries(self) -> list[Entry]:
        """Return all messages for a branch, in the order in which they came."""
        return [*self._standing.values(), *self._needed.entries]

    def until(self, t: float) -> list[Entry]:
        """Return what was heard before the state after a time [s], as far as it counts then."""
        def counts(entry: Entry) -> bool:
            return entry.t <= t + EARLY and (bool(entry.whose) or entry.t > t - LASTS / 1e9)

        seen = [*filter(counts, self._seen.entries)][-NEWEST:]
        needed = filter(counts, self._needed.entries)
        # what stands is older, whatever the time of the run that it is of
        return sorted([*self._standing.values(), *needed, *seen],
                      key=lambda entry: entry.received)


def scene_of(entries: Iterable[Entry], joint_states: str,
             decoded: Callable[[Entry], Any]) -> Scene:
    """Return the newest of everything that messages say."""
    scene = Scene(joint_states)
    for entry in entries:
        with suppress(RuntimeError, ValueError):   # it was told when it came
            scene.hear(entry.topic, decoded(entry))
    return scene


def row_of(scene: Scene) -> Row:
    """Return the newest state of a scene, and what the plots show of its tick."""
    assert scene.x is not None
    tick = scene.tick
    figures = [(name, value) for name, value in (tick.values.items() if tick else ())
               if PLOTTED.fullmatch(name) and is_figure(value)]
    force = tick.values.get('force', scene.force) if tick else scene.force
    return Row(scene.t, numbers(scene.x), number(scene.u),
               number(force) if is_figure(force) else None, number(scene.push),
               dict(figures[:MOST]))


def answer(rows: Iterable[Row]) -> dict[str, Any]:
    """Return states of the past for the page, thinned to ROWS, by columns."""
    found = thinned(list(rows))
    return {'kind': 'history', 't': [row.t for row in found], 'x': [row.x for row in found],
            'u': [row.u for row in found], 'force': [row.force for row in found],
            'push': [row.push for row in found],
            'figures': columns([row.figures for row in found])}


def thinned(found: list[Kept]) -> list[Kept]:
    """Return ROWS of a list at most."""
    return found[::max(math.ceil(len(found) / ROWS), 1)]


def columns(rows: Sequence[dict[str, Any]]) -> dict[str, list[Any]]:
    """Return the values of rows by their names; None where a row has none."""
    names = sorted({name for row in rows for name in row})[:MOST]
    return {name: [number(row.get(name, math.nan)) for row in rows] for name in names}


def write(entries: Sequence[Entry], folder: Path, names: dict[str, str]) -> None:
    """Write messages to a bag, under the full names of their topics; raises BagError."""
    bag = BagWriter(folder)
    for topic in KEPT:
        bag.add(Recorded(names[topic.name], topic.type, schema(topic.type), '', []))
    for n, entry in enumerate(entries, start=1):
        bag.write(names[entry.topic.name], entry.data, entry.received, entry.sent, n)
    bag.close()
