# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
import dataclasses

import numpy as np
import pytest

from dp_swing_ros.pendulum.equations import scale_of
from dp_swing_ros.pendulum.geometry import drawn_scale, joint_positions
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import hanging, LINKS, SIZES, upright
from dp_swing_ros.pendulum.units import decimals, rounded, SAME


@pytest.mark.parametrize('links', LINKS)
def test_links_stand_on_each_other_or_hang_from_each_other(links):
    lengths = (1.0, 0.5, 0.25)[:links]
    heights = [0.0, *np.cumsum(lengths)]
    np.testing.assert_allclose(joint_positions(upright(links), lengths)[:, 1], heights)
    np.testing.assert_allclose(joint_positions(hanging(links), lengths)[:, 1],
                               np.negative(heights))


@pytest.mark.parametrize('links', LINKS)
def test_links_keep_their_lengths_and_the_cart_its_height(links, rng):
    lengths = (1.0, 0.5, 0.25)[:links]
    X = rng.normal(size=(4, 7, SIZES[links]))
    places = joint_positions(X, lengths)
    assert places.shape == (4, 7, links + 1, 2)
    np.testing.assert_array_equal(places[..., 0, 0], X[..., 0])
    np.testing.assert_array_equal(places[..., 0, 1], 0.0)
    apart = np.linalg.norm(np.diff(places, axis=-2), axis=-1)
    np.testing.assert_allclose(apart, np.broadcast_to(lengths, apart.shape))


def test_a_positive_angle_leans_to_the_right():
    places = joint_positions(np.array([0.5, np.pi / 2, 0.0, 0.0, 0.0, 0.0]), (1.0, 2.0))
    np.testing.assert_allclose(places, [[0.5, 0.0], [1.5, 0.0], [1.5, 2.0]], atol=1e-15)


@pytest.mark.parametrize('links', LINKS)
def test_the_default_bodies_are_drawn_as_large_as_they_are(links):
    assert drawn_scale(PendulumParameters(links=links)) == SAME


def test_a_drawing_goes_with_lengths_and_weight():
    small = PendulumParameters(link1_length=0.15, link2_length=0.25, link2_mass=0.1)
    scale = drawn_scale(small)
    assert scale.length == pytest.approx(0.2)
    assert scale.time == pytest.approx(0.2 ** 0.5)
    assert scale.factor('N') == pytest.approx(scale_of(small).factor('N')) == pytest.approx(0.8)
    heavy = dataclasses.replace(small, cart_mass=5.0)
    assert drawn_scale(heavy)[:2] == scale[:2]   # a slider of a mass moves nothing
    assert drawn_scale(dataclasses.replace(small, gravity=1e-6)) == scale   # who looks stays


@pytest.mark.parametrize('value, found', [
    (1.0, 1.0), (0.5, 0.5), (0.25, 0.25), (0.15, 0.2), (0.39, 0.5), (1.02, 1.0), (8.0, 10.0),
    (0.03, 0.025), (40.0, 50.0)])
def test_round_numbers_are_near(value, found):
    assert rounded(value) == pytest.approx(found, rel=1e-15)


def test_what_is_smaller_has_more_decimals():
    assert [decimals(2, times) for times in (1.0, 0.9, 0.15, 0.02, 5.0, 1e4)] == [
        2, 2, 3, 4, 1, 0]
