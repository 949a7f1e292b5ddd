# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The topics: name, type, and what their publishers promise."""

from typing import NamedTuple


class Topic(NamedTuple):
    """A topic; a relative name lies in the node's namespace."""

    name: str
    type: str
    latched: bool = False  # a subscriber that joins late still gets the last message
    watched: bool = False  # its publishers promise a deadline, and to be alive


JOINT_STATES = Topic('joint_states', 'sensor_msgs/msg/JointState')
FORCE_COMMAND = Topic('force_command', 'std_msgs/msg/Float64', watched=True)
FORCE_COMMAND_STAMPED = Topic('force_command_stamped', 'sensor_msgs/msg/JointState', watched=True)
ACCELERATION_COMMAND = Topic('acceleration_command', 'std_msgs/msg/Float64', watched=True)
VELOCITY_COMMAND = Topic('velocity_command', 'std_msgs/msg/Float64', watched=True)
VELOCITY_COMMAND_STAMPED = Topic('velocity_command_stamped', 'sensor_msgs/msg/JointState',
                                 watched=True)
# by the parameter drive; a JointState has no field for accelerations
COMMANDS = {'force': FORCE_COMMAND, 'voltage': FORCE_COMMAND,
            'acceleration': ACCELERATION_COMMAND, 'velocity': VELOCITY_COMMAND}
COMMAND_TOPICS = FORCE_COMMAND, ACCELERATION_COMMAND, VELOCITY_COMMAND
STAMPED_COMMANDS = {'force': FORCE_COMMAND_STAMPED, 'voltage': FORCE_COMMAND_STAMPED,
                    'velocity': VELOCITY_COMMAND_STAMPED}
DISTURBANCE = Topic('disturbance', 'std_msgs/msg/Float64')
PLAN = Topic('mpc/plan', 'trajectory_msgs/msg/JointTrajectory')
TRIES = Topic('mpc/tries', 'sensor_msgs/msg/PointCloud2')
DIAGNOSTICS = Topic('/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray')
ROBOT_DESCRIPTION = Topic('robot_description', 'std_msgs/msg/String', latched=True)
CONFIGURATION = Topic('configuration', 'std_msgs/msg/String', latched=True)  # as YAML
# of forward_command_controllers, as the one in config/ros2_control.yaml, by the interface
CONTROLLER_COMMANDS = {interface: Topic(f'{name}_controller/commands',
                                        'std_msgs/msg/Float64MultiArray')
                       for interface, name in (('effort', 'force'), ('velocity', 'velocity'),
                                               ('position', 'position'),
                                               ('acceleration', 'acceleration'))}

TOPICS = (JOINT_STATES, *COMMAND_TOPICS, FORCE_COMMAND_STAMPED, VELOCITY_COMMAND_STAMPED,
          DISTURBANCE, PLAN, TRIES, DIAGNOSTICS, ROBOT_DESCRIPTION, CONFIGURATION)
