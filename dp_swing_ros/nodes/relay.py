# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The relay: hands the force on to a controller of ros2_control, and lets it go in silence."""

from functools import partial
import math

from std_msgs.msg import Float64, Float64MultiArray

from dp_swing_ros.nodes.connections import DEADLINE, publish, subscribe
from dp_swing_ros.nodes.process import ProcessNode, run
from dp_swing_ros.nodes.ros_parameters import declare
from dp_swing_ros.topics import CONTROLLER_COMMANDS, FORCE_COMMAND


class RelayNode(ProcessNode):
    """
    Sends a command for each force, and a zero where the next is overdue.

    A forward_command_controller obeys its last command for ever. So the watchdog is here, in a
    process that outlives the mpc.
    """

    def __init__(self) -> None:
        super().__init__('relay')
        declare(self, {})   # there are none: any that is given is refused
        self.commands = publish(self, CONTROLLER_COMMANDS)
        self.watchdog = self.every(DEADLINE, self.send_zero)
        subscribe(self, FORCE_COMMAND, self.on_force, depth=1)
        self.get_logger().info(f'ready, for {self.commands.topic_name}')

    def on_force(self, message: Float64) -> None:
        """Hand a force on, if it is one; what is none is as good as silence."""
        if not math.isfinite(message.data):
            self.get_logger().error(f'refused a force of {message.data}; expected a finite '
                                    'number [N]', once=True)
            return
        self.watchdog.reset()
        self.send(message.data)

    def send_zero(self) -> None:
        """Send a zero, and again until a force comes: a controller may start at any time."""
        self.send(0.0)

    def close(self) -> None:
        """Send a last zero."""
        self.send_zero()

    def send(self, force: float) -> None:
        """Publish a command of one joint [N]."""
        self.commands.publish(Float64MultiArray(data=[force]))


main = partial(run, RelayNode)
