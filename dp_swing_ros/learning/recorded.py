# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Experience from recorded motion: its transitions, and the mean force on the cart in each."""

import numpy as np

from dp_swing_ros.control.adaptive_dynamics import TRANSITION
from dp_swing_ros.errors import UserError
from dp_swing_ros.identification.segments import is_usable, Motion, period_of
from dp_swing_ros.learning.experience import Experience
from dp_swing_ros.pendulum.drive import lagged
from dp_swing_ros.pendulum.parameters import DIRECT, Drive
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.pendulum.units import POSITIONS, SAME, Units

JUMP = 0.2          # [m, rad] scaled, off what the speeds say: a reset, not a motion


def stretches_of(t: Array, X: Array, sent: Array, commands: Array, track_limit: float,
                 drive: Drive = DIRECT, scale: Units = SAME) -> list[Experience]:
    """
    Return the stretches of what was measured and sent, by one clock [s], without pushes.

    Angles may jump by whole turns, and forces be in any order. Shapes: t (K,), X (K, 2n + 2), sent
    and commands (M,). Raises UserError as `stretches`.
    """
    order = np.argsort(sent, kind='stable')
    Q, V = np.hsplit(X, 2)
    Q[:, 1:] = np.unwrap(Q[:, 1:], axis=0)
    return stretches(Motion(t, Q, sent[order], commands[order], np.empty(0), track_limit), V,
                     drive, scale)


def stretches(motion: Motion, speeds: Array, drive: Drive,
              scale: Units = SAME) -> list[Experience]:
    """
    Return the stretches of a motion of which all is known, in each one transition after the other.

    Shapes: speeds (K, n + 1). Raises UserError where there is none.
    """
    period = period_of(motion.t)
    every = max(round(scale.sized(TRANSITION, 's') / period), 1)
    t, Q, V = (each[::every] for each in (motion.t, motion.Q, speeds))
    forces = mean_forces(drive, motion.sent, motion.commands, t)
    off = Q[:-1] + np.diff(t)[:, None] * (V[:-1] + V[1:]) / 2 - Q[1:]
    jump = JUMP * np.array(scale.factors(POSITIONS, Q.shape[1]))
    usable = [bool(np.all(np.abs(off[k]) < jump))    # nor where speeds are not known
              and is_usable(motion, t[k:k + 2], Q[k:k + 2], every * period, scale)
              for k in range(len(off))]
    edges = np.flatnonzero(np.diff(np.concatenate(([0], usable, [0]))))
    if len(edges) == 0:
        raise UserError(
            f'of {np.ptp(motion.t):.3g} s nothing can be used: no two states with positions and '
            'speeds, a command every 0.2 s, away from the ends of the track, without a push')
    X = np.hstack((Q, V))
    return [Experience.of_run(t[begin:end + 1], X[begin:end + 1], forces[begin:end])
            for begin, end in edges.reshape(-1, 2)]


def mean_forces(drive: Drive, sent: Array, commands: Array, t: Array) -> Array:
    """
    Return the mean force on the cart between each two times [N]; before any command it is zero.

    Shapes: sent [s] and commands [N] (M,), t (K + 1,) [s] -> (K,).
    """
    acts = sent + drive.delay
    events = np.union1d(acts, t)
    impulse, f = np.zeros(len(events)), 0.0
    for i, before in enumerate(np.searchsorted(acts, events[:-1], 'right') - 1):
        duration = events[i + 1] - events[i]
        f, mean = lagged(f, commands[before] if before >= 0 else 0.0, drive.time_constant,
                         duration)
        impulse[i + 1] = impulse[i] + mean * duration
    means: Array = np.diff(impulse[np.searchsorted(events, t)]) / np.diff(t)
    return drive.gain * means + drive.bias
