# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Models from some seconds of motion, and how good they are said to be."""

from learned_dynamics import BODIES, experience
import numpy as np
import pytest
from similar import sized, SMALLER

from dp_swing_ros.dynamics.files import load
from dp_swing_ros.dynamics.structured import Structured
from dp_swing_ros.errors import UserError
from dp_swing_ros.learning.experience import Experience
from dp_swing_ros.learning.models import learned, Online, parted
from dp_swing_ros.learning.quality import AHEAD, errors
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.units import SAME

TRUE = Pendulum.of(PendulumParameters(**BODIES))   # but for what nobody has told
UNTOLD = {'cart_dry_friction': 2.0, 'joint1_friction': 0.1}


def test_a_fifth_is_held_out_in_pieces():
    whole = [experience(20.0), experience(11.0, seed=1)]
    parts = parted(whole, seed=0)
    both = Experience.joined(parts.seen + parts.held_out)
    assert {tuple(x) for x in both.X} == {tuple(x) for each in whole for x in each.X}
    assert len(both.U) == sum(len(each.U) for each in whole)
    assert [len(each.U) for each in parts.held_out] == [100]
    assert Experience.joined(parted(whole, seed=1).held_out).X[0, 1] != parts.held_out[0].X[0, 1]


def test_of_little_something_is_held_out_and_of_less_nothing_is_learned():
    parts = parted([experience(2.5)], seed=0)
    assert [len(each.U) for each in parts.held_out] == [10]
    with pytest.raises(UserError, match=r'30 transitions \(1.5 s\).*expected 40'):
        parted([experience(1.5)], seed=0)


def test_a_model_is_better_than_wrong_equations():
    parts = parted([experience(20.0, position_noise=1e-3, velocity_noise=1e-2, **UNTOLD)], seed=0)
    rounds = []
    model = learned(TRUE, parts, rounds.append)
    assert len(rounds) > 3 and isinstance(rounds[-1], Structured)
    own, wrong = (np.linalg.norm(errors(each, parts.held_out).speeds)
                  for each in (model.dynamics, TRUE))
    assert own < 0.8 * wrong
    assert learned(TRUE, parts).to_text() == model.to_text() == load(model.to_text(), 2).to_text()
    assert model.about['seconds'] == pytest.approx(16.0)


def test_of_a_smaller_pendulum_the_same_is_learned_in_its_own_units():
    whole, known = experience(20.0, **UNTOLD), Structured.of(TRUE)
    usual, smaller = (
        learned(Pendulum.of(PendulumParameters(**sized(BODIES, scale)), scale=scale),
                parted([whole.sized(scale)], 0, scale), scale=scale) for scale in (SAME, SMALLER))
    found = smaller.dynamics.sized(SMALLER.inverse)
    for name in ('inertia', 'potential', 'friction', 'dry', 'sharpness'):
        np.testing.assert_allclose(getattr(found, name), getattr(usual.dynamics, name), rtol=1e-5,
                                   atol=1e-7)
    assert smaller.about['seconds'] == pytest.approx(8.0)
    assert np.abs(found.inertia - known.inertia).max() < 0.1


def test_while_it_runs_it_is_fitted_from_where_it_was():
    whole = experience(13.0, **UNTOLD)
    so_far = [whole.chosen(np.arange(count)) for count in (130, 180, 240)]   # 6.5, 9, 12 s
    online = Online(2)
    models = [online.model(seen) for seen in so_far]
    assert not np.array_equal(models[0].dynamics.free, models[1].dynamics.free)
    again = Online(2)
    assert [again.model(seen).to_text() for seen in so_far] == [
        model.to_text() for model in models]


def test_errors_of_the_truth_are_those_of_the_integrator():
    seen = experience(5.0)
    found = errors(Structured.of(TRUE), [seen, seen.chosen(np.arange(AHEAD - 1))])
    assert np.all(found.speeds < 1e-2)
    assert len(found.ahead) == len(seen.U) - AHEAD + 1
    assert np.median(found.ahead) < 0.1 and found.ahead.max() <= np.pi   # it is chaotic
    assert set(found.as_figures) == {'speeds', 'ahead_median', 'ahead_p95'}
    assert set(errors(Structured.of(TRUE), [seen.chosen(np.arange(5))]).as_figures) == {'speeds'}
