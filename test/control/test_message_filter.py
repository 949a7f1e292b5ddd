# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which states cannot be, at the edges of what can."""

import math

import numpy as np
import pytest

from dp_swing_ros.control.message_filter import MessageFilter
from dp_swing_ros.pendulum.state import LINKS, SIZES, upright

TRACK = 2.4


def moving(x, t, until):
    """Predict that all positions move by 1 m and 1 rad a second."""
    return x + (until - t) * np.repeat([1.0, 0.0], len(x) // 2)


@pytest.mark.parametrize('links, place, bound, words', [
    *((links, 0, 2 * TRACK, 'position of cart') for links in LINKS),
    *((links, i, 2000 * math.pi, f'position of joint{i}')
      for links in LINKS for i in range(1, links + 1)),
    *((links, links + 1, 100.0, 'velocity of cart') for links in LINKS),
    *((links, links + 1 + i, 100.0, f'velocity of joint{i}')
      for links in LINKS for i in range(1, links + 1))])
@pytest.mark.parametrize('sign', [-1, 1])
def test_a_state_is_in_reach_up_to_its_bound(links, place, bound, words, sign):
    x = upright(links)
    x[place] = sign * bound
    assert MessageFilter(links, TRACK).rejection(0.0, x, moving) == ''
    assert words in MessageFilter(links, TRACK).rejection(0.0, 1.001 * x, moving)


@pytest.mark.parametrize('links', LINKS)
def test_only_the_last_half_second_is_asked_of(links):
    """A position that was the same a second ago, and has not been since, may be so again."""
    size, past = SIZES[links], MessageFilter(links, TRACK)
    for n in range(100):
        assert past.rejection(0.05 * n, np.full(size, 0.01 * n), moving) == ''
        assert len(past.past) <= 11
    frozen = np.full(size, 0.01 * 99)
    assert 'whole state has stood still' in past.rejection(5.0, frozen, moving)
    past.reset()
    assert past.rejection(5.05, frozen, moving) == ''
