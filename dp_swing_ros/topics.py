# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The topics: name, type and how many messages a late subscriber still gets."""

from typing import NamedTuple


class Topic(NamedTuple):
    """A topic; a relative name lies in the node's namespace."""

    name: str
    type: str   # noqa: A003
    depth: int  # messages that a publisher keeps for subscribers that join late and ask for them


# The logger joins late, and the bag is to begin with the first state all the same.
KEPT = 1000

JOINT_STATES = Topic('joint_states', 'sensor_msgs/msg/JointState', KEPT)
FORCE_COMMAND = Topic('force_command', 'std_msgs/msg/Float64', KEPT)
DISTURBANCE = Topic('disturbance', 'std_msgs/msg/Float64', KEPT)
PLAN = Topic('mpc/plan', 'trajectory_msgs/msg/JointTrajectory', KEPT)
DIAGNOSTICS = Topic('/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray', KEPT)
ROBOT_DESCRIPTION = Topic('robot_description', 'std_msgs/msg/String', 1)
CONFIGURATION = Topic('configuration', 'std_msgs/msg/String', 1)  # of each node, as YAML

TOPICS = (JOINT_STATES, FORCE_COMMAND, DISTURBANCE, PLAN, DIAGNOSTICS, ROBOT_DESCRIPTION,
          CONFIGURATION)
