# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A page in the browser on a live pendulum or a recorded one, and its server; needs no ROS."""
