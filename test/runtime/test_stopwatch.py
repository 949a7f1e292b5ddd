# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import pytest

from dp_swing_ros.runtime.stopwatch import JUMP, Stopwatch


@pytest.mark.parametrize('jump', [-1e6, -0.001, JUMP + 0.1, 1e6, 1.8e9])
def test_time_that_a_clock_jumps_by_does_not_pass(jump):
    watch, now = Stopwatch(5_000), 5_000
    for n, step in enumerate((0.05, 0.05, jump, 0.05, 0.0), 1):
        now += round(step * 1e9)
        elapsed = watch.elapsed(now)
        assert elapsed == pytest.approx(0.05 * min(n, 2) + 0.05 * (n > 3), abs=1e-6)
    assert watch.jumped == pytest.approx(jump * 1e9)
