# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the filter estimates beside the state: its names, its values, its bounds."""

from dataclasses import fields
import math

import numpy as np
import pytest

from dp_swing_ros.estimators.unknowns import (
    drive_of, LARGEST_BALANCE, LARGEST_FACTOR, LONGEST, model_of, Unknowns, UnknownsParameters,
    write_values)
from dp_swing_ros.pendulum.equations import Pendulum, scale_of
from dp_swing_ros.pendulum.integrators import INTEGRATORS
from dp_swing_ros.pendulum.model import Model
from dp_swing_ros.pendulum.parameters import DIRECT, Drive, DriveParameters, PendulumParameters
from dp_swing_ros.pendulum.state import LINKS

VALUES = {'cart_mass': 1.3, 'link1_mass': 0.4, 'link2_length': 1.1, 'link1_inertia_factor': 1.25,
          'link1_centre': 0.35, 'link2_inertia': 0.05,
          'gravity': 9.7, 'cart_friction': 0.3, 'joint1_friction': 0.1, 'joint3_friction': 0.02,
          'cart_dry_friction': 2.0, 'joint2_dry_friction': 0.03, 'joint1_stiffness': 0.2,
          'joint1_preload': -0.5, 'joint2_stiffness': 0.1}
DRIVE = Drive(0.03, 0.02, 0.8, -1.5)

of_links = pytest.mark.parametrize('links', LINKS)


def unknowns(links=2, drive=DRIVE, **about):
    return Unknowns(PendulumParameters(links=links, **VALUES), drive, UnknownsParameters(**about))


def numbers(unknowns, p):
    """Return the values b that p stands for."""
    b = np.empty(len(p))
    write_values(unknowns.nominal, unknowns.factors, p, b)
    return b


def flat(numbers):
    """Return numbers in tuples of tuples in a row."""
    return ([number for each in numbers for number in flat(each)] if isinstance(numbers, tuple)
            else [numbers])


@of_links
def test_names_are_those_of_the_parameters_of_so_many_links(links):
    names = unknowns(links).names
    assert len(names) == len(set(names)) == 8 * links + 7
    of_pendulum = {field.name for field in fields(PendulumParameters)}
    of_drive = {field.name for field in fields(DriveParameters)}
    balances = {f'link{i}_balance' for i in range(1, links + 1)}
    assert balances < set(names) <= of_pendulum | of_drive | balances
    assert of_drive <= set(names)
    links_named = {int(name[len('link'):][0]) for name in names if name.startswith('link')}
    joints_named = {int(name[len('joint'):][0]) for name in names if name.startswith('joint')}
    assert links_named == joints_named == set(range(1, links + 1))
    np.testing.assert_array_equal(unknowns(links).of_pendulum,
                                  [name in of_pendulum for name in names])


def nominal_value(physical, name):
    if name.endswith('_balance'):
        return 0.0
    if name.endswith('_inertia_factor'):
        return physical.inertia_factors[int(name[len('link'):][0]) - 1]
    return getattr(physical, name) if hasattr(physical, name) else DRIVE[
        ['actuation_delay', 'motor_time_constant', 'force_gain', 'force_bias'].index(name)]


@of_links
def test_without_an_error_all_is_nominal(links):
    about = unknowns(links)
    physical = PendulumParameters(links=links, **VALUES)
    none = np.zeros(len(about.names))
    for name, value in about.values(none).items():
        expected = nominal_value(physical, name)
        assert value == pytest.approx(expected, rel=1e-15), name
    np.testing.assert_array_equal(about.of(physical), none)


@of_links
def test_values_and_p_are_inverse(links, rng):
    about = unknowns(links)
    p = np.where(about.of_pendulum, rng.uniform(0.01, 0.3, len(about.names)), 0.0)
    values = about.values(p)
    physical = PendulumParameters(links=links, **VALUES).estimated({
        name: value for name, value in values.items()
        if about.of_pendulum[about.names.index(name)]})
    np.testing.assert_allclose(about.of(physical), p, atol=1e-12)


def test_masses_lengths_and_the_gain_are_factors_all_else_is_added(rng):
    about = unknowns()
    p = rng.normal(0.0, 0.1, len(about.names))
    values = about.values(p)
    assert list(values) == about.names
    for name, nominal, error in zip(about.names, about.nominal, p):
        factor = name.endswith(('mass', 'length', 'factor', 'gain'))
        expected = nominal * math.exp(error) if factor else nominal + error
        assert values[name] == pytest.approx(expected, rel=1e-14), name


@pytest.mark.parametrize('name, value, kinds', [
    ('body_error', 0.11, ['_mass', '_length']), ('inertia_error', 0.19, ['_inertia_factor']),
    ('balance_error', 0.21, ['_balance']), ('gain_error', 0.12, ['force_gain']),
    ('friction_error', 0.13, ['t_friction', '1_friction', '2_friction']),
    ('cart_dry_friction_error', 0.14, ['cart_dry_friction']),
    ('joint_dry_friction_error', 0.15, ['1_dry_friction', '2_dry_friction']),
    ('stiffness_error', 0.22, ['_stiffness']), ('preload_error', 0.23, ['_preload']),
    ('delay_error', 0.16, ['actuation_delay']), ('lag_error', 0.17, ['motor_time_constant']),
    ('force_bias', 0.18, ['force_bias'])])
def test_each_parameter_is_the_deviation_of_its_own(name, value, kinds):
    none = {field.name: 0.0 for field in fields(UnknownsParameters)}
    about = unknowns(**{**none, name: value})
    expected = [value if each.endswith(tuple(kinds)) else 0.0 for each in about.names]
    np.testing.assert_array_equal(about.deviations, expected)
    assert any(expected)


@of_links
def test_within_its_bounds_nothing_is_impossible(links):
    about = unknowns(links)
    lowest = dict(zip(about.names, numbers(about, about.lowest)))
    highest = dict(zip(about.names, numbers(about, about.highest)))
    for name, nominal in zip(about.names, about.nominal):
        if name.endswith(('mass', 'length', 'factor', 'gain')):
            assert lowest[name] == pytest.approx(nominal / LARGEST_FACTOR)
            assert highest[name] == pytest.approx(nominal * LARGEST_FACTOR)
        elif name.endswith('_balance'):
            assert -lowest[name] == highest[name] == LARGEST_BALANCE
        elif name == 'force_bias' or name.endswith('_preload'):
            assert (lowest[name], highest[name]) == (-math.inf, math.inf)
        else:
            assert lowest[name] == 0.0, name
            assert highest[name] == math.inf or nominal <= highest[name], name
    for name in ('actuation_delay', 'motor_time_constant'):
        assert LONGEST <= highest[name] <= 2 * LONGEST


@of_links
def test_its_pendulum_is_that_of_its_parameters(links, rng):
    """Written out for a kernel, too: see the filter, which is the textbook's."""
    about = unknowns(links)
    p = np.abs(rng.normal(0.0, 0.1, len(about.names)))
    physical = PendulumParameters(links=links, **VALUES).estimated({
        name: value for name, value in about.values(p).items()
        if about.of_pendulum[about.names.index(name)]})
    given = PendulumParameters(links=links, **VALUES)
    nominal = Model(Pendulum.of(given, 0.02), INTEGRATORS['rk4'], 0.01)
    found, expected = model_of(nominal, numbers(about, p), about.constants), Pendulum.of(
        physical, 0.02, scale_of(given))   # its creep stays that of the bodies given
    for one, other in zip(found.pendulum, expected):
        np.testing.assert_allclose(flat(one), flat(other), rtol=1e-13)
    assert (found.h, found.integrator) == (0.01, INTEGRATORS['rk4'])


@of_links
@pytest.mark.parametrize('drive', [DIRECT, DRIVE])
def test_its_drive_is_the_one_it_was_given(links, drive):
    about = unknowns(links, drive)
    assert drive_of(numbers(about, np.zeros(len(about.names)))) == drive
    moved = np.zeros(len(about.names))
    moved[about.names.index('force_gain')] = math.log(1.5)
    moved[about.names.index('motor_time_constant')] = 0.01
    np.testing.assert_allclose(drive_of(numbers(about, moved)),
                               drive._replace(gain=1.5 * drive.gain,
                                              time_constant=drive.time_constant + 0.01))
