# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bodies as people have them: centres and moments of inertia beside uniform rods."""

import math

import pytest

from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.parameters import PendulumParameters

# of the authors of test/recordings: mass, to the centre, to the next joint, and about the centre
PUBLISHED = {'link1_mass': 0.093844, 'link1_centre': 0.108565, 'link1_length': 0.172719,
             'link1_inertia': 4.3753e-4, 'link2_mass': 0.137596, 'link2_centre': 0.116779,
             'link2_length': 0.25, 'link2_inertia': 1.26883e-3}


def test_what_is_not_given_is_a_uniform_rod_exactly():
    p = Pendulum.of(PendulumParameters())
    assert p.a == (0.75, 0.25)
    assert p.b == ((0.5 / 3 + 0.5, 0.25), (0.5 / 3,))
    same = PendulumParameters(link1_centre=0.5, link2_inertia=0.5 / 12)
    assert Pendulum.of(same) == p


def test_moments_are_those_of_the_numbers_that_were_published():
    m, a, length, J = (PUBLISHED[f'link1_{name}']
                       for name in ('mass', 'centre', 'length', 'inertia'))
    carried = PUBLISHED['link2_mass']
    p = Pendulum.of(PendulumParameters(**PUBLISHED))
    assert p.a[0] == pytest.approx(m * a + carried * length)
    assert p.b[0][0] == pytest.approx(J + m * a ** 2 + carried * length ** 2)
    assert p.b[0][1] == pytest.approx(carried * PUBLISHED['link2_centre'] * length)
    assert p.b[1][0] == pytest.approx(
        PUBLISHED['link2_inertia'] + carried * PUBLISHED['link2_centre'] ** 2)


def test_the_length_of_a_last_link_changes_nothing_where_centre_and_inertia_are_given():
    first, second = (Pendulum.of(PendulumParameters(**{**PUBLISHED, 'link2_length': length}))
                     for length in (0.2, 0.4))
    assert first.a == pytest.approx(second.a)
    assert [*first.b[0], *first.b[1]] == pytest.approx([*second.b[0], *second.b[1]])


def test_centre_and_inertia_go_with_bodies_that_are_estimated():
    given = PendulumParameters(**PUBLISHED)
    longer = given.estimated({'link1_length': 2 * given.link1_length,
                              'link2_mass': 3 * given.link2_mass, 'joint1_friction': 0.1})
    assert (longer.centres, longer.inertia_factors) == (
        pytest.approx(given.centres), pytest.approx(given.inertia_factors))
    assert longer.link1_centre == pytest.approx(2 * given.link1_centre)
    assert longer.link2_inertia == pytest.approx(3 * given.link2_inertia)
    assert longer.joint1_friction == 0.1
    heavier = given.estimated({'link2_mass': 3 * given.link2_mass, 'link2_inertia_factor':
                               2 * given.inertia_factors[1]})
    assert heavier.link2_inertia == pytest.approx(6 * given.link2_inertia)
    plain = PendulumParameters().estimated({'link1_length': 2.0})
    assert plain == PendulumParameters(link1_length=2.0)


def test_one_moment_of_inertia_is_enough():
    with pytest.raises(ParameterError, match='link1_inertia is 0.01 and link1_inertia_factor 1.2; '
                                             'expected one of them'):
        PendulumParameters(link1_inertia=0.01, link1_inertia_factor=1.2)
    for name, value in (('link1_centre', -0.1), ('link2_inertia', -1e-3),
                        ('link1_centre', math.nan)):
        with pytest.raises(ParameterError, match=name):
            PendulumParameters(**{name: value})
