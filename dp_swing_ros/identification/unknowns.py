# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What is to be identified: names, nominal values, scales and bounds of the parameters.

Masses, lengths, inertia factors and the gain are never negative: of them it is the logarithms of
what they are in their nominal values; of all others what they are above theirs.

Two things no motion tells. Twice all masses and frictions under twice the force move the same, so
the gain is known only where a mass is; and where the motion of the cart is given, masses and
frictions of the links only beside one of theirs. And of the last link, which carries none, motion
tells two numbers, m l and J + m l²/4, for three: so its inertia factor is known only where its
length is, or its mass beside the scale of all.
"""

from collections.abc import Mapping
import math
from typing import Any

import numpy as np

from dp_swing_ros.estimators.unknowns import (
    LARGEST_BALANCE, LONGEST, sizes_of, Unknowns, UnknownsParameters)
from dp_swing_ros.parameters import fields_of, unknown
from dp_swing_ros.pendulum.equations import scale_of
from dp_swing_ros.pendulum.parameters import Drive, PendulumParameters, SPRINGS
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.pendulum.units import SAME

FACTOR = 30.0       # a mass, a length or the gain is within so many times its first guess
SHARE = 0.5         # of itself, within which a value must be known to be told
DIFFERENCE = 1e-4   # [SI] scaled, of a parameter for derivatives; of a factor as a share
NEAR = 0.5          # of a scale from a bound: nearer counts as there, for a fit goes there slowly
OF_CART = ('cart_mass', 'cart_friction', 'cart_dry_friction', 'force_gain', 'actuation_delay',
           'motor_time_constant', 'force_bias')   # which decide how it moves


class Parametrisation:
    """
    All m = 8n + 8 values in the order of shooting.py, and which of them are free.

    Shapes: nominal, first, scales, differences, lowest and highest (m,); `first` is the guess
    that a fit begins with, `scales` are what makes a difference: of values that may be zero
    what is typical of them in a pendulum of the guessed size. What is `held` is either known or
    by the nature of motion not told.
    """

    def __init__(self, physical: PendulumParameters, drive: Drive, known: Mapping[str, float],
                 guess: PendulumParameters, is_given: bool = False) -> None:
        """
        Take nominal values, those known, a guess of bodies, and whether the cart moves as given.

        Raises ParameterError.
        """
        n, self.scale = physical.links, scale_of(guess)
        of_filter = Unknowns(physical, drive, UnknownsParameters(), SAME)
        self.links = n
        self.names = [*of_filter.names, 'gravity']
        for name in known:
            if name not in self.names:
                raise unknown(name, 'identify', self.names)
        self.nominal = np.append(of_filter.nominal, of_filter.constants[0])
        self.centres = of_filter.constants[1:]   # as shares of the lengths
        self.is_centre_given = [getattr(physical, f'link{i}_centre') > 0.0
                                for i in range(1, n + 1)]
        self.nominal[[self.names.index(name) for name in known]] = list(known.values())
        self.is_factor = np.array([name == 'force_gain' or name.endswith(
            ('_mass', '_length', '_factor')) for name in self.names])
        # of a link whose inertia is told the field of the factor says nothing
        factors = {f'link{i}_inertia_factor': factor
                   for i, factor in enumerate(guess.inertia_factors, 1)}
        of_guess = [known.get(name, factors.get(name, getattr(guess, name, nominal)))
                    for name, nominal in zip(self.names, self.nominal)]
        self.first = np.log(np.divide(of_guess, self.nominal, where=self.is_factor,
                                      out=np.ones(len(self.names))))
        sizes = np.where(self.is_factor, 1.0, sizes_of(self.names, n, self.scale))
        self.scales = np.where(self.is_factor, SHARE, sizes * np.append(
            of_filter.deviations, 1.0))
        self.differences = DIFFERENCE * sizes
        self.highest = np.where(self.is_factor, self.first + math.log(FACTOR), math.inf)
        self.lowest = np.where(self.is_factor, self.first - math.log(FACTOR), -self.nominal)
        for name, lowest, highest in (('actuation_delay', 0.0, LONGEST),
                                      ('motor_time_constant', 0.0, LONGEST),
                                      ('force_bias', -math.inf, math.inf),
                                      *((f'link{i}_balance', -LARGEST_BALANCE, LARGEST_BALANCE)
                                        for i in range(1, n + 1))):
            i = self.names.index(name)
            self.lowest[i], self.highest[i] = lowest - self.nominal[i], highest - self.nominal[i]
        # whose lowest value is a bound of the search, and none of their nature
        self.has_lowest = self.is_factor | [name.endswith('_balance') for name in self.names]
        self.held = {name: f'{value:g} is given' for name, value in known.items()}
        for name, why in unidentifiable(n, known, is_given).items():
            self.held.setdefault(name, why)

    def values(self, p: Array) -> Array:
        """Return the values of p; shapes: (..., m) -> (..., m)."""
        factors = self.nominal * np.exp(np.where(self.is_factor, p, 0.0))
        return np.where(self.is_factor, factors, self.nominal + p)

    def at_bounds(self, p: Array, halves: Array) -> Array:
        """
        Return whether each p, give or take half its interval, meets a bound of the search.

        That no friction and no time is below zero is none. Shapes: (m,), (m,) -> (m,).
        """
        near = np.maximum(halves, NEAR * self.scales)
        found: Array = self.has_lowest & (p - self.lowest < near) | (self.highest - p < near)
        return found

    def bodies(self, p: Array) -> PendulumParameters:
        """Return the pendulum of p (m,)."""
        values = self.named(self.values(p))
        centres = {f'link{i}_centre': centre * values[f'link{i}_length']
                   for i, (centre, given) in enumerate(zip(
                       self.centres, self.is_centre_given), 1) if given}
        return PendulumParameters(links=self.links, **centres, **{
            field.name: values[field.name] for field in fields_of(PendulumParameters, self.links)
            if field.name in values})

    def named(self, values: Array) -> dict[str, Any]:
        """Return values (m,) by name."""
        return dict(zip(self.names, values.tolist()))


def unidentifiable(links: int, known: Mapping[str, float], is_given: bool) -> dict[str, str]:
    """Return what no motion tells beside what is known, and why, by name."""
    found = {'gravity': 'it is that of the earth', **dict.fromkeys(
        (f'joint{i}_{each}' for i in range(1, links + 1) for each in SPRINGS),
        'springs are taken to be as they are told')}
    masses = [name for name in known if name.endswith('_mass') and not (
        is_given and name in OF_CART)]
    if is_given:
        found |= dict.fromkeys(OF_CART, 'the motion of the cart is given')
        if not masses:
            found['link1_mass'] = ('motion tells masses and frictions beside each other alone; '
                                   '--known link1_mass=... finds the others')
    elif not masses:
        found['force_gain'] = ('motion tells masses and frictions per force alone; --known '
                               'cart_mass=... finds it')
    scaled = 'force_gain' in known and not is_given or len(masses) > 1
    last = f'link{links}'
    if f'{last}_length' not in known and not (scaled and f'{last}_mass' in known):
        found[f'{last}_inertia_factor'] = (
            f'motion tells it in common with the mass and length of the link; --known '
            f'{last}_length=... finds it')
    return found
