# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import math
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

from dp_swing_ros.pendulum.equations import joints
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.urdf import from_urdf, urdf

BODIES = PendulumParameters(cart_mass=1.1, link1_mass=0.3, link2_mass=0.7, link1_length=0.8,
                            link2_length=1 / 3, link1_inertia_factor=1.1,
                            link2_inertia_factor=0.7, gravity=1.62, cart_friction=0.1,
                            joint1_friction=0.02, joint2_friction=0.03)


def vector(element, attribute):
    text = '0 0 0' if element is None else element.get(attribute, '0 0 0')
    return np.array([float(number) for number in text.split()])


def turned(axis, angle):
    """Return the rotation matrix about a unit axis (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def frames(robot, positions):
    """Return the pose of every link, as robot_state_publisher finds it."""
    poses = {'track': np.eye(4)}
    for joint in robot.iter('joint'):  # parents come before their children
        mimic = joint.find('mimic')
        if mimic is None:
            value = positions[joint.get('name')]
        else:
            value = positions[mimic.get('joint')] * float(mimic.get('multiplier'))
        move, axis = np.eye(4), vector(joint.find('axis'), 'xyz')
        move[:3, 3] = vector(joint.find('origin'), 'xyz')
        if joint.get('type') == 'prismatic':
            move[:3, 3] += value * axis
        else:
            move[:3, :3] = turned(axis, value)
        poses[joint.find('child').get('link')] = poses[joint.find('parent').get('link')] @ move
    return poses


@pytest.mark.parametrize('seed', range(5))
def test_links_lie_where_the_model_has_them(seed):
    x = np.random.default_rng(seed).normal(size=6, scale=3.0)
    poses = frames(ElementTree.fromstring(urdf(BODIES, LimitParameters())),
                   dict(zip(('cart', 'joint1', 'joint2'), x)))
    tip = np.array([0, 0, BODIES.link2_length, 1])
    places = [poses['cart_body'][:3, 3], poses['elbow'][:3, 3], (poses['link2'] @ tip)[:3]]
    assert np.allclose(np.array(places)[:, [0, 2]], joints(x, BODIES), atol=1e-12)
    assert np.allclose(np.array(places)[:, 1], 0)


def test_an_outside_reader_finds_the_same_places(rng):
    # it knows no mimic joint, whose angle is set here, and wants a mass for the elbow
    text = urdf(BODIES, LimitParameters()).replace('<link name="track">', (
        '<mujoco><compiler boundmass="1e-6" boundinertia="1e-9"/></mujoco>\n'
        '  <link name="track">'))
    model = mujoco.MjModel.from_xml_string(text)
    data, x = mujoco.MjData(model), rng.normal(size=6, scale=3.0)
    for joint, value in (('cart', x[0]), ('joint1', x[1]), ('counter', -x[1]), ('joint2', x[2])):
        data.joint(joint).qpos = value
    mujoco.mj_kinematics(model, data)
    tip = data.body('link2').xpos + data.body('link2').xmat.reshape(3, 3)[:, 2] * (
        BODIES.link2_length)
    places = np.array([data.body('cart_body').xpos, data.body('elbow').xpos, tip])
    assert np.allclose(places[:, [0, 2]], joints(x, BODIES), atol=1e-12)
    assert model.body('link1').mass == BODIES.link1_mass
    assert model.body('link2').mass == BODIES.link2_mass


def test_joints_make_one_tree_and_the_elbow_turns_back():
    robot = ElementTree.fromstring(urdf(BODIES, LimitParameters()))
    links = [link.get('name') for link in robot.iter('link')]
    children = [joint.find('child').get('link') for joint in robot.iter('joint')]
    parents = [joint.find('parent').get('link') for joint in robot.iter('joint')]
    assert len(set(links)) == len(links) and len(set(children)) == len(children)
    assert set(links) - set(children) == {'track'} and set(parents) <= set(links)
    mimic, = robot.iter('mimic')
    assert (mimic.get('joint'), float(mimic.get('multiplier')), mimic.get('offset')) == (
        'joint1', -1.0, None)


@pytest.mark.parametrize('limits', [
    LimitParameters(), LimitParameters(force_limit=math.inf, track_limit=math.inf),
    LimitParameters(force_limit=0.0, track_limit=1 / 3)])
def test_bodies_and_limits_come_back_to_the_bit(limits):
    assert from_urdf(urdf(BODIES, limits)) == (BODIES, limits)


def test_inertia_is_its_factor_times_that_of_a_thin_rod():
    robot = ElementTree.fromstring(urdf(BODIES, LimitParameters()))
    for name, mass, length, factor in (('link1', BODIES.link1_mass, BODIES.link1_length, 1.1),
                                       ('link2', BODIES.link2_mass, BODIES.link2_length, 0.7)):
        inertial = robot.find(f'link[@name="{name}"]/inertial')
        assert vector(inertial.find('origin'), 'xyz').tolist() == [0, 0, length / 2]
        moments = {key: float(value) for key, value in inertial.find('inertia').items()}
        assert moments['ixx'] == moments['iyy'] == pytest.approx(factor * mass * length ** 2 / 12)
        assert 0 < moments['izz'] < moments['ixx']


def test_every_number_is_finite():
    text = urdf(BODIES, LimitParameters(force_limit=math.inf, track_limit=math.inf))
    assert 'inf' not in text and 'nan' not in text


@pytest.mark.parametrize('text, reason', [
    ('', 'no XML'), ('<robot name="other"/>', 'not one of the double pendulum')])
def test_foreign_description_is_refused(text, reason):
    with pytest.raises(ValueError, match=reason):
        from_urdf(text)
