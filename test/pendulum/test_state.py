# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Arithmetic of the angles."""

import numpy as np
import pytest

from dp_swing_ros.pendulum.state import is_upright, to_turn_of


def test_angles_come_to_the_turn_of_the_reference(rng):
    reference = rng.normal(size=(50, 6)) * 10
    x = to_turn_of(rng.normal(size=(50, 6)) * 30, reference)
    assert np.abs(x - reference)[:, 1:3].max() <= np.pi + 1e-9


def test_everything_but_the_angles_stays(rng):
    x = rng.normal(size=6) * 30
    moved = to_turn_of(x, np.zeros(6))
    np.testing.assert_array_equal(moved[[0, 3, 4, 5]], x[[0, 3, 4, 5]])
    np.testing.assert_allclose(np.sin(moved[1:3]), np.sin(x[1:3]), atol=1e-12)


@pytest.mark.parametrize(('x', 'expected'), [
    ((9, 0.09, -0.09, 0.9, -0.9, 0.9), True),
    ((0, 2 * np.pi, -4 * np.pi, 0, 0, 0), True),
    ((0, 0.11, 0, 0, 0, 0), False),
    ((0, 0, 0, 1.1, 0, 0), False),
    ((0, 0, 0, 0, 0, -1.1), False),
    ((0, np.nan, 0, 0, 0, 0), False)])
def test_upright_is_both_angles_and_all_speeds(x, expected):
    assert is_upright(np.array(x, float)) == expected
