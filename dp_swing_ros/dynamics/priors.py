# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The prior of dynamics, before any experience.

A mass matrix that does not depend on the angles, bodies of about a kilogram and a metre, no
gravity and no friction; and that any of it may well be otherwise; or, where a pendulum is known,
that they are about its own, with frictions of any size. Numbers are those of the default bodies,
to whose size experience of others is brought; see `Experience.sized`.
"""

from typing import NamedTuple

import numpy as np

from dp_swing_ros.dynamics.structured import harmonics, links, pairs, Structured
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.pendulum.units import Units

MASS = 1.0         # [kg] scaled, of all, and its deviation
INERTIA = 0.1      # [kg m²] scaled, of a link
COUPLING = 0.3     # [kg m] scaled, standard deviation between cart and link
OF_LINKS = 0.2     # [kg m²] scaled, likewise between links, and of a link
WAVE = 0.3         # of these, the deviation of what goes with the angles
POTENTIAL = 5.0    # [J] scaled, standard deviation
FRICTION = 0.3     # [N s/m, N m s/rad, N, N m] scaled, likewise
SHARPNESS = 5.0    # [s/m, s/rad] scaled
ABOUT = 0.1        # of a number that is known, its deviation
REST = 0.03        # of the deviations above, those of what a chain of rigid links has not


class Prior(NamedTuple):
    """The prior, before any experience; shapes: mean, deviations and lowest (P,)."""

    mean: Array
    deviations: Array
    lowest: Array      # bounds: what is negative would make energy


def known(dynamics: Structured) -> Prior:
    """Return the prior of dynamics that are known, about."""
    n, (_, vague, lowest) = dynamics.links, structured(dynamics.links)[1]
    mean, bodies = dynamics.free, np.arange(len(vague)) < len(vague) - 2 * (n + 1)
    deviations = np.where(bodies, np.maximum(ABOUT * np.abs(mean), REST * vague), vague)
    return Prior(mean, deviations, lowest)


def sizes(n: int, scale: Units) -> Array:
    """Return by what the free numbers (P,) of n links so many times larger are larger."""
    untold, _ = structured(n)
    ones = untold.with_free(np.ones_like(untold.free))
    return ones.sized(scale).free


def structured(n: int) -> tuple[Structured, Prior]:
    """Return structured dynamics of n links that nothing was learned of, and their prior."""
    count = len(harmonics([0.0] * n, [1.0] * n))
    inertia, deviations = np.zeros((2, len(pairs(n)), count))
    for place, (i, j) in enumerate(pairs(n)):
        if i == j:
            inertia[place, 0] = MASS if i == 0 else INERTIA
        scale = MASS if (i, j) == (0, 0) else COUPLING if i == 0 else OF_LINKS
        deviations[place] = scale * np.where(np.arange(count) == 0, 1.0, WAVE)
    untold = Structured(links(n), inertia, np.zeros(count), np.zeros(n + 1), np.zeros(n + 1),
                        np.full(n + 1, SHARPNESS))
    frictions = np.zeros(2 * (n + 1))
    return untold, Prior(
        untold.free,
        np.concatenate((deviations.ravel(), np.full(count - 1, POTENTIAL), frictions + FRICTION)),
        np.concatenate((np.full(inertia.size + count - 1, -np.inf), frictions)))
