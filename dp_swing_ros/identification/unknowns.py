# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What is to be identified: names, nominal values, scales and bounds of the parameters.

Masses, lengths, inertia factors and the gain are never negative: of them it is the logarithms of
what they are in their nominal values; of all others what they are above theirs.

Two things no motion tells. Twice all masses and frictions under twice the force move the same, so
the gain is known only where a mass is. And of the last link, which carries none, motion tells two
numbers, m l and J + m l²/4, for three: so its inertia factor is known only where its length is, or
its mass beside the scale of all.
"""

from collections.abc import Mapping
import math
from typing import Any

import numpy as np

from dp_swing_ros.estimators.unknowns import LONGEST, Unknowns, UnknownsParameters
from dp_swing_ros.parameters import unknown
from dp_swing_ros.pendulum.equations import scale_of
from dp_swing_ros.pendulum.parameters import Drive, PendulumParameters
from dp_swing_ros.pendulum.state import Array

FACTOR = 4.0   # a mass, a length or the gain is within so many times its nominal value
SHARE = 0.5    # of itself, within which a value must be known to be told


class Parametrisation:
    """
    All m = 5n + 8 values in the order of shooting.py, and which of them are free.

    Shapes: nominal, scales, lowest and highest (m,); `scales` are what makes a difference: of
    values that may be zero what is typical of them. What is `held` is either known or by the
    nature of motion not told.
    """

    def __init__(self, physical: PendulumParameters, drive: Drive,
                 known: Mapping[str, float]) -> None:
        """Take the nominal values, and those that are known; raises ParameterError."""
        n = physical.links
        of_filter = Unknowns(physical, drive, UnknownsParameters(), scale_of(physical))
        self.links = n
        self.names = [*of_filter.names, *(f'link{i}_inertia_factor' for i in range(1, n + 1)),
                      'gravity']
        for name in known:
            if name not in self.names:
                raise unknown(name, 'identify', self.names)
        self.nominal = np.concatenate((of_filter.nominal, of_filter.constants))
        self.nominal[[self.names.index(name) for name in known]] = list(known.values())
        self.is_factor = np.array([name == 'force_gain' or name.endswith(
            ('_mass', '_length', '_factor')) for name in self.names])
        rest = np.concatenate((of_filter.deviations, np.ones(n + 1)))
        self.scales = np.where(self.is_factor, SHARE, rest)
        self.highest = np.where(self.is_factor, math.log(FACTOR), math.inf)
        self.lowest = np.where(self.is_factor, -math.log(FACTOR), -self.nominal)
        for name, lowest, highest in (('actuation_delay', 0.0, LONGEST),
                                      ('motor_time_constant', 0.0, LONGEST),
                                      ('force_bias', -math.inf, math.inf)):
            i = self.names.index(name)
            self.lowest[i], self.highest[i] = lowest - self.nominal[i], highest - self.nominal[i]
        self.held = {name: f'{value:g} is given' for name, value in known.items()}
        for name, why in unidentifiable(n, known).items():
            self.held.setdefault(name, why)

    def values(self, p: Array) -> Array:
        """Return the values of p; shapes: (..., m) -> (..., m)."""
        factors = self.nominal * np.exp(np.where(self.is_factor, p, 0.0))
        return np.where(self.is_factor, factors, self.nominal + p)

    def named(self, values: Array) -> dict[str, Any]:
        """Return values (m,) by name."""
        return dict(zip(self.names, values.tolist()))


def unidentifiable(links: int, known: Mapping[str, float]) -> dict[str, str]:
    """Return what no motion tells beside what is known, and why, by name."""
    found = {'gravity': 'it is that of the earth'}
    masses = [name for name in known if name.endswith('_mass')]
    if not masses:
        found['force_gain'] = ('motion tells masses and frictions per force alone; --known '
                               'cart_mass=... finds it')
    scaled = 'force_gain' in known or len(masses) > 1
    last = f'link{links}'
    if f'{last}_length' not in known and not (scaled and f'{last}_mass' in known):
        found[f'{last}_inertia_factor'] = (
            f'motion tells it in common with the mass and length of the link; --known '
            f'{last}_length=... finds it')
    return found
