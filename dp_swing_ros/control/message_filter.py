# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Which measured states cannot be: those that are out of reach, and those that stand still.

A sensor that dies goes on publishing more often than not, with fresh stamps. What it repeats to
the bit is believed only where the model, under the forces sent, would not have moved either.
"""

from collections import deque
from collections.abc import Callable
import math

import numpy as np

from dp_swing_ros.pendulum.state import Array, joints, units

LARGEST_TURNS = 1000      # of a joint; no swing-up winds up so far
LARGEST_SPEED = 100.0     # [m/s, rad/s]; falling from upright to hanging makes some 12 rad/s
TRACKS = 2.0              # a cart this many track limits from the centre is not on the track
STILL = 1e-9              # [m, rad] that the model moves by where the whole state may stand still
STUCK = 0.02              # [m, rad] the same of one position; a coarse encoder stands still, too
WINDOW = 0.5              # [s] for which the model is asked

Predict = Callable[[Array, float, float], Array]


class MessageFilter:
    """Rejects states out of range, and frozen ones; remembers the last half second of states."""

    def __init__(self, links: int, track_limit: float) -> None:
        """Take the number of links, and the end of the track [m], infinite for none."""
        angle = LARGEST_TURNS * 2 * math.pi
        self.joints, self.units = joints(links), units(links)
        self.range = np.array([TRACKS * track_limit, *[angle] * links,
                               *[LARGEST_SPEED] * (links + 1)])
        self.past: deque[tuple[float, Array]] = deque()

    def reset(self) -> None:
        """Forget the states before."""
        self.past.clear()

    def rejection(self, t: float, x: Array, predict: Predict) -> str:
        """
        Return why a state measured at a time [s] cannot be; nothing where it can.

        predict(x, t, until) is the state at a later time under the forces sent. Shapes: x
        (2n + 2,).
        """
        beyond = np.flatnonzero(np.abs(x) > self.range)
        if len(beyond) > 0:
            i = int(beyond[0])
            kind = 'position' if i < len(self.joints) else 'velocity'
            joint, unit = self.joints[i % len(self.joints)], self.units[i]
            return (f'the {kind} of {joint} is {x[i]:g} {unit}; expected at most '
                    f'{self.range[i]:g} {unit} either way')
        while self.past and self.past[0][0] < t - WINDOW:
            self.past.popleft()
        self.past.append((t, x))
        return self.frozen(x, predict)

    def frozen(self, x: Array, predict: Predict) -> str:
        """Return what has not moved though the model did; nothing where all moves."""
        positions = len(self.joints)
        if len(self.past) < 2 or not (self.past[-2][1] == x)[:positions].any():
            return ''
        same = np.array([past == x for _, past in self.past])   # (count, 2n + 2)
        for count, columns, limit in (
                (_repeated(np.asarray(same.all(axis=1))), range(positions), STILL),
                *((_repeated(same[:, i]), [i], STUCK) for i in range(positions))):
            if count == 1:
                continue
            (since, before), (t, _) = self.past[-count], self.past[-1]
            moved = np.abs(predict(before, since, t) - x)[columns]
            if moved.max() > limit:
                what = self.joints[columns[0]] if len(columns) == 1 else 'whole state'
                return (f'the {what} has stood still to the bit for {t - since:.2f} s; expected '
                        'it to move under the forces sent')
        return ''


def _repeated(same: Array) -> int:
    """Return for how many of the last states one holds, the last included; same (n,) bool."""
    differs = np.flatnonzero(~same)
    return len(same) - 1 - int(differs[-1]) if len(differs) > 0 else len(same)
