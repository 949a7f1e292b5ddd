# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Estimators: one file each, and the registry that nodes and tools choose from."""

from typing import Any

from dp_swing_ros.estimators.estimator import Direct
from dp_swing_ros.estimators.kalman import ExtendedKalmanFilter
from dp_swing_ros.parameters import Registry

ESTIMATORS: Registry[Any] = Registry(
    'dp_swing_ros.estimators', none=Direct, ekf=ExtendedKalmanFilter)
