# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Units of length, time and mass, and what the SI's derived ones are in them.

Defaults with a unit are those of the default bodies. For others they are scaled with the
pendulum's own units, so that they are the same numbers of these; see `own_units`.
"""

from collections.abc import Sequence
import functools
import math
import re
from typing import NamedTuple

import numpy as np

DIGITS = 6   # of what is scaled: nobody means the others
# exponents of length, time, mass, and mass of the links: what turns a joint moves those alone
DIMENSIONS = {'m': (1, 0, 0, 0), 's': (0, 1, 0, 0), 'kg': (0, 0, 1, 0), 'N': (1, -2, 1, 0),
              'J': (2, -2, 1, 0), 'Nm': (2, -2, 0, 1), 'Hz': (0, -1, 0, 0),
              'rad': (0, 0, 0, 0), '1': (0, 0, 0, 0)}


class Units(NamedTuple):
    """Units of length [m], time [s] and mass [kg], how many times larger, or what else is so."""

    length: float
    time: float
    mass: float          # of cart and links, which forces on the cart move
    mass_of_links: float

    def factor(self, unit: str) -> float:
        """Return the same of what the SI measures in a unit as 'N s/m'."""
        value = 1.0
        for base, exponent in zip(self, dimension(unit)):
            value *= base ** exponent
        return value

    def factors(self, unit: str, count: int) -> list[float]:
        """Return the same for each element of a list (count,); see `by_element`."""
        return [self.factor(each) for each in by_element(unit, count)]

    @property
    def inverse(self) -> 'Units':
        """Return how many times smaller."""
        return Units(*(1 / each for each in self))

    def each_joint(self, value: float, unit: str, links: int) -> list[float]:
        """
        Return what a number of the joints is for the cart and each of them.

        A unit as 'm/s, rad/s' is that of either; the cart's number is the same in own units.
        """
        cart, joint = unit.split(', ')
        return [value * (self.factor(cart) / self.factor(joint)), *[value] * links]

    def sized(self, value: float, unit: str) -> float:
        """Return what a value with a unit is in a pendulum so many times larger."""
        factor = self.factor(unit)
        return value if factor == 1.0 else float(f'{value * factor:.{DIGITS}g}')


POSITIONS, SPEEDS, ACCELERATIONS = 'm, rad', 'm/s, rad/s', 'm/s^2, rad/s^2'
STATES = f'{POSITIONS}, {SPEEDS}'
SAME = Units(1.0, 1.0, 1.0, 1.0)   # as large as the default bodies


@functools.lru_cache(maxsize=64)   # every tick asks, of the same pendulum
def scaled_speeds(value: float, scale: Units, links: int) -> tuple[float, ...]:
    """Return a speed of the default bodies for cart [m/s] and joints [rad/s] of others."""
    return tuple(scale.each_joint(scale.sized(value, SPEEDS), SPEEDS, links))


@functools.cache
def dimension(unit: str) -> tuple[int, ...]:
    """
    Return the exponents of length, time, mass and that of the links in a unit as 'N s/m'.

    What is of cart and joints alike, as 'm/s, rad/s', is scaled as that of the joints.
    """
    above, _, below = unit.rpartition(', ')[2].replace('N m', 'Nm').partition('/')
    found = np.zeros(4, dtype=int)
    for sign, text in ((1, above), (-1, below)):
        for name, exponent in re.findall(r'([A-Za-z1]+)(?:\^(\d))?', text):
            found += sign * int(exponent or 1) * np.array(DIMENSIONS[name])
    return tuple(found.tolist())


def decimals(usual: int, times: float) -> int:
    """Return how many decimals show as much of what is so many times larger than usual."""
    return max(usual - round(math.log10(times)), 0)


def rounded(value: float) -> float:
    """Return the round number nearest to a positive one: 1, 2, 2.5 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(value))
    return min((step * power for step in (1, 2, 2.5, 5, 10)),
               key=lambda each: abs(math.log(each / value)))


def in_words(unit: str) -> str:
    """
    Return a unit of the SI as one of the pendulum's own, as 'M L/T^2' for 'N'.

    M is the mass of all, m that of the links.
    """
    powers = dict(zip('LTMm', dimension(unit)))
    above, below = (' '.join(
        name + (f'^{abs(powers[name])}' if abs(powers[name]) > 1 else '')
        for name in 'MmLT' if powers[name] * sign > 0) for sign in (1, -1))
    return (above or '1') + (f'/{below}' if below else '')


def by_element(unit: str, count: int) -> Sequence[str]:
    """
    Return the unit of each element of a default, of which there are so many.

    A list is of cart and joints, or of these and then of their speeds; see `parameter`.
    """
    each = unit.split(', ')
    if len(each) == 1 or count == 1:
        return [unit] * count
    return [name for cart, joint in zip(each[::2], each[1::2])
            for name in (cart, *[joint] * (2 * count // len(each) - 1))]
