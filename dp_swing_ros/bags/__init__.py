# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bags: written as rosbag2 does, read as episodes and as configurations; needs no ROS."""

from dp_swing_ros.bags.episodes import read_episode

__all__ = ['read_episode']
