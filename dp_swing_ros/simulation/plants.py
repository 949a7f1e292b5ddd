# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The plant from parameters by their names."""

from dp_swing_ros.parameters import group, Values
from dp_swing_ros.pendulum.declaration import Declaration
from dp_swing_ros.pendulum.parameters import (
    DriveParameters, LimitParameters, PendulumParameters)
from dp_swing_ros.pendulum.state import hanging, LINKS
from dp_swing_ros.simulation.plant import Plant, PlantParameters

PLANT = Declaration('plant', lambda: [('', PlantParameters)], {
    links: {'initial_state': tuple(hanging(links).tolist())} for links in LINKS})


def plant(values: Values) -> Plant:
    """
    Build the plant that a node with these parameters would run.

    Raises ParameterError.
    """
    values = PLANT.complete(values)
    return Plant(group(PendulumParameters, values), group(LimitParameters, values),
                 group(PlantParameters, values), group(DriveParameters, values))
