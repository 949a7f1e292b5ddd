# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import math
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

from dp_swing_ros.parameters import fields_of
from dp_swing_ros.pendulum.geometry import joint_positions
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import joints, LINKS, SIZES
from dp_swing_ros.pendulum.urdf import from_urdf, urdf

VALUES = {'cart_mass': 1.1, 'link1_mass': 0.3, 'link2_mass': 0.7, 'link3_mass': 0.2,
          'link1_length': 0.8, 'link2_length': 1 / 3, 'link3_length': 0.45,
          'link1_inertia_factor': 1.1, 'link2_inertia_factor': 0.7, 'link3_inertia_factor': 1.3,
          'link1_centre': 0.3, 'link3_centre': 0.5,
          'gravity': 1.62, 'cart_friction': 0.1, 'joint1_friction': 0.02,
          'joint2_friction': 0.03, 'joint3_friction': 0.04, 'joint1_stiffness': 0.3,
          'joint1_preload': 0.9, 'joint3_preload': -0.2}
ELBOWS = ('elbow', 'elbow2')
COUNTERS = ('counter', 'counter2')


def pendulum(links):
    """Return the parameters of a pendulum; those of links that are not there are the defaults."""
    names = {field.name for field in fields_of(PendulumParameters, links)}
    return PendulumParameters(links=links, **{
        name: value for name, value in VALUES.items() if name in names})


@pytest.fixture(params=LINKS)
def physical(request):
    return pendulum(request.param)


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


def test_links_lie_where_the_model_has_them(physical, rng):
    n = physical.links
    for _ in range(5):
        x = rng.normal(size=SIZES[n], scale=3.0)
        poses = frames(ElementTree.fromstring(urdf(physical, LimitParameters())),
                       dict(zip(joints(n), x)))
        tip = np.array([0, 0, physical.lengths[-1], 1])
        places = [poses[name][:3, 3] for name in ('cart_body', *ELBOWS[:n - 1])]
        places.append((poses[f'link{n}'] @ tip)[:3])
        assert np.allclose(np.array(places)[:, [0, 2]], joint_positions(x, physical.lengths),
                           atol=1e-12)
        assert np.allclose(np.array(places)[:, 1], 0)


def test_an_outside_reader_finds_the_same_places(physical, rng):
    # it knows no mimic joint, whose angle is set here, and wants a mass for the elbow
    text = urdf(physical, LimitParameters()).replace('<link name="track">', (
        '<mujoco><compiler boundmass="1e-6" boundinertia="1e-9"/></mujoco>\n'
        '  <link name="track">'))
    model, n = mujoco.MjModel.from_xml_string(text), physical.links
    data, x = mujoco.MjData(model), rng.normal(size=SIZES[n], scale=3.0)
    for joint, value in [*zip(joints(n), x), *zip(COUNTERS[:n - 1], -x[1:])]:
        data.joint(joint).qpos = value
    mujoco.mj_kinematics(model, data)
    last = data.body(f'link{n}')
    places = np.array([*(data.body(name).xpos for name in ('cart_body', *ELBOWS[:n - 1])),
                       last.xpos + last.xmat.reshape(3, 3)[:, 2] * physical.lengths[-1]])
    assert np.allclose(places[:, [0, 2]], joint_positions(x, physical.lengths), atol=1e-12)
    assert [model.body(f'link{i}').mass for i in range(1, n + 1)] == list(physical.masses[1:])


def test_joints_make_one_tree_and_the_elbows_turn_back(physical):
    robot = ElementTree.fromstring(urdf(physical, LimitParameters()))
    links = [link.get('name') for link in robot.iter('link')]
    children = [joint.find('child').get('link') for joint in robot.iter('joint')]
    parents = [joint.find('parent').get('link') for joint in robot.iter('joint')]
    assert len(set(links)) == len(links) and len(set(children)) == len(children)
    assert set(links) - set(children) == {'track'} and set(parents) <= set(links)
    assert [(mimic.get('joint'), float(mimic.get('multiplier')), mimic.get('offset'))
            for mimic in robot.iter('mimic')] == [
        (f'joint{i}', -1.0, None) for i in range(1, physical.links)]


@pytest.mark.parametrize('limits', [
    LimitParameters(), LimitParameters(force_limit=math.inf, track_limit=math.inf),
    LimitParameters(force_limit=0.0, track_limit=1 / 3)])
def test_parameters_and_limits_come_back_to_the_bit(physical, limits):
    assert from_urdf(urdf(physical, limits)) == (physical, limits)


def test_inertia_is_its_factor_times_that_of_a_thin_rod(physical):
    robot = ElementTree.fromstring(urdf(physical, LimitParameters()))
    for i, (mass, length, factor) in enumerate(
            zip(physical.masses[1:], physical.lengths, physical.inertia_factors), 1):
        inertial = robot.find(f'link[@name="link{i}"]/inertial')
        centre = getattr(physical, f'link{i}_centre') or length / 2
        assert vector(inertial.find('origin'), 'xyz').tolist() == [0, 0, centre]
        moments = {key: float(value) for key, value in inertial.find('inertia').items()}
        assert moments['ixx'] == moments['iyy'] == pytest.approx(factor * mass * length ** 2 / 12)
        assert 0 < moments['izz'] < moments['ixx']


def test_a_drawing_is_as_large_as_its_links():
    def drawn(length):
        physical = PendulumParameters(link1_length=length, link2_length=length)
        robot = ElementTree.fromstring(urdf(physical, LimitParameters(track_limit=math.inf)))
        assert from_urdf(urdf(physical, LimitParameters())) == (physical, LimitParameters())
        return np.array([float(number) for element in robot.findall('link/visual/geometry/*')
                         for number in ' '.join(element.attrib.values()).split()])

    assert drawn(1.0).tolist() == [0.01, 4.8, 0.2, 0.1, 0.1, 0.02, 1.0, 0.02, 1.0]
    assert np.allclose(drawn(0.25), 0.25 * drawn(1.0))


def test_every_number_is_finite(physical):
    text = urdf(physical, LimitParameters(force_limit=math.inf, track_limit=math.inf))
    assert 'inf' not in text and 'nan' not in text


@pytest.mark.parametrize('text, reason', [
    ('', 'no XML'), ('<robot name="other"/>', 'not one of a pendulum on a cart')])
def test_foreign_description_is_refused(text, reason):
    with pytest.raises(ValueError, match=reason):
        from_urdf(text)
