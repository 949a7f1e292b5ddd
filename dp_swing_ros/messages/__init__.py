# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Messages read by their fields, live ones and those of a bag; needs neither ROS nor mcap."""
