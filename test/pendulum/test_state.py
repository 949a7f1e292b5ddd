# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The state of n links, and arithmetic of its angles."""

import numpy as np
import pytest

from dp_swing_ros.pendulum.state import (
    angles, equilibria, errors, hanging, is_upright, joints, LINKS, links_of, SIZES, symbols,
    to_turn_of, turned, units, upright, wrapped)

of_links = pytest.mark.parametrize('links', LINKS)


@of_links
def test_the_state_is_as_long_as_its_names(links):
    size = SIZES[links]
    assert len(symbols(links)) == len(units(links)) == len(upright(links)) == size
    assert len(joints(links)) == size // 2
    assert links_of(np.zeros((4, 7, size))) == links
    where = angles(hanging(links))
    assert all(symbol[0] == 'θ' for symbol in symbols(links)[where])
    np.testing.assert_array_equal(hanging(links)[where], [np.pi] * links)
    assert np.sum(hanging(links) != 0) == links


@of_links
def test_angles_come_to_the_turn_of_the_reference(links, rng):
    reference = rng.normal(size=(50, SIZES[links])) * 10
    x = to_turn_of(rng.normal(size=(50, SIZES[links])) * 30, reference)
    assert np.abs(x - reference)[:, angles(x)].max() <= np.pi + 1e-9


@of_links
def test_angles_alone_turn(links, rng):
    x, by = rng.normal(size=SIZES[links]), rng.normal(size=links)
    before = x.copy()
    found = turned(x, by)
    np.testing.assert_array_equal(found[angles(x)], before[angles(x)] + by)
    np.testing.assert_array_equal(np.delete(found, np.r_[angles(x)]), np.delete(
        before, np.r_[angles(x)]))
    np.testing.assert_array_equal(x, before)
    np.testing.assert_array_equal(turned(np.array([[x], [x]]), by), [[found], [found]])


@of_links
def test_everything_but_the_angles_stays(links, rng):
    x = rng.normal(size=SIZES[links]) * 30
    moved, where = to_turn_of(x, upright(links)), angles(x)
    np.testing.assert_array_equal(np.delete(moved, where), np.delete(x, where))
    np.testing.assert_allclose(np.sin(moved[where]), np.sin(x[where]), atol=1e-12)


@of_links
def test_wrapped_angles_have_one_name_for_each_place(links, rng):
    x = wrapped(rng.normal(size=(50, SIZES[links])) * 30)[:, 1:links + 1]
    assert np.all((x > -np.pi) & (x <= np.pi))
    np.testing.assert_array_equal(wrapped(-hanging(links)), hanging(links))


@pytest.mark.parametrize(('x', 'expected'), [
    ((9, 0.09, -0.09, 0.9, -0.9, 0.9), True),
    ((0, 2 * np.pi, -4 * np.pi, 0, 0, 0), True),
    ((0, 0.11, 0, 0, 0, 0), False),
    ((0, 0, 0, 1.1, 0, 0), False),
    ((0, 0, 0, 0, 0, -1.1), False),
    ((0, np.nan, 0, 0, 0, 0), False),
    ((9, 0.09, 0.9, 0.9), True),
    ((0, 0.11, 0, 0), False),
    ((9, 0.09, 0.09, -0.09, 0, 0, 0, 0), True),
    ((0, 0, 0, 0.11, 0, 0, 0, 0), False),
    ((0, 0, 0, 0, 0, 0, 0, 1.1), False)])
def test_upright_is_all_angles_and_all_speeds(x, expected):
    assert is_upright(np.array(x, float)) == expected


@pytest.mark.parametrize('links', LINKS)
def test_equilibria_are_named_link_by_link(links):
    found = equilibria(links)
    assert len(found) == 2 ** links
    np.testing.assert_array_equal(found['_'.join(['down'] * links)], hanging(links))
    np.testing.assert_array_equal(found['_'.join(['up'] * links)], upright(links))
    for name, x in found.items():
        assert [angle == 0 for angle in x[angles(x)]] == [word == 'up' for word in name.split('_')]


def test_errors_are_from_the_nearest_turn():
    x = np.array([0.5, 3 * np.pi, 0.1, 0.0, 1.0, 0.0])
    x_r = np.array([0.2, np.pi, 0.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(errors(x, x_r), [0.3, 0.0, 0.1, 0.0, 1.0, 0.0], atol=1e-12)
