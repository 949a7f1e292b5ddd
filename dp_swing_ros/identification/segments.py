# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Motion as it was recorded, and the segments of it that say something about the pendulum."""

import math
from typing import NamedTuple

import numpy as np

from dp_swing_ros.errors import UserError
from dp_swing_ros.pendulum.drive import HISTORY
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.pendulum.units import SAME, Units

DURATION = 0.5        # [s] scaled, of a segment; beyond it chaos makes most of what is missed
FEWEST = 8            # samples in one, of which the first gives the state it begins with
BEGINNING = 0.15      # [s] scaled, whose motion gives the speeds at the beginning
END = 0.05            # [m] scaled, from the end of the track
SILENCE = 0.21        # [s] without a command, after which a drive may have let go
LOST = 3              # periods without a sample: beyond, a turn may have been missed
PERIODS = 1e-4, 1.0   # [s] between samples that a motion may have, about
LONGEST = 1e5         # [s] of a motion
LARGEST = 1e6         # [m, rad, m/s, rad/s, N] that anything in it may be
SWING = 0.3           # [rad] that the links must go at least, all in all
ROUNDED = 1e-9        # of all that is gone: two positions nearer to each other are one
OFF_GRID = 0.05       # of a step that the positions of an encoder may be off by


class Motion(NamedTuple):
    """
    What was measured, and what was commanded meanwhile, by one clock [s].

    Shapes: t (K,), Q (K, n + 1) positions of cart [m] and links [rad], without jumps at whole
    turns; sent and commands (M,) [N], in order; pushes (L,), when a force beside it began to act.
    """

    t: Array
    Q: Array
    sent: Array
    commands: Array
    pushes: Array
    track_limit: float   # [m]


def resolution(q: Array) -> float:
    """Return the steps of the encoder that positions (K,) come from; NaN where there are none."""
    values = np.unique(q)
    steps = np.diff(values)
    steps = steps[steps > ROUNDED * np.ptp(q)]
    if len(steps) < FEWEST:
        return math.nan
    counts = (values - values[0]) / steps.min()
    is_grid = np.abs(counts - np.rint(counts)).max() < OFF_GRID
    return float(steps.min()) if is_grid else math.nan


class Segments(NamedTuple):
    """
    Stretches of a motion, each of as many samples.

    The commands with the indices `first` to `last`, the last left out, are those that may act
    between a sample and the next; the first of all is what came before any, zero. Shapes: t, first
    and last (S, K), Q (S, K, n + 1), X_0 (S, 2n + 2) the states that they begin with, about;
    sent and commands (M + 1,).
    """

    t: Array
    Q: Array
    X_0: Array
    first: Array
    last: Array
    sent: Array
    commands: Array

    def chosen(self, which: Array) -> 'Segments':
        """Return some of the segments; shapes: which (S,)."""
        return self._replace(**{name: getattr(self, name)[which]
                                for name in ('t', 'Q', 'X_0', 'first', 'last')})


def segments_of(motion: Motion, scale: Units) -> Segments:
    """
    Cut a motion where nothing but pendulum and drive decide it; raises UserError for too little.

    No two segments share a sample: the noise of one would count twice.
    """
    period = period_of(motion.t)
    size = max(round(scale.sized(DURATION, 's') / period), FEWEST)
    count = len(motion.t) // size
    t = motion.t[:count * size].reshape(count, size)
    Q = motion.Q[:count * size].reshape(count, size, motion.Q.shape[1])
    usable = np.array([is_usable(motion, *each, period, scale) for each in zip(t, Q)], dtype=bool)
    check(motion, Q[usable], size * period)
    t, Q = t[usable], Q[usable]
    sent = np.concatenate(([-np.inf], motion.sent))
    commands = np.concatenate(([0.0], motion.commands))
    after = np.concatenate((t[:, 1:], t[:, -1:]), axis=1)
    return Segments(t, Q, np.array([beginning(*each, scale) for each in zip(t, Q)]),
                    np.searchsorted(sent, t - HISTORY, 'right') - 1,
                    np.searchsorted(sent, after), sent, commands)


def period_of(t: Array) -> float:
    """Return the period of samples at times in order [s]; raises UserError as `check_span`."""
    check_span(t)
    period, (shortest, longest) = float(np.median(np.diff(t))), PERIODS
    if not shortest <= period <= longest or np.any(np.diff(t) < 0):
        raise UserError(f'there are {period:.3g} s between states; expected {shortest:g} to '
                        f'{longest:g} s, one after the other: check their stamps')
    return period


def check_span(t: Array) -> None:
    """Raise UserError where times [s] are not those of one recording."""
    if not 0 < np.ptp(t) <= LONGEST:
        raise UserError(f'there are {len(t)} states over {np.ptp(t):.3g} s; expected a recording '
                        f'of at most {LONGEST:g} s: check their stamps and the times of the bag')


def check_sizes(*arrays: Array) -> None:
    """Raise UserError where anything that was measured or commanded is none of a pendulum."""
    largest = max(np.max(np.abs(each), initial=0.0, where=~np.isnan(each)) for each in arrays)
    if largest > LARGEST:
        raise UserError(f'there is a position, speed or force of {largest:.3g}; expected at most '
                        f'{LARGEST:g} m, rad, m/s, rad/s or N')


def is_usable(motion: Motion, t: Array, Q: Array, period: float, scale: Units = SAME) -> bool:
    """Return whether positions are known, and all forces that act; shapes: t (K,), Q (K, n+1)."""
    start, ends = t[0] - SILENCE, t[-1]
    sent = motion.sent[(motion.sent > start) & (motion.sent < ends)]
    first = motion.sent.min(initial=np.inf)   # before it there is no force
    waits = np.diff(np.concatenate(([max(start, first)], sent, [ends])))
    silent = ends > first and waits.max() > SILENCE
    pushed = np.any((motion.pushes > start) & (motion.pushes < ends))
    return bool(np.all(np.isfinite(Q)) and np.max(np.diff(t)) < LOST * period and not silent
                and not pushed
                and np.max(np.abs(Q[:, 0])) < motion.track_limit - scale.sized(END, 'm'))


def check(motion: Motion, Q: Array, duration: float) -> None:
    """Raise UserError where segments of a time [s] with Q (S, K, n + 1) say too little."""
    if len(Q) == 0:
        raise UserError(
            f'of {np.ptp(motion.t):.3g} s nothing can be used: no {duration:.2g} s with all '
            'positions, a command every 0.2 s, away from the ends of the track, without a push; '
            'record half a minute under control')
    swing = np.ptp(Q[..., 1:], axis=(0, 1)).min()
    if swing < SWING:
        raise UserError(f'it moves too little: a link goes {swing:.2g} rad in all; swing it, by '
                        'hand or by the mpc')


def beginning(t: Array, Q: Array, scale: Units) -> Array:
    """Return about the state of the first sample; shapes: t (K,), Q (K, n + 1) -> (2n + 2,)."""
    count = max(int(np.sum(t < t[0] + scale.sized(BEGINNING, 's'))), 3)
    _, speeds, positions = np.polyfit(t[:count] - t[0], Q[:count], 2)
    return np.concatenate((positions, speeds))
