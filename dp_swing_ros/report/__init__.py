# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A page on recorded runs: one HTML file that holds all it shows; needs no ROS."""
