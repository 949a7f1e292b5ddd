# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What sensors measure, as states, and where their zero is."""

import math

import numpy as np
import pytest

from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.sensors import REST, SensorParameters, Standstill
from dp_swing_ros.pendulum.state import hanging, LINKS, SIZES, wrapped
from dp_swing_ros.pendulum.units import Units


def sensors(links, **others):
    """Return sensors of a pendulum, each with a sign and an offset of its own."""
    names = tuple(f'sensor{i}' for i in range(links + 1))
    signs = tuple((-1.0) ** i for i in range(links + 1))
    return SensorParameters(**{'joint_names': names, 'joint_signs': signs,
                               'joint_offsets': tuple(0.3 * i - 1 for i in range(links + 1)),
                               **others})


def measured(of, x):
    """Return what sensors measure of a state, as a driver would compute it."""
    q, v = np.hsplit(np.array(x, dtype=float), 2)
    if of.relative_angles:
        for part in (q, v):
            part[2:] -= part[1:-1].copy()
    return np.concatenate((of.joint_offsets + of.joint_signs * q, of.joint_signs * v))


@pytest.mark.parametrize('relative', [False, True])
@pytest.mark.parametrize('links', LINKS)
def test_a_state_comes_back_from_what_is_measured_of_it(links, relative, rng):
    of = sensors(links, relative_angles=relative)
    for x in rng.normal(size=(20, SIZES[links])):
        np.testing.assert_allclose(of.state_of(measured(of, x)), x, atol=1e-12)


def test_the_defaults_change_no_bit(rng):
    for x in (rng.normal(size=6), np.array([-0.0, 0.0, 1e-300, 1e300, -1e-5, -0.0])):
        assert SensorParameters().state_of(x).tobytes() == x.tobytes()


def test_relative_angles_are_summed_from_the_cart_up():
    x = SensorParameters(relative_angles=True).state_of(np.array([0.5, 1.0, 0.2, 4.0, -2.0, 3.0]))
    assert x.tolist() == [0.5, 1.0, 1.2, 4.0, -2.0, 1.0]


def test_what_is_not_measured_stays_so():
    x = sensors(2, relative_angles=True).state_of(np.array([0.1, 0.2, 0.3, *[math.nan] * 3]))
    assert np.isfinite(x[:3]).all() and np.isnan(x[3:]).all()


@pytest.mark.parametrize(('values', 'words'), [
    ({'joint_signs': (1.0, 0.5, 1.0)}, ['joint_signs', '0.5', 'expected 1 or -1']),
    ({'joint_signs': (1.0, -2.0, 1.0)}, ['joint_signs', '-2', 'at least -1']),
    ({'joint_names': ('cart', 'joint1', 'joint1')}, ['joint_names', 'another name for each']),
    ({'joint_offsets': (0.0,)}, ['joint_offsets', 'a list of 2 or 3 or 4 numbers']),
    ({'joint_names': 'cart'}, ['joint_names', 'a list of 2 or 3 or 4 texts']),
    ({'zero': 'upright'}, ['zero', "'upright'", 'one of given, hanging'])])
def test_what_sensors_cannot_be_is_refused(values, words):
    with pytest.raises(ParameterError) as error:
        SensorParameters(**values)
    assert all(word in str(error.value) for word in words), error.value


@pytest.mark.parametrize('relative', [False, True])
@pytest.mark.parametrize('links', LINKS)
def test_the_zero_is_found_from_where_it_hangs(links, relative, rng):
    of = sensors(links, relative_angles=relative)
    unknown = sensors(links, relative_angles=relative, joint_offsets=(
        of.joint_offsets[0], *[0.0] * links))
    still, x = Standstill(links), hanging(links)
    x[0] = 0.4    # the cart is where it is: its zero is given
    for n in range(100):
        noisy = measured(of, x) + rng.normal(size=SIZES[links]) * 2e-3
        place = still.place(0.05 * n, noisy)
        if place is not None:
            break
    assert REST <= 0.05 * n + 1e-9 <= 1.25 * REST
    found = unknown.hanging_at(place)
    assert found.joint_offsets[0] == of.joint_offsets[0]
    np.testing.assert_allclose(found.joint_offsets, of.joint_offsets, atol=3e-3)
    np.testing.assert_allclose(found.state_of(measured(of, x))[:links + 1], x[:links + 1],
                               atol=5e-3)


@pytest.mark.parametrize('period', [0.7, 1.5, 2.7])
@pytest.mark.parametrize('amplitude', [0.02, 0.3])
@pytest.mark.parametrize('rate', [20.0, 1000.0])
def test_a_swing_is_no_standstill_even_where_it_turns(period, amplitude, rate):
    still = Standstill(2)
    for t in np.arange(0.0, 6.0, 1 / rate):
        x = hanging(2)
        x[1:3] += amplitude * math.sin(2 * math.pi * t / period)
        assert still.place(t, x) is None


def test_an_encoder_that_wraps_where_it_hangs_has_one_place(rng):
    still = Standstill(2)
    found = [still.place(0.05 * n, wrapped(hanging(2) + rng.normal(size=6) * 1e-3))
             for n in range(30)]
    place = next(each for each in found if each is not None)
    np.testing.assert_allclose(np.abs(place[1:]), math.pi, atol=1e-3)


@pytest.mark.parametrize('bad', [[math.nan, 0.0, 0.0], [0.0, math.inf, 0.0]])
def test_what_is_not_finite_never_stands_still(bad):
    still = Standstill(2)
    assert all(still.place(0.05 * n, np.array([*bad, 0.0, 0.0, 0.0])) is None for n in range(40))
    assert any(still.place(2.0 + 0.05 * n, hanging(2)) is not None for n in range(26))


@pytest.mark.parametrize('step', [-1.0, 0.0, 0.3])
def test_after_a_gap_it_begins_anew(step):
    still = Standstill(2)
    for n in range(19):
        assert still.place(0.05 * n, hanging(2)) is None
    later = 0.9 + step
    found = [still.place(later + 0.05 * n, hanging(2)) is not None for n in range(25)]
    assert 20 <= found.index(True) <= 24


def test_a_small_pendulum_stands_still_sooner():
    scale = Units(0.25, 0.5, 1.0, 1.0)
    still = Standstill(2, scale)
    found = [still.place(0.025 * n, hanging(2)) is not None for n in range(30)]
    assert found.index(True) * 0.025 == pytest.approx(0.5 * REST, abs=0.026)
