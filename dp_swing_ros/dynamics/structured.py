# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Dynamics that are learned, D(θ) a = r(θ, θ̇, u, ẋ).

D_ij and the potential V are trigonometric polynomials in the angles, and r = H u - C q̇ - ∂V/∂q -
friction follows by Lagrange:

    (C q̇)_i = Σ_m Σ_j ∂D_ij/∂q_m q̇_m q̇_j - ½ Σ_jk ∂D_jk/∂q_i q̇_j q̇_k

They do not depend on where the cart is. A chain of rigid links is of this structure, exactly,
wherever the mass in a link and however its angle is counted.
"""

from collections.abc import Hashable, Sequence
import functools
from itertools import combinations, combinations_with_replacement
from typing import Any, NamedTuple

import numpy as np

from dp_swing_ros.kernels.compilation import Constant
from dp_swing_ros.kernels.symbols import cos, dot, fixed, sin
from dp_swing_ros.pendulum.equations import (
    add_joint_friction, friction, inverse_inertia, Matrix, Numbers, Parts, Pendulum, solve)
from dp_swing_ros.pendulum.points import by_variables, in_turn, point_type
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.pendulum.units import Units


class Links(Constant):
    """How many links there are."""

    def __init__(self, number: int) -> None:
        """Take the number; those of equal numbers should be the same: `links`."""
        super().__init__(f'links-{number}', Links)
        self.number = number

    def __reduce__(self) -> tuple[Any, ...]:
        """Return what makes the same one in another process."""
        return links, (self.number,)


@functools.cache
def links(number: int) -> Links:
    """Return that there are so many, always the same."""
    return Links(number)


class Harmonic(NamedTuple):
    """A trigonometric function of the angles, and its slopes by each of them."""

    value: Any
    slopes: list[Any]


def harmonics(s: Numbers, c: Numbers) -> list[Harmonic]:
    """Return 1, the cosines and sines, and the products of those of each two angles."""
    n = len(s)

    def slopes(by: dict[int, Any]) -> list[Any]:
        return [by.get(i, 0.0) for i in range(n)]
    found = [Harmonic(1.0, slopes({}))]
    for i in range(n):
        found += [Harmonic(c[i], slopes({i: -s[i]})), Harmonic(s[i], slopes({i: c[i]}))]
    for i, j in combinations(range(n), 2):
        for f, f_slope in ((c[i], -s[i]), (s[i], c[i])):
            for g, g_slope in ((c[j], -s[j]), (s[j], c[j])):
                found.append(Harmonic(f * g, slopes({i: f_slope * g, j: f * g_slope})))
    return found


def pairs(n: int) -> list[tuple[int, int]]:
    """Return the places of the upper triangle of D, row by row."""
    return list(combinations_with_replacement(range(n + 1), 2))


class Structured(NamedTuple):
    """
    A mass matrix and a potential, learned, and a friction.

    Shapes: inertia (pairs, harmonics) [kg, kg m, kg m²], potential (harmonics,) [J], friction and
    dry (n + 1,), as those of a Pendulum; sharpness (n + 1,) likewise.
    """

    size: Links
    inertia: Array
    potential: Array
    friction: Array
    dry: Array
    sharpness: Array

    @classmethod
    def of(cls, p: Pendulum) -> 'Structured':
        """Return what a chain of rigid links is."""
        n = p.links
        place = {pair: row for row, pair in enumerate(pairs(n))}
        count = len(harmonics([0.0] * n, [1.0] * n))
        inertia, potential = np.zeros((len(place), count)), np.zeros(count)
        inertia[place[0, 0], 0] = p.m
        for i in range(n):
            inertia[place[0, i + 1], 1 + 2 * i] = p.a[i]    # cos θ_i
            inertia[place[i + 1, i + 1], 0] = p.b[i][0]
            potential[1 + 2 * i] = p.g * p.a[i]
        for number, (i, j) in enumerate(combinations(range(n), 2)):
            first = 1 + 2 * n + 4 * number   # cos θ_i cos θ_j, …, sin θ_i sin θ_j
            inertia[place[i + 1, j + 1], [first, first + 3]] = p.b[i][j - i]
        return cls(links(n), inertia, potential, np.array(p.friction), np.array(p.dry),
                   np.array(p.sharpness))

    @property
    def links(self) -> int:
        """Return the number of links, n."""
        return self.size.number

    @property
    def kind(self) -> Hashable:
        """Return what the types of its numbers follow from."""
        return Structured, self.size

    def mass_matrix(self, s: Numbers, c: Numbers) -> Matrix:
        """Return D."""
        return self.symmetric([each.value for each in harmonics(s, c)])

    def symmetric(self, values: Numbers) -> Matrix:
        """Return the matrix whose entries go with the harmonics as those of D do."""
        n = self.links
        D = [[0.0] * (n + 1) for _ in range(n + 1)]
        for place, (i, j) in enumerate(pairs(n)):
            D[i][j] = D[j][i] = dot(
                [self.inertia[place, k] for k in range(len(values))], values)
        return D

    def force(self, s: Numbers, c: Numbers, rates: Numbers) -> list[Any]:
        """Return r; rates are θ̇, u and ẋ."""
        n, basis = self.links, harmonics(s, c)
        *w, u, v = rates
        speeds = [v, *w]
        r = [u - friction(self, 0, v), *[0.0] * n]
        for m in range(n):
            slopes = [each.slopes[m] for each in basis]
            momenta = [dot(row, speeds) for row in self.symmetric(slopes)]
            down = dot([self.potential[k] for k in range(len(basis))], slopes)
            r = [r_i - w[m] * momentum for r_i, momentum in zip(r, momenta)]
            r[m + 1] = r[m + 1] + 0.5 * dot(speeds, momenta) - down
            add_joint_friction(self, m, w, r)
        return r

    def accelerations(self, x: Numbers, u: Any) -> list[Any]:
        """Return the accelerations of cart and links, a = D⁻¹ r."""
        _, th, v, w = Parts.of(self, x)
        s, c = [sin(th_i) for th_i in th], [cos(th_i) for th_i in th]
        return solve(self.mass_matrix(s, c), self.force(s, c, [*w, u, v]))

    @property
    def free(self) -> Array:
        """Return all numbers but the zero of the potential, which does nothing."""
        return np.concatenate((self.inertia.ravel(), self.potential[1:], self.friction, self.dry))

    def with_free(self, p: Array) -> 'Structured':
        """Return the same with other such numbers (P,)."""
        count, first = len(self.potential), self.inertia.size   # slices: np.split takes longer
        second = first + count - 1
        third = second + self.links + 1
        return self._replace(
            inertia=p[:first].reshape(-1, count).copy(),
            potential=np.append(0.0, p[first:second]), friction=p[second:third].copy(),
            dry=p[third:].copy())

    def sized(self, scale: Units) -> 'Structured':
        """Return the same of a pendulum so many times larger."""
        scale = scale._replace(mass_of_links=scale.mass)   # in equations there is one mass

        def factors(unit: str) -> list[float]:
            return scale.factors(unit, self.links + 1)
        inertia = [scale.mass * scale.length ** ((i > 0) + (j > 0)) for i, j in pairs(self.links)]
        return self._replace(
            inertia=self.inertia * np.array(inertia)[:, None],
            potential=self.potential * scale.factor('J'),
            friction=self.friction * factors('N s/m, N m s/rad'),
            dry=self.dry * factors('N, N m'), sharpness=self.sharpness * factors('s/m, s/rad'))

    def with_creep(self, creep: float) -> 'Structured':
        """Return the same with dry friction that is whole from another speed on [m/s, rad/s]."""
        return self._replace(sharpness=np.full(self.links + 1, 1 / creep))

    def without_dry_friction(self) -> 'Structured':
        """Return the same without dry friction."""
        return self._replace(dry=np.zeros_like(self.dry))


class LearnedPoint(NamedTuple):
    """What the derivatives of the accelerations need at a point; see points.py."""

    s: list[Any]       # sines and cosines of the angles
    c: list[Any]
    rates: list[Any]   # θ̇, u and ẋ
    a: list[Any]       # accelerations of cart and links
    J: Matrix          # (n + 1, 2n + 2) their derivatives by z = (θ, θ̇, u, ẋ)
    inverse: Matrix    # the upper triangle of D⁻¹

    @property
    def drag(self) -> tuple[float]:
        """Return that what holds the cart back, a function of ẋ, is no part of u."""
        return (0.0,)

    @classmethod
    def of(cls, p: Structured, x: Numbers, u: Any) -> 'LearnedPoint':
        """Evaluate all at a state x under a force u."""
        _, th, v, w = Parts.of(p, x)
        s, c = [sin(th_i) for th_i in th], [cos(th_i) for th_i in th]
        rates, D = [*w, u, v], p.mass_matrix(s, c)
        a, D_inverse = solve(D, p.force(s, c, rates)), inverse_inertia(D)
        by_z = [by_variables(each, s, c, rates)
                for each in residuals(p, s, c, rates, [fixed(a_i) for a_i in a])]
        J = [[dot(row, column) for column in zip(*by_z)] for row in D_inverse]
        return cls(s, c, rates, a, J, [row[i:] for i, row in enumerate(D_inverse)])

    @classmethod
    def read(cls, n: int, numbers: Sequence[Any]) -> 'LearnedPoint':
        """Return the point whose numbers these are, in order."""
        some = in_turn(numbers)
        return cls(some(n), some(n), some(n + 2), some(n + 1),
                   [some(2 * n + 2) for _ in range(n + 1)],
                   [some(n + 1 - i) for i in range(n + 1)])

    @staticmethod
    def curved_pairs(n: int) -> list[tuple[int, int]]:
        """Return all pairs j ≤ k."""
        return list(combinations_with_replacement(range(2 * n + 2), 2))

    def second_derivatives(self, p: Structured, mu: Numbers) -> list[Any]:
        """Return the M_jk of curved_pairs."""
        n, variables = len(self.s), (self.s, self.c, self.rates)
        nu = [dot([self.inverse[min(i, j)][abs(i - j)] for j in range(n + 1)], mu)
              for i in range(n + 1)]
        slopes = by_variables(dot(nu, residuals(p, *variables, self.a)), *variables)
        second = [by_variables(slope, *variables) for slope in slopes]
        momenta = [dot(row, nu) for row in p.mass_matrix(self.s, self.c)]
        e = list(zip(*(by_variables(each, *variables) for each in momenta)))
        J = list(zip(*self.J))   # by columns, as e
        return [second[j][k] - (dot(e[j], J[k]) + dot(e[k], J[j]))
                for j, k in self.curved_pairs(n)]


point_type.register(Structured, lambda dynamics: LearnedPoint)


def residuals(p: Structured, s: Numbers, c: Numbers, rates: Numbers, a: Numbers) -> list[Any]:
    """Return r - D a."""
    return [r_i - dot(row, a) for r_i, row in zip(p.force(s, c, rates), p.mass_matrix(s, c))]
