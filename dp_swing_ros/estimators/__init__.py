# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Estimators: what is believed of state and pendulum, and the registry of how it is found out."""

from typing import Any

from dp_swing_ros.estimators.estimator import Direct
from dp_swing_ros.estimators.kalman import ExtendedKalmanFilter
from dp_swing_ros.parameters import registry

ESTIMATORS: dict[str, Any] = registry('dp_swing_ros.estimators', none=Direct,
                                      ekf=ExtendedKalmanFilter)
