# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from dp_swing_ros.pendulum.geometry import joint_positions
from dp_swing_ros.pendulum.state import hanging, LINKS, SIZES, upright


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
