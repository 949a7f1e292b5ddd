# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Random numbers: one seed, and from it independent streams, one for each purpose.

Plant and controller usually have the same seed. Streams of different purposes are independent all
the same (NumPy's SeedSequence), so no controller ever draws the noise of its sensors. The starts
and pushes of scenarios come from streams of their own, which have no such key (scenarios.py).
"""

import enum

import numpy as np


class Stream(enum.IntEnum):
    """What random numbers are for; a number that was given once is never given again."""

    SENSOR_NOISE = 0
    FORCE_NOISE = 1
    STATE_LOSS = 2
    COMMAND_LOSS = 3
    COMMAND_JITTER = 4
    STARTS = 5      # random forces to solve from
    SOLVER = 6      # the samples of a solver
    # 7 to 9 are of benchmarks/faults.py


def stream(seed: int, purpose: int) -> np.random.Generator:
    """Return the generator of a seed for a purpose, from its beginning."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(int(purpose),)))
