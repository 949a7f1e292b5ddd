# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The digests of lockstep runs: the same for the same run, another one for any other."""

from campaigns import METHODS
import digests
import numpy as np
import pytest


@pytest.mark.parametrize('solver', METHODS)
def test_a_run_has_one_digest(solver, monkeypatch):
    monkeypatch.setattr(digests, 'DURATION', 0.5)
    worse = digests.SETUPS['worse plant']
    found = digests.run(worse, solver, 2)
    assert digests.run(worse, solver, 2) == found
    assert digests.run(worse, solver, 2, seed=4, force_weight=0.02) != found


def test_a_bit_makes_another_digest():
    assert digests.digest([1.0, 2.0]) != digests.digest([1.0, np.nextafter(2.0, 3.0)])
    assert digests.digest([1.0], [2.0]) == digests.digest([1.0], [2.0])
