# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The topics: name, type, and what their publishers promise."""

from typing import NamedTuple


class Topic(NamedTuple):
    """A topic; a relative name lies in the node's namespace."""

    name: str
    type: str   # noqa: A003
    latched: bool = False  # a subscriber that joins late still gets the last message
    watched: bool = False  # its publishers promise a deadline, and to be alive


JOINT_STATES = Topic('joint_states', 'sensor_msgs/msg/JointState')
FORCE_COMMAND = Topic('force_command', 'std_msgs/msg/Float64', watched=True)
FORCE_COMMAND_STAMPED = Topic('force_command_stamped', 'sensor_msgs/msg/JointState', watched=True)
DISTURBANCE = Topic('disturbance', 'std_msgs/msg/Float64')
PLAN = Topic('mpc/plan', 'trajectory_msgs/msg/JointTrajectory')
TRIES = Topic('mpc/tries', 'sensor_msgs/msg/PointCloud2')
DIAGNOSTICS = Topic('/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray')
ROBOT_DESCRIPTION = Topic('robot_description', 'std_msgs/msg/String', latched=True)
CONFIGURATION = Topic('configuration', 'std_msgs/msg/String', latched=True)  # as YAML
# of the forward_command_controller in config/ros2_control.yaml
CONTROLLER_COMMANDS = Topic('force_controller/commands', 'std_msgs/msg/Float64MultiArray')

TOPICS = (JOINT_STATES, FORCE_COMMAND, FORCE_COMMAND_STAMPED, DISTURBANCE, PLAN, TRIES,
          DIAGNOSTICS, ROBOT_DESCRIPTION, CONFIGURATION)
