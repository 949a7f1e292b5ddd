# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The files for ros2_control, and the relay, beside what does as ros2_control would.

ros2_control itself is not at hand here: what is known of it is from its documentation and source.
"""

import math
from pathlib import Path
import signal
import time
from xml.etree import ElementTree

import numpy as np
import pytest
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Float64MultiArray
import yaml

from dp_swing_ros.messages.fields import to_state
from dp_swing_ros.nodes.connections import DEADLINE
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import is_upright, joints
from dp_swing_ros.pendulum.urdf import urdf
from dp_swing_ros.topics import (
    COMMANDS, CONTROLLER_COMMANDS, FORCE_COMMAND, JOINT_STATES, VELOCITY_COMMAND)

CONFIG = Path(__file__).parents[2] / 'config'
ROBOT = ElementTree.parse(CONFIG / 'ros2_control.urdf').getroot()
SYSTEM = ROBOT.find('ros2_control')
GIVEN = {each.get('name'): each.text for each in SYSTEM.findall('hardware/param')}
CONTROLLERS = {name: section['ros__parameters'] for name, section in yaml.safe_load(
    (CONFIG / 'ros2_control.yaml').read_text()).items()}
RIG = '/rig'
KINDS = ('position', 'velocity', 'effort')   # of interfaces, and the fields of a JointState
# of JointStateTopicSystem, its README
PARAMETERS = {'joint_commands_topic', 'joint_states_topic', 'trigger_joint_command_threshold',
              'sum_wrapped_joint_states'}
# each controller's, its userdoc.rst
OF_TYPE = {'joint_state_broadcaster/JointStateBroadcaster': {'update_rate'},
           'forward_command_controller/ForwardCommandController': {'joints', 'interface_name'}}


def interfaces(kind):
    """Return the names of the joints with each interface, state or command."""
    return {name: [joint.get('name') for joint in SYSTEM.findall('joint')
                   if joint.find(f'{kind}_interface[@name="{name}"]') is not None]
            for name in KINDS}


class Ros2Control:
    """
    What controller manager, hardware and controllers do of it, by the files.

    JointStateTopicSystem, joint_state_broadcaster and forward_command_controller; then
    topic_tools' transform before the plant.
    """

    def __init__(self, peer):
        node, self.names = peer.node, [each.get('name') for each in SYSTEM.findall('joint')]
        rates = [CONTROLLERS[name]['update_rate'] for name in (
            'controller_manager', 'joint_state_broadcaster')]
        self.state = dict.fromkeys(KINDS, [np.nan] * len(self.names))
        self.force, self.n, self.every, self.sent = 0.0, 0, rates[0] // rates[1], []
        self.states = node.create_publisher(JointState, 'joint_states', 10)
        self.forces = node.create_publisher(Float64, f'{RIG}/{FORCE_COMMAND.name}', 10)
        node.create_subscription(
            JointState, GIVEN['joint_states_topic'], self.on_state,
            QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT))
        node.create_subscription(
            Float64MultiArray, 'force_controller/commands', self.on_command, 10)
        self.clock = node.get_clock()
        node.create_timer(1 / rates[0], self.update)

    def on_state(self, message):
        """Hear the hardware."""
        order = [list(message.name).index(name) for name in self.names]
        self.state = {kind: [getattr(message, kind)[i] for i in order] for kind in KINDS}

    def on_command(self, message):
        """Hear the relay; a command of another size is an error of the controller."""
        self.force, = message.data

    def update(self):
        """Read, update, write."""
        if np.isfinite(self.state['position']).all() and self.n % self.every == 0:
            message = JointState(name=self.names, **self.state)
            message.header.stamp = self.clock.now().to_msg()
            self.states.publish(message)
            self.sent.append(to_state(message, len(self.names) - 1))
        self.n += 1
        self.forces.publish(Float64(data=self.force))


def test_the_robot_is_ours():
    ours = ElementTree.fromstring(urdf(PendulumParameters(), LimitParameters()))
    assert [each.get('name') for each in ROBOT.findall('link')] == [
        each.get('name') for each in ours.findall('link')]
    for joint, other in zip(ROBOT.findall('joint'), ours.findall('joint'), strict=True):
        assert joint.attrib == other.attrib
        for tag in ('origin', 'parent', 'child', 'axis', 'limit', 'mimic'):
            found, expected = joint.find(tag), other.find(tag)
            assert (found is None) == (expected is None)
            assert found is None or found.attrib == expected.attrib


def test_the_hardware_is_a_plant_in_a_namespace():
    assert SYSTEM.find('hardware/plugin').text == (
        'joint_state_topic_hardware_interface/JointStateTopicSystem')
    assert set(GIVEN) <= PARAMETERS
    assert GIVEN['joint_states_topic'] == f'{RIG}/{JOINT_STATES.name}'
    assert float(GIVEN['trigger_joint_command_threshold']) < 0
    assert interfaces('state') == dict.fromkeys(KINDS, list(joints(2)))
    assert interfaces('command') == {'position': [], 'velocity': [], 'effort': ['cart']}


def test_the_controllers_fit_the_robot_and_the_relay():
    manager = CONTROLLERS['controller_manager']
    types = {name: each['type'] for name, each in manager.items() if name != 'update_rate'}
    assert set(CONTROLLERS) == {'controller_manager', *types}
    for name, kind in types.items():
        assert set(CONTROLLERS[name]) == OF_TYPE[kind]
    force = CONTROLLERS['force_controller']
    assert force['joints'] == interfaces('command')[force['interface_name']]
    assert CONTROLLER_COMMANDS['effort'].name == 'force_controller/commands'
    assert manager['update_rate'] % CONTROLLERS['joint_state_broadcaster']['update_rate'] == 0


def relayed(peer, start):
    """Start a relay; return it, what publishes forces that it hears, and when it sends which."""
    commands = []
    peer.node.create_subscription(
        Float64MultiArray, CONTROLLER_COMMANDS['effort'].name,
        lambda message, info: commands.append(
            (info['source_timestamp'] / 1e9, *message.data)), 1000)
    node = start('relay')
    node.wait_for('ready')
    forces = peer.publisher(FORCE_COMMAND)
    assert peer.until(lambda: commands)
    assert not any(force for _, force in commands)
    return node, forces, commands


def test_the_relay_hands_on_and_lets_go(peer, start_here):
    node, forces, commands = relayed(peer, start_here)
    for n in range(1, 11):
        published = time.time()
        forces.publish(Float64(data=float(n)))
        assert peer.until(lambda: commands[-1][1] == n)
        peer.spin(0.5 * DEADLINE)
    last = max(at for at, force in commands if force == 10.0)
    assert peer.until(lambda: commands[-1][1] == 0.0)
    let_go = next(at for at, force in commands if at > last and force == 0.0)
    # from before it was heard, for the relay may be held up before it hands it on
    assert let_go - published > DEADLINE
    assert [force for _, force in commands if force] == list(range(1, 11))


def test_the_relay_hands_no_force_on_that_is_none(peer, start_here):
    node, forces, commands = relayed(peer, start_here)
    forces.publish(Float64(data=math.nan))
    node.wait_for('expected a finite number')   # of several that wait it takes the last
    for force in (math.inf, -math.inf, 3.0):
        forces.publish(Float64(data=force))
        peer.spin(0.05)
    assert peer.until(lambda: 3.0 in [force for _, force in commands])
    assert {force for _, force in commands} <= {0.0, 3.0}


def test_the_last_command_of_the_relay_is_zero(peer, start_node):
    node, forces, commands = relayed(peer, start_node)
    forces.publish(Float64(data=7.0))
    assert peer.until(lambda: commands[-1][1] == 7.0)
    assert node.stop() == 0
    assert peer.until(lambda: commands[-1][1] == 0.0)


@pytest.mark.parametrize('interface', ['velocity', 'acceleration'])
def test_the_relay_hands_on_what_another_interface_takes(peer, start_here, interface):
    node = start_here('relay', {'interface': interface})
    node.wait_for('ready')
    sent = peer.record(CONTROLLER_COMMANDS[interface])
    commands = peer.publisher(COMMANDS[interface])
    assert peer.until(lambda: sent)   # a zero; what is sent to nobody is lost
    commands.publish(Float64(data=0.4))
    assert peer.until(lambda: [0.4] in [list(each.data) for each in sent])
    assert peer.until(lambda: list(sent[-1].data) == [0.0])   # where the next is overdue


def test_the_relay_integrates_for_positions_from_where_the_cart_is(peer, start_here):
    node = start_here('relay', {'interface': 'position', 'joint': 'slide'})
    node.wait_for('ready')
    sent = peer.record(CONTROLLER_COMMANDS['position'])
    commands, states = peer.publisher(VELOCITY_COMMAND), peer.publisher(JOINT_STATES)
    peer.meet('relay')
    commands.publish(Float64(data=1.0))
    peer.spin(2 * DEADLINE)
    assert not sent   # nobody has said where it is
    states.publish(JointState(name=['hip', 'slide'], position=[9.0, 0.3]))
    assert peer.until(lambda: sent)
    assert list(sent[0].data) == [0.3]
    began = time.monotonic()
    for _ in range(10):
        commands.publish(Float64(data=0.5))
        peer.spin(0.05)
    lasted = time.monotonic() - began
    place = sent[-1].data[0]
    assert 0.0 < place - 0.3 <= 0.5 * lasted
    peer.spin(3 * DEADLINE)
    assert peer.until(lambda: sent[-1].data[0] == sent[-2].data[0])
    stands = sent[-1].data[0]
    # and what the last one waited for, on a busy machine
    assert place <= stands <= 0.3 + 0.5 * (lasted + DEADLINE) + 0.1
    peer.spin(2 * DEADLINE)
    assert sent[-1].data[0] == stands


@pytest.mark.real_time
def test_through_what_ros2_control_does_the_pendulum_is_swung_up(peer, start_node):
    """And with the mpc killed, the plant's force is zero."""
    mpc = start_node('mpc')
    mpc.wait_for('ready')
    start_node('relay').wait_for('ready')
    manager = Ros2Control(peer)
    states = peer.record(JOINT_STATES._replace(name=f'{RIG}/{JOINT_STATES.name}'))
    start_node('plant', {'rate': 200.0}, ['-r', f'__ns:={RIG}'])
    assert peer.until(lambda: len(manager.sent) > 40 and is_upright(
        np.array(manager.sent[-20:])).all(), 120.0), mpc.output()
    assert peer.until(lambda: manager.force != 0.0)
    mpc.signal(signal.SIGKILL)
    assert peer.until(lambda: manager.force == 0.0, 4 * DEADLINE)
    assert peer.until(lambda: states[-1].effort[0] == 0.0)
