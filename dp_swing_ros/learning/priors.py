# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What is believed of dynamics before any experience.

Of structured ones: a mass matrix that does not depend on the angles, bodies of about a kilogram
and a metre, no gravity and no friction; and that any of it may well be otherwise. Of a network
whose hidden units have been trained: that its outputs are nothing, or as large as training made
them.
"""

import numpy as np

from dp_swing_ros.dynamics.kinds import harmonics, links, pairs, Structured
from dp_swing_ros.dynamics.network import Network
from dp_swing_ros.learning.regression import Prior

MASS = 1.0         # [kg] of all, and its deviation
INERTIA = 0.1      # [kg m²] of a link
COUPLING = 0.3     # [kg m] standard deviation between cart and link
OF_LINKS = 0.2     # [kg m²] likewise between links, and of a link
WAVE = 0.3         # of these, the deviation of what goes with the angles
POTENTIAL = 5.0    # [J] standard deviation
FRICTION = 0.3     # [N s/m, N m s/rad, N, N m] likewise
SHARPNESS = 5.0    # [s/m, s/rad]
LEAST = 1e-3       # [N, N m or accelerations] deviation of a weight of a network


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
                        SHARPNESS)
    frictions = np.zeros(2 * (n + 1))
    return untold, Prior(
        untold.free,
        np.concatenate((deviations.ravel(), np.full(count - 1, POTENTIAL), frictions + FRICTION)),
        np.concatenate((np.full(inertia.size + count - 1, -np.inf), frictions)))


def last_layer(network: Network) -> Prior:
    """Return the prior of the last layer of a network that was trained."""
    of_rows = np.maximum(np.sqrt(np.mean(network.V ** 2, axis=1)), LEAST)
    deviations = np.concatenate((np.repeat(of_rows, network.V.shape[1]), of_rows))
    return Prior(np.zeros(len(deviations)), deviations, np.full(len(deviations), -np.inf))
