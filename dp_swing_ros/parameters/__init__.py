# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters: each declared once, with default, unit, range and description."""

from dp_swing_ros.parameters.declaration import (
    checked, INFINITE, LARGEST, parameter, ParameterError, Parameters, unknown)

__all__ = ['checked', 'INFINITE', 'LARGEST', 'parameter', 'ParameterError', 'Parameters',
           'unknown']
