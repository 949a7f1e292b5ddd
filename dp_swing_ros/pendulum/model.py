# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The model that solvers predict with: the pendulum, stepped by an integrator.

A model is numbers and, as a part of its type, the integrator. `advance` serves them all: kernels
in double and single precision, and tensors on a GPU.
"""

from collections.abc import Hashable
import math
from typing import Any, NamedTuple, Protocol

import numpy as np

from dp_swing_ros.kernels import kernel
from dp_swing_ros.kernels.compilation import same_type_by
from dp_swing_ros.kernels.symbols import called
from dp_swing_ros.kernels.unrolling import unrolled
from dp_swing_ros.pendulum.equations import Numbers
from dp_swing_ros.pendulum.integrators import Integrator
from dp_swing_ros.pendulum.state import Array

ROUNDING = 1e-9  # a time [s], or a share of a step, that is none


class Dynamics(Protocol):
    """
    What accelerates cart and links: the equations of a pendulum, or something learned.

    A named tuple of numbers, tuples and arrays whose sizes follow from their types.
    """

    @property
    def links(self) -> int:
        """Return the number of links, n."""

    @property
    def kind(self) -> Hashable:
        """Return what the types of its numbers follow from, beside their precision."""

    def accelerations(self, x: Numbers, u: Any) -> list[Any]:
        """Return the accelerations of cart and links in a state (2n + 2,) under a force [N]."""

    def without_dry_friction(self) -> 'Dynamics':
        """Return the same without the friction that does not vanish with the speed."""


@same_type_by(lambda model: (model.integrator, model.pendulum.kind, type(model.h)))
class Model(NamedTuple):
    """Dynamics and how they are stepped."""

    pendulum: Any   # Dynamics; Numba knows none
    integrator: Integrator
    h: float        # [s] of a step


@unrolled
def accelerated(pendulum, x, u):
    """Return the accelerations of cart and links; x is a tuple."""
    return tuple(pendulum.accelerations(x, u))


def advance(model: Model, x: Any, u: Any) -> Any:
    """Return the 2n + 2 numbers of x⁺ = f(x, u) after one step under the force u [N]."""
    n = model.pendulum.links

    def f(x: Any, u: Any) -> Any:
        return [*x[n + 1:], *called(accelerated, n + 1, model.pendulum, tuple(x), u)]
    return model.integrator.step(f, [x[i] for i in range(2 * n + 2)], u, model.h)


@unrolled
def size(model):
    """Return how many numbers the state has."""
    return 2 * model.pendulum.links + 2


@unrolled
def zeros(model):
    """Return as many zeros as the state has numbers."""
    return (0.0,) * (2 * model.pendulum.links + 2)


@unrolled
def numbers(model, x):
    """Return the elements of an array (2n + 2,) as single numbers."""
    return tuple(x[i] for i in range(2 * model.pendulum.links + 2))


@unrolled
def step(model, x, u, out):
    """
    Write the next state x⁺ = f(x, u).

    Shapes: x and out (2n + 2,), which may be the same array; u is the force [N].
    """
    for i, x_i in enumerate(advance(model, x, u)):
        out[i] = x_i


@kernel
def rollout(model, x_0, U):
    """
    Return the states under the forces U.

    Shapes: x_0 (2n + 2,), U (T,) -> (T + 1, 2n + 2).
    """
    X = np.empty((len(U) + 1, size(model)))
    for i in range(size(model)):
        X[0, i] = x_0[i]
    for t in range(len(U)):
        step(model, X[t], U[t], X[t + 1])
    return X


def steps_in(duration: float, longest: float) -> int:
    """Return how many steps of a length at most [s] make a time [s]; what is rounding has none."""
    return math.ceil(duration / longest - ROUNDING)


def hold(model: Model, x: Array, u: float, duration: float) -> Array:
    """
    Return the state after any duration [s] under a held force, in steps of at most the model's.

    Shapes: x (2n + 2,) -> (2n + 2,).
    """
    steps = steps_in(duration, model.h)
    if steps < 1:
        return x
    states: Array = rollout(model._replace(h=duration / steps), x, np.full(steps, u))
    return states[-1]
