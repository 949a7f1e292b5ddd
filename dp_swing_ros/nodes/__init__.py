# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Nodes: convert, call, publish; messages and bags on one side, arrays and episodes on the other.

Nothing here imports rclpy on its own. Only logger and replay know bags.
"""
