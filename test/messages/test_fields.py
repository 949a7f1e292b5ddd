# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States of any number of links, from messages that are nobody's in particular."""

from types import SimpleNamespace

import numpy as np
import pytest

from dp_swing_ros.messages.fields import links_in, to_force, to_state
from dp_swing_ros.pendulum.sensors import SensorParameters
from dp_swing_ros.pendulum.state import joints, LINKS, SIZES


def message(names, effort=()):
    """Return a JointState whose numbers are the places of its joints."""
    place = np.arange(len(names), dtype=float)
    return SimpleNamespace(name=names, position=place, velocity=10 + place, effort=effort)


@pytest.mark.parametrize('links', LINKS)
def test_a_state_has_the_joints_of_its_links(links):
    names = list(joints(links))
    state = to_state(message(names), links)
    assert state.tolist() == [*range(links + 1), *range(10, 11 + links)]
    assert state.shape == (SIZES[links],)
    other = to_state(message(['wheel', *reversed(names)]), links)
    assert other.tolist() == [*range(links + 1, 0, -1), *range(11 + links, 10, -1)]
    assert links_in(message(names)) == links


@pytest.mark.parametrize('names, links', [
    (['joint2', 'wheel', 'cart', 'joint1'], 2), (['cart', 'joint1', 'joint3'], 1),
    (['cart', *(f'joint{i}' for i in range(1, 8))], 3), (['shoulder', 'elbow'], 1)])
def test_links_are_the_joints_in_a_row_from_the_first(names, links):
    assert links_in(message(names)) == links


@pytest.mark.parametrize('links', LINKS)
def test_a_joint_that_is_missing_is_named(links):
    with pytest.raises(ValueError, match=f'has no joint{links}; it names'):
        to_state(message(list(joints(links))[:-1]), links)


@pytest.mark.parametrize('links', LINKS[:-1])
def test_a_pendulum_with_more_links_is_refused(links):
    given, expected = (', '.join(joints(each)) for each in (links + 1, links))
    with pytest.raises(ValueError) as refused:
        to_state(message(['wheel', *joints(links + 1)]), links)
    assert str(refused.value) == (
        f'JointState has {links + 2} joints [{given}]; expected {links + 1} [{expected}]: '
        'start plant and mpc with the same links')


def test_joints_of_another_machine_may_be_numbered():
    names = ['cart', *(f'joint{i}' for i in range(1, 8))]
    assert to_state(message(names), max(LINKS)).tolist() == [0, 1, 2, 3, 10, 11, 12, 13]
    assert to_state(message(['cart', 'joint1', 'joint3']), 1).tolist() == [0, 1, 10, 11]


def test_the_force_is_that_of_the_cart():
    assert to_force(message(['joint1', 'cart'], [0.0, 7.5])) == 7.5
    assert np.isnan(to_force(message(['joint1', 'cart'])))


def test_names_of_another_machine_are_put_in_order():
    sensors = SensorParameters(joint_names=('slide', 'hip', 'knee'))
    state = message(['knee', 'joint3', 'slide', 'hip', 'joint1', 'cart', 'joint2'], [0, 0, 7.5])
    assert to_state(state, 2, sensors).tolist() == [2, 3, 0, 12, 13, 10]
    assert to_force(state, 'slide') == 7.5
    with pytest.raises(ValueError, match='has no hip; it names .*set joint_names'):
        to_state(message(['slide', 'knee', 'joint1']), 2, sensors)
    with pytest.raises(ValueError, match='has 4 joints .*; expected 3'):
        to_state(message(joints(3)), 2, SensorParameters())


@pytest.mark.parametrize('links', LINKS)
def test_velocities_that_are_not_measured_are_nan(links):
    positions_only = message(list(joints(links)))
    positions_only.velocity = []
    state = to_state(positions_only, links)
    assert state[:links + 1].tolist() == [*range(links + 1)]
    assert np.isnan(state[links + 1:]).all()
