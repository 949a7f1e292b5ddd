# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The force of several hands on the cart."""

import numpy as np
import pytest

from dp_swing_ros.console.pulls import Hold, LASTS, Pull, Pulls
from dp_swing_ros.pendulum.state import upright
from dp_swing_ros.pendulum.units import SAME, Units

LIMIT = 30.0   # [N]


def felt(*hands, kick=0.0, after=0.0):
    """Return the force [N] of hands, a time [s] after they have pulled."""
    pulls = Pulls()
    for number, hand in enumerate(hands):
        pulls.take(number, hand, 0.0)
    return pulls.force(after, upright(), (1.0, 1.0), 100.0, LIMIT, kick)


@pytest.mark.parametrize('side', [-1.0, 1.0])
def test_the_limit_holds_for_each_hand_and_for_all_together(side):
    assert felt(Hold(side * 20.0)) == side * 20.0
    assert felt(Hold(side * 20.0), Hold(side * 20.0)) == side * LIMIT
    assert felt(Hold(side * 20.0), kick=side * 20.0) == side * LIMIT
    assert felt(Hold(side * 50.0), Hold(side * -20.0)) == side * 10.0   # not 30
    assert felt(Pull(1, 1.0, (side * 9.0, 0.0)), Hold(side * 1.0)) == side * LIMIT


def test_a_hand_that_does_not_renew_its_pull_lets_go():
    assert felt(Hold(5.0), after=0.9 * LASTS) == 5.0
    assert felt(Hold(5.0), after=LASTS) == 0.0


def test_a_small_pendulum_is_pulled_as_a_large_one():
    forces = []
    for scale in (SAME, Units(0.25, 0.5, 0.1, 0.1)):
        pulls, size = Pulls(), scale.length
        pulls.take(0, Pull(2, 0.5, (0.3 * size, 0.0)), 0.0)
        x = np.array([0.1 * size, 0.2, 0.1, 0.5 * size / scale.time, *[-0.4 / scale.time] * 2])
        force = pulls.force(0.0, x, (size, size), scale.sized(100.0, 'N/m'),
                            scale.sized(LIMIT, 'N'), scale=scale)
        forces.append(force / scale.factor('N'))
    assert 1.0 < abs(forces[0]) < LIMIT
    assert forces[1] == pytest.approx(forces[0])
