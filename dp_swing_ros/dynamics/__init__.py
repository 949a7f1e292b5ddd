# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Dynamics that are learned, in place of the equations of a known pendulum."""
