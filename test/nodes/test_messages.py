# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

from builtin_interfaces.msg import Duration
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from dp_swing_ros.messages.cdr import to_diagnostics, to_trajectory
from dp_swing_ros.messages.fields import (
    from_diagnostics, from_trajectory, nanoseconds, seconds, to_force, to_state)
from dp_swing_ros.nodes.messages import to_joint_state, to_stamp
from dp_swing_ros.pendulum.state import joints
from dp_swing_ros.problem.plan import Plan, SolverStats, Status

STAMP = to_stamp(1_795_225_249_631_521_481)
X = np.array([0.1, -0.2, 3.0, 0.4, -5.0, 6.0])


def sent(message, kind=None):
    """Return the message, or one of a kind in bytes, as it arrives."""
    data = message if kind else serialize_message(message)
    return deserialize_message(data, kind or type(message))


def test_state_comes_back_to_the_bit():
    message = sent(to_joint_state(STAMP, X, 7.5))
    assert np.array_equal(to_state(message, 2), X)
    assert to_force(message) == 7.5
    assert list(message.effort) == [7.5, 0.0, 0.0]   # the joints are free
    assert nanoseconds(message.header.stamp) == 1_795_225_249_631_521_481


def test_joints_are_found_by_name():
    message = JointState(name=['joint2', 'wheel', 'cart', 'joint1'],
                         position=[3.0, 9.0, 1.0, 2.0], velocity=[6.0, 9.0, 4.0, 5.0])
    assert to_state(message, 2).tolist() == [1, 2, 3, 4, 5, 6]
    assert np.isnan(to_force(message))
    message.effort = [0.3, 0.9, 7.5, 0.2]
    assert to_force(message) == 7.5


def test_nan_is_left_to_the_controller():
    assert np.isnan(to_state(to_joint_state(STAMP, np.full(6, np.nan), 0.0), 2)).all()


@pytest.mark.parametrize('fields, text', [
    ({'name': ['cart', 'joint1']}, 'has no joint2'),
    ({'name': ['cart', 'joint1', 'joint2'], 'position': [0.0] * 3, 'velocity': [0.0]},
     'velocity has 1 numbers'),
    ({'name': ['cart', 'joint1', 'joint2'], 'velocity': [0.0] * 3}, 'position has 0 numbers'),
])
def test_incomplete_state_is_refused(fields, text):
    with pytest.raises(ValueError, match=text):
        to_state(JointState(**fields), 2)


def test_plan_comes_back_to_the_bit():
    random = np.random.default_rng(0)
    plan = Plan(X=random.normal(size=(31, 6)), U=random.normal(size=30), K=np.zeros((30, 6)),
                dt=0.05, stats=SolverStats(Status.CONVERGED, 1.0, 2, 0.001))
    message = sent(to_trajectory(plan, STAMP), JointTrajectory)
    t, states, forces = from_trajectory(message)
    assert np.array_equal(states, plan.X)
    assert np.array_equal(forces, plan.U)
    assert np.array_equal(t, np.round(np.arange(31) * 0.05, 9))
    assert list(message.points[-1].effort) == [0, 0, 0]


@pytest.mark.parametrize('links', [1, 2, 3])
def test_the_bytes_of_a_plan_are_those_that_ros_makes_of_the_message(links):
    size, random = 2 * links + 2, np.random.default_rng(0)
    plan = Plan(random.normal(size=(31, size)), random.normal(size=30), np.zeros((30, size)), 0.05,
                SolverStats(Status.CONVERGED, 1.0, 2, 0.001))
    names = joints(links)
    message = JointTrajectory(
        header=Header(stamp=STAMP), joint_names=list(names), points=[JointTrajectoryPoint(
            positions=x[:len(names)], velocities=x[len(names):], effort=[force, *[0.0] * links],
            time_from_start=Duration(sec=50 * t // 1000, nanosec=50 * t % 1000 * 1_000_000))
            for t, (x, force) in enumerate(zip(plan.X.tolist(), [*plan.U.tolist(), 0.0]))])
    data = to_trajectory(plan, STAMP)
    assert deserialize_message(data, JointTrajectory) == message
    assert sent(message) == message
    # rclpy leaves what is between the fields as it was, and room at the end
    ours, theirs = (np.frombuffer(each[:len(data)], np.uint8)
                    for each in (data, bytes(serialize_message(message))))
    assert np.array_equal(ours[ours != 0], theirs[ours != 0])


@pytest.mark.parametrize('name', ['mpc', 'mpcs', 'second/mpc', 'zweiter_Wagen_ä/mpc'])
def test_the_bytes_of_a_report_are_those_that_ros_makes_of_the_message(name):
    values = {'a': 'b', 'ab': 'äöü', 'abc': '', 'abcd': '12345'}
    message = DiagnosticArray(header=Header(stamp=STAMP), status=[DiagnosticStatus(
        level=b'\2', name=name, message='two words', hardware_id='/joint_states',
        values=[KeyValue(key=key, value=value) for key, value in values.items()])])
    data = to_diagnostics(STAMP, name, 2, 'two words', values, '/joint_states')
    assert deserialize_message(data, DiagnosticArray) == message
    theirs = bytes(serialize_message(message))
    assert abs(len(data) - len(theirs)) < 4   # what follows the last string is nothing


def test_reports_keep_their_numbers():
    values = {'solver': 'mppi', 'cost': 0.1, 'iterations': np.int64(3), 'late': True,
              'latency': np.float64(1 / 3), 'worst': np.inf}
    message = sent(to_diagnostics(STAMP, 'mpc', 1, 'late', values), DiagnosticArray)
    report = from_diagnostics(message, 'mpc')
    assert report.values == values
    assert (report.stamp, report.level, report.message) == (nanoseconds(STAMP), 1, 'late')
    assert from_diagnostics(message, 'plant') is None


@pytest.mark.parametrize('name, hardware, found', [
    ('mpc', '', True), ('mpc', '/joint_states', True), ('second/mpc', '/joint_states', True),
    ('mpc', '/second/joint_states', False), ('second/mpc', '/second/joint_states', False),
    ('second/mpc', '', False), ('plant', '/joint_states', False)])
def test_of_several_controllers_that_of_the_pendulum_is_read(name, hardware, found):
    message = sent(to_diagnostics(STAMP, name, 0, '', {}, hardware), DiagnosticArray)
    assert (from_diagnostics(message, 'mpc', '/joint_states') is not None) == found


@pytest.mark.parametrize('time', [0, 1, 999_999_999, 1_000_000_000, 1_795_225_249_631_521_481])
def test_times_are_exact(time):
    assert nanoseconds(to_stamp(time)) == time
    assert seconds(to_stamp(time)) == time / 1e9


def test_seconds_round_to_the_nanosecond():
    assert nanoseconds(to_stamp(1.1)) == 1_100_000_000


def test_velocities_that_are_not_measured_are_left_out():
    x = np.array([0.1, -0.2, 3.0, np.nan, np.nan, np.nan])
    message = sent(to_joint_state(STAMP, x, 7.5))
    assert list(message.velocity) == []
    assert list(message.position) == [0.1, -0.2, 3.0]
    assert list(message.name) == ['cart', 'joint1', 'joint2']
    np.testing.assert_array_equal(to_state(message, 2), x)
