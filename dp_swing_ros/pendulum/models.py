# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The registry of dynamics models."""

from typing import Any

from dp_swing_ros.pendulum.euler import Euler
from dp_swing_ros.pendulum.rk4 import RK4

# A model is built as MODELS[name].of(Pendulum.of(bodies), step in seconds).
MODELS: dict[str, Any] = {'rk4': RK4, 'euler': Euler}
