# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which states cannot be, at the edges of what can."""

import math

import numpy as np
import pytest

from dp_swing_ros.control.message_filter import Plausibility

TRACK = 2.4


def moving(x, t, until):
    """Predict that all positions move by 1 m and 1 rad a second."""
    return x + (until - t) * np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize('place, bound, words', [
    (0, 2 * TRACK, 'position of cart'), (1, 2000 * math.pi, 'position of joint1'),
    (2, 2000 * math.pi, 'position of joint2'), (3, 100.0, 'velocity of cart'),
    (4, 100.0, 'velocity of joint1'), (5, 100.0, 'velocity of joint2')])
@pytest.mark.parametrize('sign', [-1, 1])
def test_a_state_is_in_reach_up_to_its_bound(place, bound, words, sign):
    x = np.zeros(6)
    x[place] = sign * bound
    assert Plausibility(TRACK).rejection(0.0, x, moving) == ''
    assert words in Plausibility(TRACK).rejection(0.0, 1.001 * x, moving)


def test_only_the_last_half_second_is_asked_of():
    """A position that was the same a second ago, and has not been since, may be so again."""
    past = Plausibility(TRACK)
    for n in range(100):
        assert past.rejection(0.05 * n, np.full(6, 0.01 * n), moving) == ''
        assert len(past.past) <= 11
    frozen = np.full(6, 0.01 * 99)
    assert 'whole state has stood still' in past.rejection(5.0, frozen, moving)
    past.reset()
    assert past.rejection(5.05, frozen, moving) == ''
