# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Dynamics: the equations of motion, the models that step them, and whole trajectories."""

from typing import Any

from dp_swing_ros.dynamics.euler import Euler
from dp_swing_ros.dynamics.pendulum import Pendulum
from dp_swing_ros.dynamics.rk4 import RK4

# A model is built as MODELS[name].of(Pendulum.of(bodies), step in seconds).
MODELS: dict[str, Any] = {'rk4': RK4, 'euler': Euler}

__all__ = ['MODELS', 'Euler', 'Pendulum', 'RK4']
