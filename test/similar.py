# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pendulums that are similar: the same in their own units."""

from dp_swing_ros.pendulum.units import Units
from dp_swing_ros.simulation.plants import PLANT

SMALLER = Units(1 / 4, 1 / 2, 1 / 8, 1 / 8)   # powers of two: nothing but what is rounded differs


def sized(values, scale=SMALLER):
    """Return numbers of a plant, by name, as they are of one so many times larger."""
    fields = PLANT.fields(links=3)
    return {name: value * scale.factor(fields[name].metadata['unit'])
            for name, value in values.items()}
