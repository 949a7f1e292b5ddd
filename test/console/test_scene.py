# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the page is sent where others say what no pendulum of ours would."""

import json
import math

from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import pytest
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Header, String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from dp_swing_ros.console.scene import MOST, Scene
from dp_swing_ros.messages.configuration import Configuration
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.urdf import urdf
from dp_swing_ros.topics import (
    CONFIGURATION, DIAGNOSTICS, JOINT_STATES, PLAN, ROBOT_DESCRIPTION, TRIES)

HEADER = Header(stamp=Time(sec=7))
URDF = urdf(PendulumParameters(), LimitParameters())


def announced(node='plant', **parameters):
    sign = {'lockstep': False} if node == 'plant' else {}
    return String(data=Configuration(
        f'/{node}', {**sign, **parameters}, '', '', '', '', {}).to_text())


def point(size=3, t=0.0, effort=True):
    return JointTrajectoryPoint(
        positions=[1.0] * size, velocities=[2.0] * size, effort=[3.0] * (size if effort else 0),
        time_from_start=Duration(nanosec=round(t * 1e9)))


def planned(*points):
    return JointTrajectory(header=HEADER, points=list(points))


def cloud(height=2, width=3, size=None, value=b'\0\0\x80?'):
    return PointCloud2(header=HEADER, height=height, width=width,
                       data=value * (4 * height * width if size is None else size))


def said(**values):
    return DiagnosticArray(header=HEADER, status=[DiagnosticStatus(
        name='mpc', hardware_id='/joint_states', level=b'\0',
        values=[KeyValue(key=key, value=value) for key, value in values.items()])])


def everything(scene):
    """Return all that a page is sent, as it would be."""
    return json.dumps([scene.frame(), scene.about(), scene.status()], allow_nan=False)


@pytest.fixture
def scene():
    """Return a scene that has heard of everything."""
    scene = Scene()
    for topic, message in (
            (CONFIGURATION, announced(rate=50.0, disturbance_limit=5.0)),
            (ROBOT_DESCRIPTION, String(data=URDF)),
            (JOINT_STATES, JointState(header=HEADER, name=['cart', 'joint1', 'joint2'],
                                      position=[0.1, 0.2, 0.3], velocity=[0.0] * 3)),
            (PLAN, planned(point(), point(t=0.05))), (TRIES, cloud()),
            (DIAGNOSTICS, said(estimate_cart_position='0.1', solver='ilqr'))):
        scene.hear(topic, message)
    return scene


def test_what_is_heard_is_shown(scene):
    frame = scene.frame()
    assert frame['plan'] == {'t': 7.0, 'dt': 0.05, 'X': [[1, 1, 1, 2, 2, 2]] * 2, 'U': [3.0]}
    assert frame['tries'] == {'paths': [[[1.0, 1.0]] * 3] * 2, 'weights': [1.0, 1.0]}
    assert (scene.period, scene.about()['limits']['disturbance']) == (0.02, 5.0)


@pytest.mark.parametrize('topic, message', [
    (PLAN, planned()), (PLAN, planned(point())), (PLAN, planned(point(), point(2, 0.05))),
    (PLAN, planned(point(effort=False), point(t=0.05))), (PLAN, planned(*[point()] * 10_001)),
    (PLAN, planned(point(0), point(0))), (PLAN, planned(point(1), point(1, 0.05))),
    (TRIES, cloud(size=1)), (TRIES, cloud(size=0)), (TRIES, cloud(size=18)),
    (TRIES, cloud(2 ** 31, 2 ** 31, 0)), (TRIES, cloud(3000, 1)),
    *((CONFIGURATION, announced(rate=rate)) for rate in (
        0.0, 'abc', math.nan, math.inf, 1e300, [20.0], True, {'a': 1}, None)),
    (CONFIGURATION, announced(disturbance_limit=[[1.0]])),
    (CONFIGURATION, announced('mpc', links=2.5)), (CONFIGURATION, announced('mpc', links=10 ** 9)),
    (CONFIGURATION, announced('mpc', joint_names=5)), (CONFIGURATION, String(data='[[[')),
    (ROBOT_DESCRIPTION, String(data=URDF.replace('mass value="0.5"', 'mass value="0"'))),
    (ROBOT_DESCRIPTION, String(data='<robot/>')),
    (JOINT_STATES, JointState(header=HEADER, name=['finger'], position=[0.1]))],
    ids=lambda each: getattr(each, 'name', ''))
def test_what_is_none_of_this_pendulum_leaves_all_as_it_is(scene, topic, message):
    before = everything(scene)
    with pytest.raises(ValueError, match=f'a message on {topic.name} is none of this pendulum'):
        scene.hear(topic, message)
    assert everything(scene) == before


@pytest.mark.parametrize('topic, message', [
    (TRIES, cloud(0, 5)), (TRIES, cloud(value=b'\0\0\xc0\x7f')),
    (DIAGNOSTICS, said(**{f'estimate_{joint}_{kind}': 'x' for joint in ('cart', 'joint1', 'joint2')
                          for kind in ('position', 'velocity')}, cost='nan', force='9' * 5000,
                       solve_time='9' * 400)),
    (CONFIGURATION, announced('replay', rate=0.001)),   # times, not hertz
    (CONFIGURATION, announced('mpc', track_margin='wide')), (DIAGNOSTICS, DiagnosticArray())],
    ids=lambda each: getattr(each, 'name', ''))
def test_what_is_strange_is_shown_as_far_as_it_can_be(scene, topic, message):
    scene.hear(topic, message)
    everything(scene)
    assert scene.frame()['x'] == [0.1, 0.2, 0.3, 0.0, 0.0, 0.0]


def test_of_the_statuses_of_many_robots_the_newest_are_kept(scene):
    for n in range(2 * MOST):
        scene.hear(DIAGNOSTICS, DiagnosticArray(status=[DiagnosticStatus(name=f'{n}')]))
    names = [each['name'] for each in scene.status()['statuses']]
    assert len(names) == MOST
    assert f'{2 * MOST - 1}' in names
