# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What nodes decide, without ROS: the time is an argument, what is to be sent is returned."""
