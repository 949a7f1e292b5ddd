# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters: each declared once, with default, unit, range and description; registries."""

from dp_swing_ros.parameters.declaration import (
    checked, expected, fields_of, LARGEST, parameter, ParameterError, Parameters, unknown)
from dp_swing_ros.parameters.registry import registry

__all__ = ['checked', 'expected', 'fields_of', 'LARGEST', 'parameter', 'ParameterError',
           'Parameters', 'registry', 'unknown']
