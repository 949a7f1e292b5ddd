# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Networks that are trained on some seconds of motion."""

from learned_dynamics import BODIES, experience, rms
import numpy as np
import pytest
import torch

from dp_swing_ros.dynamics.kinds import BlackBox, Residual
from dp_swing_ros.learning.regression import predicted
from dp_swing_ros.learning.training import Batch, initial, Layers, Scales, trained
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.parameters import PendulumParameters

WRONG = PendulumParameters(**{**BODIES, 'link2_mass': 0.6, 'link1_length': 0.66})
KINDS = {'residual': lambda made: Residual(Pendulum.of(WRONG), made), 'black box': BlackBox}


@pytest.mark.parametrize(('name', 'better'), [('residual', 2.0), ('black box', 5.0)])
def test_a_trained_network_predicts_what_it_has_not_seen(name, better):
    seen, other = experience(30.0), experience(5.0, seed=7)
    before = KINDS[name](initial(2, 8, Scales.of(seen), seed=0))
    course = []
    found = trained(before, seen, other, course.append)
    off_before, off = (np.linalg.norm(rms(each, other)) for each in (before, found))
    assert off_before > better * off
    assert np.linalg.norm(rms(course[-1], seen)) < np.linalg.norm(rms(course[0], seen))
    again = trained(before, seen, other)
    np.testing.assert_array_equal(again.free, found.free)


@pytest.mark.parametrize('name', KINDS)
def test_torch_and_kernels_step_alike(name):
    seen = experience(2.0)
    made = initial(2, 8, Scales.of(seen), seed=1)
    made = made.with_last_layer(0.3 * np.random.default_rng(0).normal(size=27))
    dynamics = KINDS[name](made)
    layers = Layers(made.widths, *map(torch.tensor, made[1:]))
    short = seen._replace(h=seen.h / 2)   # one step of the kernels
    np.testing.assert_allclose(
        Batch.of(short).residuals(dynamics._replace(network=layers)).numpy(),
        short.Y[:, 3:] - predicted(dynamics, short), atol=1e-9)
