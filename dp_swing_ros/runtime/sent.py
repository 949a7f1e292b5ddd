# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What a controller sends: forces, plans, reports, and lines for the log."""

from collections.abc import Callable, Mapping
import math
from typing import Any, NamedTuple

from dp_swing_ros.messages.fields import Report
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.plan import Plan


class Force(NamedTuple):
    """A command, and the stamp of the state that it answers."""

    stamp: int     # [ns]
    force: float   # [N]


class Planned(NamedTuple):
    """A plan for the state of a stamp [ns]."""

    stamp: int
    plan: Plan


class Tried(NamedTuple):
    """Where the tip goes in some tries of a solver: paths (M, N + 1, 2) [m], weights (M,)."""

    stamp: int   # [ns]
    paths: Array
    weights: Array


class Announcement(NamedTuple):
    """What it runs with in place of what was given, or found; that of a revision."""

    parameters: Mapping[str, Any]
    revision: int


class PutBack(NamedTuple):
    """That it goes on with these parameters: others turned out not to work."""

    parameters: Mapping[str, Any]


class Wake(NamedTuple):
    """That `on_silence` is to be called after a time [s] of its own clock; None: not any more."""

    after: float | None


class Said(NamedTuple):
    """A line for the log: of level OK, WARN or ERROR."""

    level: int
    text: str


Sent = Force | Planned | Tried | Report | Announcement | PutBack | Wake | Said


class Log:
    """Sends lines for the log, of those about one thing no more than one in a time."""

    def __init__(self, send: Callable[[Sent], None], steady: Callable[[], float]) -> None:
        """Take what sends, and what returns the time of a steady clock [s]."""
        self.send, self.steady = send, steady
        self.reset()

    def reset(self) -> None:
        """Say everything anew."""
        self.said = dict[str, float]()   # [s] when

    def say(self, level: int, text: str, about: str = '', every: float = 0.0) -> None:
        """Send a line, unless one about the same was sent less than a time [s] ago."""
        now = self.steady()
        if now - self.said.get(about, -math.inf) >= every:
            self.said[about] = now
            self.send(Said(level, text))
