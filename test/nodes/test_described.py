# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""An mpc as a process whose bodies are those of a robot description on the network."""

from rclpy.qos import DurabilityPolicy, QoSProfile
from rigs import RIG
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from dp_swing_ros.messages.configuration import from_text
from dp_swing_ros.topics import CONFIGURATION, FORCE_COMMAND

HANGING = JointState(name=['drive', 'shoulder', 'elbow'], position=[0.0] * 3, velocity=[0.0] * 3)


def test_it_waits_for_the_description_of_a_pendulum_and_keeps_to_it(peer, start_here):
    """From another topic, as robot_state_publisher publishes it; refused and later ones, too."""
    publisher = peer.node.create_publisher(String, '/rig/description', QoSProfile(
        depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    states, forces = peer.node.create_publisher(JointState, 'joint_states', 10), peer.record(
        FORCE_COMMAND)
    told = peer.record(CONFIGURATION)
    publisher.publish(String(data='<robot name="arm"><link name="base"/></robot>'))
    mpc = start_here('mpc', {'bodies': 'description', 'force_limit': 9.0, 'clock': 'lockstep'},
                     ['-r', 'robot_description:=/rig/description'])
    mpc.wait_for('0 prismatic joints')
    states.publish(HANGING)
    peer.spin(0.5)
    assert not told and not peer.node.count_publishers(FORCE_COMMAND.name)
    publisher.publish(String(data=RIG))
    mpc.wait_for('ready')
    assert peer.until(lambda: told and states.get_subscription_count())
    values = from_text(told[-1].data).parameters
    assert (values['link1_mass'], values['joint_offsets'][0]) == (0.15, 0.1)
    assert values['force_limit'] == 9.0   # its own, which is less

    def answered():
        states.publish(HANGING)
        HANGING.header.stamp.sec += 1
        peer.spin(0.1)
        return forces
    assert peer.until(answered) and 0 < abs(forces[0].data) <= 9.0
    publisher.publish(String(data=RIG.replace('mass value="0.1"', 'mass value="0.11"')))
    mpc.wait_for('link2_mass is 0.11 now, it was 0.1')
    assert mpc.stop() == 0
    said = mpc.output()
    assert said.count('waiting for a robot description on /rig/description') == 1
    assert said.count('the robot description gives links 2') == 1 and 'elbow has ends' in said


def test_a_signal_ends_it_while_it_waits(start_node):
    mpc = start_node('mpc', {'bodies': 'description', 'controlled_stop': 3.0})
    mpc.wait_for('waiting for a robot description on /robot_description')
    assert mpc.stop() == 0
    assert 'Traceback' not in mpc.output()
