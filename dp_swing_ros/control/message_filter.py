# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Which measured states cannot be: those that are out of reach, and those that stand still.

A sensor that dies goes on publishing more often than not, with fresh stamps. What it repeats to
the bit is accepted only where the model, under the forces sent, would not have moved either, or
less than an encoder sees.

Velocities that are only the differences of positions say nothing new, and lag: they count as not
measured.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
import math

import numpy as np

from dp_swing_ros.pendulum.state import Array, joints, to_turn_of, units
from dp_swing_ros.pendulum.units import POSITIONS, SAME, scaled_speeds, Units

LARGEST_TURNS = 1000      # of a joint; no swing-up winds up so far
LARGEST_SPEED = 100.0     # [m/s, rad/s] scaled; falling from upright to hanging makes some 12
TRACKS = 2.0              # a cart this many track limits from the centre is not on the track
STILL = 1e-9              # [m, rad] that the model moves by where the whole state may stand still
STUCK = 0.02              # [m, rad] scaled, the same of one position
COUNTS = 10               # of an encoder, by which it may do so, too
COARSEST = 0.005          # [m, rad] scaled, a count; the smallest step seen, if larger, is none
# So many states one position must have been the same in: where a plant steps by forward Euler, or
# a force comes a period late, none moves in the first period from rest.
ALONE = 3
EQUAL = 1e-4              # share by which differences may be off
APART = 0.5               # share by which the time between two stamps may be off
WINDOW = 0.5              # [s] scaled, for which the model is asked

Predict = Callable[[Array, float, float], Array]


@dataclass
class Past:
    """A state: when [s], as it was measured, and with what was not as estimated (2n + 2,)."""

    t: float
    x: Array
    whole: Array


class MessageFilter:
    """Rejects states out of range, and frozen ones; remembers the last states."""

    def __init__(self, links: int, track_limit: float, scale: Units = SAME) -> None:
        """Take the number of links, the end of the track [m], infinite for none, and the scale."""
        angle = LARGEST_TURNS * 2 * math.pi
        self.window = scale.sized(WINDOW, 's')
        self.stuck, self.coarsest = (np.array(scale.each_joint(each, POSITIONS, links))
                                     for each in (STUCK, COARSEST))
        self.joints, self.units = joints(links), units(links)
        self.range = np.array([TRACKS * track_limit, *[angle] * links,
                               *scaled_speeds(LARGEST_SPEED, scale, links)])
        self.past: deque[Past] = deque()
        self.reset()

    def reset(self) -> None:
        """Forget the states before."""
        self.past.clear()
        self.counts = np.full(len(self.joints), math.inf)   # smallest steps of the positions

    def rejection(self, t: float, x: Array, *predictions: Predict) -> str:
        """
        Return why a state measured at a time [s] cannot be; nothing where it can.

        Each prediction(x, t, until) is the state at a later time under the forces sent; a state
        can be if it can by one of them. Shapes: x (2n + 2,).
        """
        beyond = np.flatnonzero(np.abs(x) > self.range)
        if len(beyond) > 0:
            i = int(beyond[0])
            kind = 'position' if i < len(self.joints) else 'velocity'
            joint, unit = self.joints[i % len(self.joints)], self.units[i]
            return (f'the {kind} of {joint} is {x[i]:g} {unit}; expected at most '
                    f'{self.range[i]:g} {unit} either way')
        while self.past and self.past[0].t < t - self.window:
            self.past.popleft()
        if self.past:
            steps = np.abs(x - self.past[-1].x)[:len(self.joints)]
            self.counts = np.where(steps > 0, np.fmin(steps, self.counts), self.counts)
        self.past.append(Past(t, x, np.where(np.isnan(x), 0.0, x)))
        return self.frozen(predictions)

    def accept(self, measured: Array, estimated: Array) -> None:
        """Take the estimate of the last state where it is not measured (NaN)."""
        self.past[-1].whole = np.where(np.isnan(measured), estimated, measured)

    def with_velocities_measured(self, x: Array) -> Array:
        """Return the last state, x on another turn, without velocities that are differences."""
        if len(self.past) < 2:
            return x
        before, last, half = self.past[-2], self.past[-1], len(self.joints)
        steps, v = (to_turn_of(last.x, before.x) - before.x)[:half], last.x[half:]
        along = steps @ v
        if not along > 0:   # nor where they are not measured at all
            return x
        # over which time they were taken, their driver knows better than the stamps
        duration = steps @ steps / along
        if (abs(duration / (last.t - before.t) - 1) > APART
                or np.abs(v - steps / duration).max() > EQUAL * np.abs(v).max()):
            return x
        return np.concatenate((x[:half], np.full(half, np.nan)))

    def frozen(self, predictions: Sequence[Predict]) -> str:
        """Return what has not moved though the model did; nothing where all moves."""
        positions, last = len(self.joints), self.past[-1]
        if len(self.past) < 2 or not (self.past[-2].x == last.x)[:positions].any():
            return ''
        measured = np.array([past.x for past in self.past])         # (count, 2n + 2)
        same = (measured == last.x) | np.isnan(measured)
        moving = bool(np.nan_to_num(last.x[positions:]).any())
        limits = self.stuck + COUNTS * np.where(self.counts < self.coarsest, self.counts, 0.0)
        for count, least, columns, limit in (
                (_repeated(np.asarray(same.all(axis=1))), 2, range(positions),
                 STILL if moving else limits.min()),
                *((_repeated(same[:, i]), ALONE, [i], limits[i]) for i in range(positions))):
            if count < least:
                continue
            since = self.past[-count]
            # since the last one, too: what swings to and fro comes by the same place
            starts = (since,) if count == 2 else (since, self.past[-2])
            if all(any(np.abs(predict(start.whole, start.t, last.t) - start.whole)[columns].max()
                       > limit for start in starts) for predict in predictions):
                what = self.joints[columns[0]] if len(columns) == 1 else 'whole state'
                return (f'the {what} has stood still to the bit for {last.t - since.t:.2f} s; '
                        'expected it to move under the forces sent')
        return ''


def _repeated(same: Array) -> int:
    """Return for how many of the last states one holds, the last included; same (n,) bool."""
    differs = np.flatnonzero(~same)
    return len(same) - 1 - int(differs[-1]) if len(differs) > 0 else len(same)
