# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bags of other people: more robots on the topic, and nodes of other names."""

import pytest
from rclpy.serialization import serialize_message
from real_bags import again, renamed, shared
from sensor_msgs.msg import JointState

from dp_swing_ros.bags.episodes import configurations_of, episode_of, reports_of, samples_of
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.errors import BagError
from dp_swing_ros.identification.recorded import recorded
from dp_swing_ros.rerun.counterfactual import Run
from dp_swing_ros.rerun.ticks import record_of
from dp_swing_ros.tools import compare, verify

GRIPPER = ['left_finger', 'right_finger']
OURS = ['cart', 'joint1', 'joint2']
NAMES = {'plant': 'driver', 'mpc': 'left_controller'}


def seen(bag):
    """Return what all that read a bag begin with."""
    record, motion, run = record_of(bag), recorded(bag), Run(bag)
    assert len(record.ticks) > 50 and not record.gap
    return ([str(each) for each in samples_of(bag)], reports_of(bag), motion.times,
            motion.motion.t.tolist(), motion.motion.commands.tolist(), run.sent, run.plant,
            episode_of(bag).ticks.cost.tolist())


@pytest.fixture(scope='module')
def expected(lockstep_bag):
    """Return what is seen of a run that was alone."""
    return seen(Bag(lockstep_bag))


@pytest.mark.parametrize('message, count', [
    (JointState(name=GRIPPER, position=[0.0, 0.0]), 5),
    (JointState(name=GRIPPER, position=[0.0, 0.0]), 1),
    (JointState(name=['joint1', 'joint2', 'joint3'], position=[0.0] * 3), 1),
    (JointState(name=OURS, position=[0.0] * 3, velocity=[0.0] * 3), 1),
    (JointState(name=OURS, position=[0.0] * 3, velocity=[0.0] * 3), 3)])
def test_messages_of_other_robots_and_of_a_second_publisher_change_nothing(
        lockstep_bag, expected, tmp_path, message, count):
    assert seen(Bag(shared(lockstep_bag, tmp_path / 'bag', message, count))) == expected


def test_states_that_came_twice_are_one(lockstep_bag, expected, tmp_path):
    """As through two bridges, of which each numbers its own."""
    twice = again(lockstep_bag, tmp_path / 'bag', lambda entry: [entry] * (
        1 + (entry.topic == '/joint_states')))
    assert seen(Bag(twice)) == expected


def test_a_bag_of_another_robot_alone_is_refused(lockstep_bag, tmp_path):
    def others(entry):
        return [entry._replace(stored=data)] if entry.topic == '/joint_states' else [entry]
    data = serialize_message(JointState(name=GRIPPER, position=[0.0, 0.0]))
    with pytest.raises(BagError, match='JointState has no cart, joint1, joint2; it names'):
        samples_of(Bag(again(lockstep_bag, tmp_path / 'bag', others)))


def test_nodes_are_known_by_what_they_announced(lockstep_bag, expected, tmp_path, capsys):
    bag = renamed(lockstep_bag, tmp_path / 'bag', NAMES)
    assert seen(Bag(bag)) == expected
    found = configurations_of(Bag(bag))
    assert {role: each.node for role, each in found.items()} == {
        'plant': '/driver', 'mpc': '/left_controller', 'logger': '/logger'}
    assert verify.main([str(bag)]) == 0
    assert 'the whole run' in capsys.readouterr().out
    assert compare.main([str(bag), '--duration', '0.2', '--solvers', 'ilqr', '--output',
                         str(tmp_path)]) == 0


def test_without_an_announcement_ticks_are_known_by_their_figures(lockstep_bag, tmp_path):
    bag = again(renamed(lockstep_bag, tmp_path / 'renamed', NAMES), tmp_path / 'bag',
                lambda entry: [entry] * (entry.topic != '/configuration'))
    assert reports_of(Bag(bag)) == reports_of(Bag(lockstep_bag))


@pytest.mark.parametrize('tool', [verify, compare])
def test_of_two_controllers_one_must_be_chosen(lockstep_bag, tmp_path, capsys, tool):
    one, other = (Bag(renamed(lockstep_bag, tmp_path / name, {'mpc': name}))
                  for name in ('left', 'right'))
    added = [entry for entry in other.entries if entry.topic == '/configuration']
    bag = again(one.path, tmp_path / 'bag', lambda entry: [entry, *(
        added if entry[1:] == one.entries[0][1:] else [])])
    assert tool.main([str(bag)]) == 2
    error = capsys.readouterr().err
    assert '2 nodes of the kind mpc: /left, /right' in error and '--node /left' in error
    assert tool.main([str(bag), '--node', '/nobody']) == 2
    assert 'has no node /nobody, but /' in capsys.readouterr().err
    assert verify.main([str(bag), '--node', 'left']) == 0
