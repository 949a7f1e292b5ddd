# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The drive: what lies between a command u and the force F on the cart.

    τ ḟ(t) = u(t - d) - f(t),    F = g f + b

with the actuation delay d, the time constant of the motor τ, its gain g and a bias b.
"""

import math

from dp_swing_ros.kernels import kernel
from dp_swing_ros.kernels.unrolling import unrolled
from dp_swing_ros.pendulum.model import step

ROUNDING = 1e-9   # a time [s], or a share of a step, that is none
HISTORY = 0.5     # [s] for which a motor remembers commands


@kernel
def lagged(f, u, time_constant, duration):
    """Return the motor's force after a time [s] under a held command, and its mean over it."""
    if time_constant < ROUNDING:
        return u, u
    share = -math.expm1(-duration / time_constant)
    return f + (u - f) * share, u + (f - u) * share * time_constant / duration


@unrolled
def with_step(model, h):
    """Return the model with another step [s]."""
    return model._replace(h=h)


@kernel
def follow_commands(model, drive, ends, commands, x, duration):
    """
    Advance a state in place by a time [s], in steps of at most the model's.

    A command as it is sent holds until it `ends` [s], the last for ever; it acts a delay later.
    Returns the force of the motor at the end, before gain and bias. Shapes: ends and commands
    (M,), x (2n + 2,).
    """
    f, start = commands[0], -math.inf
    for k in range(len(commands)):
        ends_acting = ends[k] + drive.delay
        if k > 0 and start < 0 and ends_acting > start:
            f, _ = lagged(f, commands[k], drive.time_constant, min(ends_acting, 0.0) - start)
        acts = min(ends_acting, duration) - max(start, 0.0)
        steps = math.ceil(acts / model.h - ROUNDING)
        for _ in range(steps):
            h = acts / steps
            f, mean = lagged(f, commands[k], drive.time_constant, h)
            step(with_step(model, h), x, drive.gain * mean + drive.bias, x)
        start = max(start, ends_acting)
        if start >= duration:
            break
    return f
