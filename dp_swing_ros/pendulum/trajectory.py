# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whole trajectories of a model in one call."""

import math
from typing import Any

import numpy as np

from dp_swing_ros.kernels import kernel
from dp_swing_ros.pendulum.model import advance
from dp_swing_ros.pendulum.state import Array

ROUNDING = 1e-9  # a time [s], or a share of a step, that is none


@kernel
def step(model, x, u, out):
    """
    Write the next state x⁺ = f(x, u).

    Shapes: x and out (6,), which may be the same array; u is the force [N].
    """
    out[0], out[1], out[2], out[3], out[4], out[5] = advance(
        model, x[0], x[1], x[2], x[3], x[4], x[5], u)


@kernel
def rollout(model, x_0, U):
    """
    Return the states under the forces U.

    Shapes: x_0 (6,), U (T,) -> (T + 1, 6).
    """
    X = np.empty((len(U) + 1, 6))
    for i in range(6):
        X[0, i] = x_0[i]
    for t in range(len(U)):
        step(model, X[t], U[t], X[t + 1])
    return X


def steps_in(duration: float, longest: float) -> int:
    """Return how many steps of a length at most [s] make a time [s]; what is rounding has none."""
    return math.ceil(duration / longest - ROUNDING)


def hold(model: Any, x: Array, u: float, duration: float) -> Array:
    """
    Return the state after any duration [s] under a held force, in steps of at most the model's.

    Shapes: x (6,) -> (6,).
    """
    steps = steps_in(duration, model.h)
    if steps < 1:
        return x
    resized = type(model).of(model.pendulum, duration / steps)
    return rollout(resized, x, np.full(steps, u))[-1]
