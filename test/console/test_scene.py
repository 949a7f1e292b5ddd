# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the page is sent where others say what no pendulum of ours would."""

import dataclasses
import itertools
import json
import math

from builtin_interfaces.msg import Duration, Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import numpy as np
import pytest
from sensor_msgs.msg import JointState, PointCloud2
from std_msgs.msg import Float64, Header, String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from dp_swing_ros.console import history
from dp_swing_ros.console.history import Entry, History
from dp_swing_ros.console.scene import MOST, Scene, STALE
from dp_swing_ros.messages.configuration import Configuration
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import LINKS
from dp_swing_ros.pendulum.urdf import urdf
from dp_swing_ros.topics import (
    CONFIGURATION, DIAGNOSTICS, FORCE_COMMAND, JOINT_STATES, PLAN, ROBOT_DESCRIPTION, TRIES)

HEADER = Header(stamp=Time(sec=7))
URDF = urdf(PendulumParameters(), LimitParameters())


def announced(node='plant', resets=0, **parameters):
    sign = {'lockstep': False} if node == 'plant' else {}
    return String(data=Configuration(
        f'/{node}', {**sign, **parameters}, '', '', '', '', {}, resets, 0, resets).to_text())


def at(t):
    return Header(stamp=Time(sec=int(t), nanosec=round(t % 1 * 1e9)))


def state(t):
    return JointState(header=at(t), name=['cart', 'joint1', 'joint2'],
                      position=[0.1, 0.2, 0.3], velocity=[0.0] * 3, effort=[t, 0.0, 0.0])


def point(size=3, t=0.0, effort=True):
    return JointTrajectoryPoint(
        positions=[1.0] * size, velocities=[2.0] * size, effort=[3.0] * (size if effort else 0),
        time_from_start=Duration(nanosec=round(t * 1e9)))


def planned(*points, header=HEADER):
    return JointTrajectory(header=header, points=list(points))


def cloud(height=2, width=3, size=None, value=b'\0\0\x80?'):
    return PointCloud2(header=HEADER, height=height, width=width,
                       data=value * (4 * height * width if size is None else size))


def said(name='mpc', header=HEADER, **values):
    return DiagnosticArray(header=header, status=[DiagnosticStatus(
        name=name, hardware_id='/joint_states', level=b'\0',
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
            (JOINT_STATES, state(7.0)),
            (PLAN, planned(point(), point(t=0.05))), (TRIES, cloud()),
            (DIAGNOSTICS, said(estimate_cart_position='0.1', solver='ilqr'))):
        scene.hear(topic, message)
    return scene


def test_what_is_heard_is_shown(scene):
    frame = scene.frame()
    assert frame['plan'] == {'t': 7.0, 'dt': 0.05, 'X': [[1, 1, 1, 2, 2, 2]] * 2, 'U': [3.0]}
    assert frame['tries'] == {'paths': [[[1.0, 1.0]] * 3] * 2, 'weights': [1.0, 1.0]}
    assert (scene.period, scene.about()['limits']['disturbance']) == (0.02, 5.0)


@pytest.mark.parametrize('drive, units, limit', [
    ('force', {'force': 'N', 'command': 'N'}, 20.0),
    ('voltage', {'force': 'N', 'command': 'V'}, None),
    ('velocity', {'force': 'm/s^2', 'command': 'm/s'}, 7.0)])
def test_numbers_have_the_units_of_the_drive(scene, drive, units, limit):
    limits = LimitParameters(force_limit=20.0, acceleration_limit=7.0)
    scene.hear(ROBOT_DESCRIPTION, String(data=urdf(PendulumParameters(drive=drive), limits)))
    assert scene.about()['units'] == units
    assert scene.about()['limits']['force'] == limit


def test_a_rig_that_names_no_drive_has_that_of_its_controller():
    scene, description = Scene(), String(data=urdf(PendulumParameters(), LimitParameters()))
    scene.hear(CONFIGURATION, announced('mpc', drive='velocity', links=2))
    scene.hear(ROBOT_DESCRIPTION, description)
    assert scene.about()['units']['command'] == 'm/s'
    scene.hear(CONFIGURATION, announced('plant'))
    scene.hear(ROBOT_DESCRIPTION, description)   # which would name another
    assert scene.about()['units']['command'] == 'N'


@pytest.mark.parametrize('order', itertools.permutations(range(3)))
def test_who_is_described_is_drawn_whatever_was_heard_first(order):
    physical = PendulumParameters(link1_length=0.8)
    said = ((ROBOT_DESCRIPTION, String(data=urdf(physical, LimitParameters()))),
            (CONFIGURATION, announced('mpc', links=2, horizon=30, solver='ilqr')),
            (CONFIGURATION, announced('plant')))
    scene = Scene()
    for n in order:
        scene.hear(*said[n])
    assert scene.about()['lengths'] == [0.8, 1.0]
    scene.hear(*said[1])   # of which a parameter has changed
    assert scene.about()['lengths'] == [0.8, 1.0]


def test_a_rig_without_a_description_is_as_its_controller_is_told():
    scene = Scene()
    scene.hear(CONFIGURATION, announced('mpc', links=1, link1_length=0.4))
    assert (scene.about()['links'], scene.about()['lengths']) == (1, [0.4])


@pytest.mark.parametrize('links', LINKS)
def test_a_pendulum_of_which_nobody_has_said_anything_has_as_many_links_as_its_states(links):
    scene = Scene()
    names = ['cart', *(f'joint{n + 1}' for n in range(links))]
    still = [0.0] * (links + 1)
    scene.hear(JOINT_STATES, JointState(header=HEADER, name=names, position=still, velocity=still,
                                        effort=still))
    assert scene.about()['links'] == len(scene.about()['lengths']) == links


def test_the_joints_of_a_controller_that_was_of_another_pendulum_do_not_count():
    scene = Scene()
    scene.hear(CONFIGURATION, announced('mpc', links=2, joint_names=['slide', 'hip', 'knee'],
                                        joint_signs=[1.0] * 3, joint_offsets=[0.0] * 3))
    scene.hear(CONFIGURATION, announced('plant', links=1))
    scene.hear(JOINT_STATES, JointState(header=HEADER, name=['cart', 'joint1'],
                                        position=[0.1, 0.2], velocity=[0.0] * 2, effort=[0.0] * 2))
    assert scene.frame()['x'] == [0.1, 0.2, 0.0, 0.0]


def test_a_small_pendulum_is_shown_as_large(scene):
    assert scene.about()['scale'] == {'length': 1.0, 'time': 1.0, 'force': 1.0}
    assert scene.about()['cart'] == [0.44, 0.22]
    physical = PendulumParameters(link1_length=0.04, link2_length=0.04, cart_mass=0.1,
                                  link1_mass=0.05, link2_mass=0.05)
    scene.hear(ROBOT_DESCRIPTION, String(data=urdf(physical, LimitParameters())))
    assert scene.about()['cart'] == pytest.approx([0.0176, 0.0088])
    assert scene.about()['scale'] == pytest.approx({'length': 0.04, 'time': 0.2, 'force': 0.1})
    assert scene.about()['centres'] == [None, None]
    physical = dataclasses.replace(physical, link1_centre=0.02 + 1e-10, link2_centre=0.03)
    scene.hear(ROBOT_DESCRIPTION, String(data=urdf(physical, LimitParameters())))
    assert scene.about()['centres'] == [None, pytest.approx(0.75)]
    scene.hear(TRIES, cloud(value=np.float32(0.01234).tobytes()))
    assert scene.tries[-1].content['paths'][0][0] == [0.0123, 0.0123]


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


def shown(scene):
    """Return the tick of each part of a frame, all of which say when they are of."""
    frame = scene.frame()
    return [frame['plan'] and frame['plan']['t'], frame['force'], frame['tick']['cost']]


def test_what_a_frame_shows_of_the_mpc_is_of_one_tick():
    scene = Scene()
    for n in range(5):
        t = 7.0 + n / 4
        for topic, message in (
                (JOINT_STATES, state(t)), (FORCE_COMMAND, Float64(data=t)),
                (PLAN, planned(point(), point(t=0.05), header=at(t))),
                (DIAGNOSTICS, said(header=at(t), force=str(t), cost=str(t)))):
            scene.hear(topic, message)
            if n:   # the one before, until the last of the parts
                assert shown(scene) == [t if topic is DIAGNOSTICS else t - 0.25] * 3
        assert (scene.frame()['t'], scene.frame()['u'], scene.is_answered) == (t, t, True)


def test_an_answer_that_is_heard_before_its_state_counts_from_that_on():
    scene, force = Scene(), Float64(data=1.0)
    answers = ((PLAN, planned(point(), point(t=0.05), header=at(7.5))),
               (DIAGNOSTICS, said(header=at(7.5), force='1.0')), (FORCE_COMMAND, force))
    scene.hear(JOINT_STATES, state(7.25))
    for topic, message in answers:
        scene.hear(topic, message)
    assert [scene.time_of(*each) for each in answers] == [7.5, 7.5, 7.25]
    for stamp in (1.0, 7.25, 70.0):   # nor what others mean by stamps
        assert scene.time_of(PLAN, planned(point(), header=at(stamp))) == 7.25
        assert scene.time_of(DIAGNOSTICS, said('motor', header=at(stamp))) == 7.25


def test_a_tick_without_a_plan_shows_none(scene):
    for t in (7.25, 7.5):
        scene.hear(JOINT_STATES, state(t))
        scene.hear(DIAGNOSTICS, said(header=at(t), force='1.0', cost='2.0'))
    assert shown(scene) == [None, 1.0, 2.0]


@pytest.mark.parametrize('status, is_shown', [
    ('CONVERGED', True), ('DISABLED', False), ('ZERO', False)])
def test_what_nobody_follows_is_no_plan(scene, status, is_shown):
    scene.hear(DIAGNOSTICS, said(status=status))
    frame = scene.frame()
    assert (frame['plan'] is not None, frame['tries'] is not None) == (is_shown, is_shown)


def test_a_command_of_whom_nobody_reports_grows_old(scene):
    for t in (9.0, 10.0, 12.0):
        scene.hear(JOINT_STATES, state(t))
        if t < 10.0:
            scene.hear(FORCE_COMMAND, Float64(data=3.0))
        assert scene.frame()['force'] == (3.0 if t < 12.0 else None)


def test_time_is_that_of_the_run():
    scene = Scene()

    def time(t, *others):
        for topic, message in (*others, (JOINT_STATES, state(t))):
            scene.hear(topic, message)
        return scene.frame()['time']

    began = (CONFIGURATION, announced())
    assert (time(7.0), time(7.5)) == (0.0, 0.5)                    # of whom nothing is known
    assert time(8.0, began) == 0.0                                 # a plant
    assert time(8.5, (CONFIGURATION, announced(resets=1))) == 0.0  # is reset
    assert (time(9.0), time(3.0), time(4.0)) == (0.5, 0.0, 1.0)    # a clock that went back
    assert time(1e9, began) == 0.0                                 # another, by another clock
    # a plant that had begun before knows better
    assert time(1e9 + 1, (DIAGNOSTICS, said('plant', at(1e9), time='10.0'))) == 11.0


def test_the_status_of_who_is_silent_is_stale(scene):
    def stale(*silent):
        return {each['name']: each['message'] for each in scene.status(silent)['statuses']
                if each['level'] == STALE}

    for name in ('mpc: topics', 'plant', 'logger'):
        scene.hear(DIAGNOSTICS, said(name))
    assert stale() == {}
    assert stale('mpc').keys() == {'mpc', 'mpc: topics'}
    assert stale('plant').keys() == {'mpc', 'mpc: topics', 'plant'}   # nothing to answer


def test_of_a_node_that_another_has_replaced_no_status_is_left(scene):
    for name in ('mpc', 'mpc: topics', 'plant'):
        scene.hear(DIAGNOSTICS, said(name))
    mpc = {'horizon': 30, 'solver': 'ilqr'}
    scene.hear(CONFIGURATION, announced('mpc', **mpc))
    scene.hear(CONFIGURATION, announced('other', **mpc))
    scene.hear(DIAGNOSTICS, said('other'))
    assert [each['name'] for each in scene.status()['statuses']] == ['other', 'plant']


def test_a_minute_of_states_at_50_hz_is_shown_whole():
    past, scene = History(), Scene()
    for n in range(3500):
        scene.hear(JOINT_STATES, state(n / 50))
        past.keep_state(scene)
    assert len(history.answer(past.rows)['t']) == history.ROWS == 3000


def test_what_a_run_before_announced_counts_on_whatever_its_time():
    past = History()
    past.keep(Entry(50.0, CONFIGURATION, '/mpc', b'm', 0, 0))
    past.begin()   # the clock went back
    past.keep(Entry(1.0, JOINT_STATES, '', b'x', 1, 1))
    assert [entry.topic for entry in past.until(1.0)] == [CONFIGURATION, JOINT_STATES]


def test_of_what_was_heard_a_minute_is_kept_and_no_more_than_fits(monkeypatch):
    monkeypatch.setattr(history, 'SIZE', 1000)
    past = History()
    past.keep(Entry(0.0, CONFIGURATION, '/plant', b'p', 0, 0))
    for n in range(200):
        for topic in (JOINT_STATES, PLAN, TRIES):
            past.keep(Entry(n / 2, topic, '', bytes(10), n + 1, n + 1))
    # what stands counts on; what is only seen takes no room of what branches need
    assert [entry.topic for entry in past.entries()] == [CONFIGURATION] + 100 * [JOINT_STATES]
    until = past.until(90.0)
    assert until[0].topic is CONFIGURATION
    assert max(entry.t for entry in until) == 90.0
    assert [sum(entry.topic is topic for entry in until)
            for topic in (JOINT_STATES, PLAN, TRIES)] == [4, 4, 4]
