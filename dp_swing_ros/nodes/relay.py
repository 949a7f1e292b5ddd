# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The relay: hands commands on to a controller of ros2_control, and lets it go in silence."""

from functools import partial
import math
import time

from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray

from dp_swing_ros.nodes.connections import DEADLINE, publish, subscribe
from dp_swing_ros.nodes.process import ProcessNode, run
from dp_swing_ros.nodes.ros_parameters import declare
from dp_swing_ros.parameters import named
from dp_swing_ros.parameters.nodes import POSITION, RELAYED, RelayParameters
from dp_swing_ros.topics import COMMANDS, CONTROLLER_COMMANDS, JOINT_STATES


class RelayNode(ProcessNode):
    """
    Sends a command for each that the mpc sends, and a zero where the next is overdue.

    A forward_command_controller obeys its last command for ever. So the watchdog is here, in a
    process that outlives the mpc. Where the controller takes positions, they are the integral of
    the velocities from where the cart was seen first, and the last one stays.
    """

    def __init__(self) -> None:
        super().__init__('relay')
        self.parameters = RelayParameters(**declare(self, named(RelayParameters)))
        interface = self.parameters.interface
        self.commands = publish(self, CONTROLLER_COMMANDS[interface])
        self.watchdog = self.every(DEADLINE, self.send_zero)
        self.command, self.since = 0.0, time.monotonic()   # the last one, and when it came [s]
        self.place: float | None = None                    # [m] of the cart, as it is told
        heard = subscribe(self, COMMANDS[RELAYED[interface]], self.on_command, depth=1)
        if interface == POSITION:
            subscribe(self, JOINT_STATES, self.on_state, depth=1, sensor=True)
        self.get_logger().info(f'ready, for {self.commands.topic_name} from {heard.topic_name}')

    def on_state(self, message: JointState) -> None:
        """Take where the cart is at first."""
        joints = dict(zip(message.name, message.position))
        if self.place is None and math.isfinite(joints.get(self.parameters.joint, math.nan)):
            self.place = joints[self.parameters.joint]

    def on_command(self, message: Float64) -> None:
        """Hand a command on, if it is one; what is none is as good as silence."""
        if not math.isfinite(message.data):
            self.get_logger().error(f'refused a command of {message.data}; expected a finite '
                                    'number', once=True)
            return
        self.watchdog.reset()
        self.send(message.data)

    def send_zero(self) -> None:
        """Send a zero, and again until a command comes: a controller may start at any time."""
        self.send(0.0)

    def close(self) -> None:
        """Send a last zero."""
        self.send_zero()

    def send(self, command: float) -> None:
        """Publish a command for one joint, or where one of velocities has brought it."""
        if self.parameters.interface == POSITION:
            now = time.monotonic()
            if self.place is None:   # nobody knows where it is
                return
            self.place += self.command * min(now - self.since, DEADLINE)
            self.command, self.since, command = command, now, self.place
        self.commands.publish(Float64MultiArray(data=[command]))


main = partial(run, RelayNode)
