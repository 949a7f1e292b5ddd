# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bags of pendulums of one, two and three links, and of robots with more joints."""

import numpy as np
import pytest
from rclpy.serialization import serialize_message
from recorded_runs import told
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from dp_swing_ros.bags.episodes import links_of, samples_of
from dp_swing_ros.bags.metadata import Recorded
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.bags.tables import plans_of, states_of
from dp_swing_ros.bags.writer import BagWriter
from dp_swing_ros.errors import BagError
from dp_swing_ros.messages.definitions import schema
from dp_swing_ros.nodes.messages import to_stamp
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import joints, LINKS, SIZES
from dp_swing_ros.pendulum.urdf import urdf
from dp_swing_ros.topics import CONFIGURATION, JOINT_STATES, ROBOT_DESCRIPTION

THREE = joints(3)


def write(folder, names, texts=()):
    """Write ten states of these joints and texts on topics; return the bag."""
    writer = BagWriter(folder)
    for topic in [JOINT_STATES, *dict(texts)]:
        writer.add(Recorded(topic.name, topic.type, schema(topic.type), '', []))
    for topic, text in texts:
        writer.write(topic.name, serialize_message(String(data=text)), 1, 1)
    for n in range(10):
        state = JointState(name=list(names), position=[n + 0.1 * i for i in range(len(names))],
                           velocity=[-n - 0.1 * i for i in range(len(names))])
        state.header.stamp = to_stamp(n)
        writer.write(JOINT_STATES.name, serialize_message(state), n, n)
    writer.close()
    return Bag(folder)


@pytest.mark.parametrize('links', LINKS)
def test_states_and_tables_have_the_links_of_their_bag(links, tmp_path):
    bag = write(tmp_path / 'bag', joints(links))
    assert links_of(bag) == links
    states = np.array([sample.x for sample in samples_of(bag)])
    assert states.shape == (10, SIZES[links])
    frame = states_of(bag, whole_turns=True)
    angles = [f'theta{i}' for i in range(1, links + 1)]
    names = ['x [m]', *(f'{angle} [rad]' for angle in angles), 'x_dot [m/s]',
             *(f'{angle}_dot [rad/s]' for angle in angles)]
    assert list(frame)[2:-1] == names
    np.testing.assert_array_equal(frame[names], states)
    assert set(names) < set(plans_of(bag))


@pytest.mark.parametrize('node', ['plant', 'mpc'])
@pytest.mark.parametrize('links', LINKS)
def test_what_a_node_was_configured_with_decides(node, links, tmp_path):
    text = told(node, {'links': links}).to_text()
    assert links_of(write(tmp_path / 'bag', THREE, [(CONFIGURATION, text)])) == links


@pytest.mark.parametrize('links', [1, 3])
def test_sensors_of_another_number_of_links_are_refused(links, tmp_path):
    """Their states would be of one size, and what is computed with them of another."""
    text = told('mpc', {'links': links, 'joint_names': list(joints(2))}).to_text()
    bag = write(tmp_path / 'bag', joints(2), [(CONFIGURATION, text)])
    with pytest.raises(BagError, match=f'is of {links} links, but its mpc announced 3 '
                       f'joint_names; expected {links + 1}'):
        samples_of(bag)


@pytest.mark.parametrize('links', LINKS)
def test_without_it_the_description_decides(links, tmp_path):
    description = urdf(PendulumParameters(links=links), LimitParameters())
    assert links_of(write(tmp_path / 'bag', THREE, [(ROBOT_DESCRIPTION, description)])) == links


def test_a_description_of_another_robot_decides_nothing(tmp_path):
    assert links_of(write(tmp_path / 'bag', THREE, [(ROBOT_DESCRIPTION, '<robot/>')])) == 3


def test_another_number_of_links_is_one_line(tmp_path):
    text = told('plant', {'links': 4}).to_text()
    with pytest.raises(BagError, match="'links' is 4; expected at least 1, at most 3"):
        samples_of(write(tmp_path / 'bag', THREE, [(CONFIGURATION, text)]))
