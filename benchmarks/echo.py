# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The node `echo` answers each state at once: what machine and middleware add to any mpc."""

import sys

from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from dp_swing_ros.messages.fields import seconds
from dp_swing_ros.nodes.connections import publish, subscribe
from dp_swing_ros.nodes.process import ProcessNode, run
from dp_swing_ros.nodes.ros_parameters import declare
from dp_swing_ros.parameters import named
from dp_swing_ros.parameters.scheduling import SchedulingParameters
from dp_swing_ros.topics import JOINT_STATES, Topic

ECHO = Topic('echo', 'std_msgs/msg/Float64')


class EchoNode(ProcessNode):
    """Hears the states as an mpc does, and answers each with its stamp [s]."""

    def __init__(self) -> None:
        super().__init__('echo')
        self.thread_priority = declare(self, named(SchedulingParameters))['thread_priority']
        self.answers = publish(self, ECHO)
        subscribe(self, JOINT_STATES, self.on_state, depth=1, sensor=True)
        self.get_logger().info('ready')

    def on_state(self, message: JointState) -> None:
        """Answer a state."""
        self.answers.publish(Float64(data=seconds(message.header.stamp)))


if __name__ == '__main__':
    sys.exit(run(EchoNode))
