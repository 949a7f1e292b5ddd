# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import math
from xml.etree import ElementTree

import numpy as np
import pytest

from dp_swing_ros.dynamics.pendulum import joints
from dp_swing_ros.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.urdf import from_urdf, urdf

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
