# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What the members of a learned model disagree on, as a cost.

    d(x, u) = w / M Σ_m Σ_i ((a_i^m(x, u) - a_i(x, u)) h / σ_i)²

a are the accelerations of the model and a^m those of its M other members, h is the step of a plan
and σ what predictions of the speeds missed in training: so d is w times the square of what
/diagnostics calls model_spread, summed over the speeds. A plan that pays for it stays where the
experience decides what happens. Source: Deisenroth and Rasmussen, "PILCO", ICML 2011, for planning
with what a model does not know; Kidambi et al., "MOReL", NeurIPS 2020, for paying where an
ensemble disagrees.
"""

from collections.abc import Hashable
from itertools import combinations_with_replacement
from typing import Any, NamedTuple

from dp_swing_ros.dynamics.files import LearnedModel
from dp_swing_ros.kernels.symbols import called, dot, flat
from dp_swing_ros.kernels.unrolling import unrolled
from dp_swing_ros.pendulum.equations import Numbers
from dp_swing_ros.pendulum.model import accelerated
from dp_swing_ros.pendulum.points import point_type


class Disagreement(NamedTuple):
    """The model before its other members, and w h² / (M σ²) by speed; neither where it is free."""

    members: tuple[Any, ...] = ()
    weights: tuple[float, ...] = ()   # (n + 1,) [s^4/m^2, s^4/rad^2]

    @classmethod
    def of(cls, learned: LearnedModel | None, weight: float, h: float) -> 'Disagreement':
        """Return that of a learned model, for a weight w and steps of h [s]."""
        if learned is None or weight == 0 or not len(learned.draws):
            return AGREED
        scales = (weight / len(learned.draws) * (h / learned.noise) ** 2).tolist()
        return cls((learned.dynamics, *learned.members), tuple(scales))

    @property
    def kind(self) -> Hashable:
        """Return what the types of its numbers follow from."""
        return len(self.members), *(each.kind for each in self.members[:1])


AGREED = Disagreement()


def disagreement(of: Disagreement, x: Numbers, u: Any) -> Any:
    """Return d(x, u)."""
    if not of.members:
        return 0.0
    x = tuple(x[i] for i in range(2 * len(of.weights)))
    own, *others = (called(accelerated, len(of.weights), member, x, u) for member in of.members)
    return sum(dot(of.weights, [(a - a_own) * (a - a_own) for a, a_own in zip(other, own)])
               for other in others)


@unrolled
def accelerations_and_slopes(dynamics, x, u):
    """Return the accelerations and, row by row, their derivatives by (θ, θ̇, u, ẋ)."""
    at = point_type(dynamics).of(dynamics, x, u)
    return (*at.a, *flat(at.J))


def expansion(of: Disagreement, x: Numbers, u: Any) -> list[Any]:
    """Return what `add_expansion` adds: d_z, and the upper triangle of Gauss-Newton's d_zz."""
    if not of.members:
        return []
    n, z = len(of.weights), range(2 * len(of.weights))
    own, *others = (called(accelerations_and_slopes, n + n * len(z), member, tuple(x), u)
                    for member in of.members)
    e = [[number - of_own for number, of_own in zip(other, own)] for other in others]
    off = flat([each[:n] for each in e])
    slopes = [flat([each[n + j::len(z)] for each in e]) for j in z]
    w = [2 * weight for weight in of.weights] * len(others)
    weighted = [[w_i * slope for w_i, slope in zip(w, column)] for column in slopes]
    return [*(dot(column, off) for column in weighted),
            *(dot(weighted[j], slopes[k]) for j, k in combinations_with_replacement(z, 2))]


def numbers_in(of: Disagreement) -> int:
    """Return how many numbers the expansion has."""
    z = 2 * len(of.weights)
    return z + z * (z + 1) // 2


@unrolled
def add_expansion(of, numbers, i, Q_z, Q_zz):
    """
    Add the expansion in lane i to gradient and Hessian by (x, u).

    Shapes: numbers (numbers_in, lanes), Q_z (2n + 3 or more,), Q_zz likewise twice.
    """
    if not of.members:
        return
    half = len(of.weights)
    places = [*range(1, half), *range(half + 1, 2 * half), 2 * half, half]   # θ, θ̇, u, ẋ
    rows = iter(range(numbers_in(of)))
    for place in places:
        Q_z[place] = Q_z[place] + numbers[next(rows), i]
    for j, k in combinations_with_replacement(places, 2):
        bend = numbers[next(rows), i]
        for row, column in {(j, k), (k, j)}:
            Q_zz[row, column] = Q_zz[row, column] + bend
