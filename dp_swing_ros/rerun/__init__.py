# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Recorded runs again: the same ticks verified, and other solvers in their place; needs no ROS."""
