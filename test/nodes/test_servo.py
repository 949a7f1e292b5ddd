# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The mpc beside a servo: a bare node that takes velocities, and shares nothing with it."""

import time

import numpy as np
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String
from std_srvs.srv import SetBool

from dp_swing_ros.messages.configuration import Configuration
from dp_swing_ros.simulation import plants
from dp_swing_ros.topics import CONFIGURATION

PERIOD = 0.05   # [s]
RIG = {'drive': 'velocity', 'acceleration_limit': 5.0, 'cart_speed_limit': 0.8}


class Servo:
    """Publishes positions, follows velocities, and records what it is told."""

    def __init__(self, peer):
        self.peer, self.node, self.plant = peer, peer.node, plants.plant(RIG)
        self.states = self.node.create_publisher(JointState, 'joint_states', 10)
        self.velocities, self.stamped, self.forces = [], [], []
        for kind, name, into in ((Float64, 'velocity_command', self.velocities),
                                 (JointState, 'velocity_command_stamped', self.stamped),
                                 (Float64, 'force_command', self.forces)):
            self.node.create_subscription(kind, name, into.append, 10)
        counted = self.node.count_publishers
        assert peer.until(lambda: self.states.get_subscription_count() and counted(
            'velocity_command') and counted('velocity_command_stamped'))
        peer.meet('mpc')

    def move(self, count):
        """Publish so many states, and follow what is answered, in real time."""
        for _ in range(count):
            before = len(self.velocities)
            message = JointState(name=['cart', 'joint1', 'joint2'],
                                 position=self.plant.x[:3].tolist())
            message.header.stamp = self.node.get_clock().now().to_msg()
            self.states.publish(message)
            began = time.monotonic()
            self.peer.until(lambda: len(self.velocities) > before, 1.0)
            if self.velocities:
                self.plant.obey(self.velocities[-1].data)
            self.plant.advance(PERIOD)
            self.peer.spin(began + PERIOD - time.monotonic())


def test_a_servo_is_told_velocities_and_zero_at_the_end(peer, start_here):
    mpc = start_here('mpc', RIG)
    mpc.wait_for('ready')
    servo = Servo(peer)
    servo.move(30)
    assert peer.until(lambda: len(servo.velocities) >= 30 and servo.stamped)
    told = np.array([each.data for each in servo.velocities])
    assert np.abs(told).max() > 0.05 and np.abs(told).max() <= 0.8
    assert np.abs(np.diff(told)).max() <= 5.0 * 0.5   # within what a few periods allow
    assert not servo.forces and abs(servo.plant.x[0]) > 0.01
    # a JointState by which those go that want the stamp of the state that is answered
    last = servo.stamped[-1]
    assert list(last.name) == ['cart'] and not last.effort
    assert last.velocity[0] in told
    assert peer.call(SetBool, 'mpc/enable', data=False).success
    servo.move(5)
    assert servo.velocities[-1].data == 0.0 and abs(servo.plant.x[3]) < 0.3
    assert peer.call(SetBool, 'mpc/enable', data=True).success
    servo.move(8)
    mpc.stop()
    assert peer.until(lambda: servo.velocities[-1].data == 0.0)


def test_an_mpc_tells_of_a_plant_that_takes_other_commands(peer, start_here):
    mpc = start_here('mpc', RIG)
    mpc.wait_for('ready')
    publisher = peer.publisher(CONFIGURATION)
    publisher.publish(String(data=Configuration(
        '/plant', {**plants.PLANT.complete({}), 'initial_state': [0.0] * 6}, '', '', '', '',
        {}).to_text()))
    mpc.wait_for("the drive of the plant is 'force', and commands are for 'velocity'")
