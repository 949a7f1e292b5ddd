# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Shooting: what model and drive make of each segment, from the state that it begins with.

All columns of a Jacobian are differences of whole motions, as in the Kalman filter.
"""

import numpy as np

from dp_swing_ros.estimators.unknowns import drive_of, model_of, turn
from dp_swing_ros.kernels import kernel
from dp_swing_ros.pendulum.drive import follow_commands

SMALL = 1e-5   # difference of a number of the state for derivatives


@kernel
def shoot(model, segments, X_0, V, out):
    """
    Write the positions (K, n + 1) that each segment has from each of C starts: out (S, C, K, n+1).

    The first begins at X_0 (S, 2n + 2) with the first of the values V; each of the next 2n + 2
    begins a difference further along one number of the state; the rest with the other values.
    Shapes: V (1 + m, 9n + 8), the values of Unknowns and its constants.
    """
    count, size = out.shape[0], X_0.shape[1]
    half = size // 2
    constants = V.shape[1] - half   # where they begin
    x, ends = np.empty(size), np.empty(len(segments.commands))
    for s in range(count):
        for c in range(out.shape[1]):
            row = max(c - size, 0)
            drive = drive_of(V[row, :constants])
            of_values = model_of(model, V[row, :constants], V[row, constants:])
            for i in range(size):
                x[i] = X_0[s, i]
            if 1 <= c <= size:
                x[c - 1] += SMALL
            turn(V[row, :constants], -1.0, x)
            for k in range(out.shape[2]):
                if k > 0:
                    start, until = segments.t[s, k - 1], segments.t[s, k]
                    first, last = segments.first[s, k - 1], segments.last[s, k - 1]
                    for j in range(first, last - 1):
                        ends[j - first] = segments.sent[j + 1] - start
                    ends[last - 1 - first] = np.inf
                    follow_commands(of_values, drive, ends[:last - first],
                                    segments.commands[first:last], x, until - start)
                turn(V[row, :constants], 1.0, x)
                for i in range(half):
                    out[s, c, k, i] = x[i]
                turn(V[row, :constants], -1.0, x)
