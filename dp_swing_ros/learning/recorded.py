# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Experience from recorded motion: its transitions, and the mean force on the cart in each."""

import numpy as np

from dp_swing_ros.bags.episodes import reports_of
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.errors import UserError
from dp_swing_ros.identification.recorded import Recorded
from dp_swing_ros.identification.segments import is_usable
from dp_swing_ros.learning.experience import Experience
from dp_swing_ros.pendulum.drive import lagged
from dp_swing_ros.pendulum.parameters import Drive
from dp_swing_ros.pendulum.state import Array

TRANSITION = 0.05   # [s] about; of states that come faster some are left out
JUMP = 0.2          # [m, rad] off what the speeds say: a reset, not a motion


def stretches(found: Recorded) -> list[Experience]:
    """
    Return the stretches of a motion of which all is known, in each one transition after the other.

    Raises UserError where there is none.
    """
    motion = found.motion
    period = float(np.median(np.diff(motion.t)))
    every = max(round(TRANSITION / period), 1)
    t, Q, V = (each[::every] for each in (motion.t, motion.Q, found.V))
    forces = mean_forces(found.drive, motion.sent, motion.commands, t)
    off = Q[:-1] + np.diff(t)[:, None] * (V[:-1] + V[1:]) / 2 - Q[1:]
    usable = [bool(np.all(np.abs(off[k]) < JUMP))    # nor where speeds are not known
              and is_usable(motion, t[k:k + 2], Q[k:k + 2], every * period)
              for k in range(len(off))]
    edges = np.flatnonzero(np.diff(np.concatenate(([0], usable, [0]))))
    if len(edges) == 0:
        raise UserError(
            f'of {np.ptp(motion.t):.3g} s nothing can be used: no two states with positions and '
            'speeds, a command every 0.2 s, away from the ends of the track, without a push')
    X = np.hstack((Q, V))
    return [Experience.of_run(t[begin:end + 1], X[begin:end + 1], forces[begin:end])
            for begin, end in edges.reshape(-1, 2)]


def believed_drive(bag: Bag, nominal: Drive) -> Drive:
    """
    Return delay and lag of the drive as the recorded mpc had them in the end.

    It has no other gain and no bias: dynamics that are learned make up for these.
    """
    for report in reversed(reports_of(bag)):
        if 'motor_time_constant' in report.values:
            return Drive(float(report.values['actuation_delay']),
                         float(report.values['motor_time_constant']))
    return Drive(nominal.delay, nominal.time_constant)


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
