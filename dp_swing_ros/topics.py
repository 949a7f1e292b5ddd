# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The topics: name, type, and whether the last message waits for late subscribers."""

from typing import NamedTuple


class Topic(NamedTuple):
    """A topic; a relative name lies in the node's namespace."""

    name: str
    type: str   # noqa: A003
    latched: bool = False  # a subscriber that joins late still gets the last message


JOINT_STATES = Topic('joint_states', 'sensor_msgs/msg/JointState')
FORCE_COMMAND = Topic('force_command', 'std_msgs/msg/Float64')
DISTURBANCE = Topic('disturbance', 'std_msgs/msg/Float64')
PLAN = Topic('mpc/plan', 'trajectory_msgs/msg/JointTrajectory')
DIAGNOSTICS = Topic('/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray')
ROBOT_DESCRIPTION = Topic('robot_description', 'std_msgs/msg/String', latched=True)
CONFIGURATION = Topic('configuration', 'std_msgs/msg/String', latched=True)  # as YAML

TOPICS = (JOINT_STATES, FORCE_COMMAND, DISTURBANCE, PLAN, DIAGNOSTICS, ROBOT_DESCRIPTION,
          CONFIGURATION)
