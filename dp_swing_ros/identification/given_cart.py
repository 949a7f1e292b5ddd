# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A cart whose motion is given: clamped, or driven by whatever drives it.

Its acceleration is what moves the links then. A cart that is HEAVY beside them, under a force as
large, moves so whatever they do, to within their share of its mass: so all else stays as it is.
"""

import numpy as np
from scipy.interpolate import make_smoothing_spline

from dp_swing_ros.identification.segments import Motion

HEAVY = 1e6   # [kg] of a cart that no link moves
FEWEST = 5    # samples that a smoothing spline needs
PARTS = 4     # of the time between two, in which its acceleration is held


def on_cart_as_measured(motion: Motion) -> Motion:
    """Return a motion under the forces that move a heavy cart as it was measured, roughly."""
    middles = (motion.t[1:] + motion.t[:-1]) / 2
    with np.errstate(divide='ignore', invalid='ignore'):
        speeds = np.diff(motion.Q[:, 0]) / np.diff(motion.t)
        forces = HEAVY * np.diff(speeds) / np.diff(middles)
    return motion._replace(sent=middles[:-1], commands=np.where(np.isfinite(forces), forces, 0.0),
                           pushes=np.array([]))


def on_given_cart(motion: Motion, mass: float = HEAVY) -> Motion:
    """
    Return a motion under the forces that move a cart along a smooth path through its own.

    That is a heavy one of a mass [kg]; where links count as light, it is one of 1 kg.

    What noise the sensor of the cart has is told by how the spline leaves out one sample after
    the other best (generalised cross-validation). The cart then moves as these forces have it.
    """
    t, x = motion.t, motion.Q[:, 0]
    known = np.concatenate(([True], np.diff(t) > 0)) & np.isfinite(x)
    sent, speeds = t, np.zeros(len(t))
    if np.ptp(x[known]) > 0 and np.sum(known) >= FEWEST:
        parts = np.arange(len(t) * PARTS - PARTS + 1)
        sent = np.interp(parts, parts[::PARTS], t)
        speeds = make_smoothing_spline(t[known], x[known]).derivative()(sent)
    spans = np.diff(sent)
    accelerations = np.divide(np.diff(speeds), spans, where=spans > 0, out=np.zeros(len(spans)))
    path = np.concatenate(([0.0], np.cumsum(spans * (speeds[1:] + speeds[:-1]) / 2)))
    return motion._replace(
        Q=np.column_stack((x[known][0] + np.interp(t, sent, path), motion.Q[:, 1:])),
        sent=sent[:-1], commands=mass * accelerations, pushes=np.array([]), track_limit=np.inf)
