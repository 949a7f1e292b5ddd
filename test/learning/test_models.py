# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Models of each kind from some seconds of motion, and how good they are said to be."""

from learned_dynamics import BODIES, experience
import numpy as np
import pytest

from dp_swing_ros.dynamics.files import load
from dp_swing_ros.dynamics.kinds import Structured
from dp_swing_ros.errors import UserError
from dp_swing_ros.learning.experience import Experience
from dp_swing_ros.learning.models import learned, Online, parted
from dp_swing_ros.learning.quality import AHEAD, disagreement, errors
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.parameters import PendulumParameters

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


@pytest.mark.parametrize('kind', ['structured', 'residual', 'black_box'])
def test_a_model_of_each_kind_is_better_than_wrong_equations(kind):
    parts = parted([experience(40.0, position_noise=1e-3, velocity_noise=1e-2, **UNTOLD)], seed=0)
    rounds = []
    model = learned(kind, TRUE, parts, hidden=8, seed=0, on_round=rounds.append)
    assert model.kind == kind and model.draws.shape == (5, len(model.dynamics.free))
    assert len(rounds) > 3 and isinstance(rounds[-1], type(model.dynamics))
    own, wrong = (np.linalg.norm(errors(each, parts.held_out).speeds)
                  for each in (model.dynamics, TRUE))
    assert own < (3.0 if kind == 'black_box' else 0.8) * wrong   # a network alone takes longer
    again = learned(kind, TRUE, parts, hidden=8, seed=0)
    assert again.to_text() == model.to_text() == load(model.to_text(), 2).to_text()
    assert model.about['seconds'] == pytest.approx(30.0)


@pytest.mark.parametrize('kind', ['residual', 'black_box'])
def test_while_it_runs_hidden_units_are_trained_now_and_then_and_the_last_layer_always(kind):
    whole = experience(13.0, **UNTOLD)
    so_far = [whole.chosen(np.arange(count)) for count in (130, 180, 240)]   # 6.5, 9, 12 s
    online = Online(kind, TRUE, seed=0, hidden=4)
    models = [online.model(seen) for seen in so_far]
    W = [model.dynamics.network.W for model in models]
    assert np.array_equal(W[0], W[1]) and not np.array_equal(W[1], W[2])
    assert not np.array_equal(models[0].dynamics.free, models[1].dynamics.free)
    assert [model.kind for model in models] == [kind] * 3
    again = Online(kind, TRUE, seed=0, hidden=4)
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


def test_members_differ_more_where_nothing_was_seen():
    whole = experience(40.0, position_noise=1e-3, velocity_noise=1e-2)
    calm = whole.chosen(np.abs(whole.X[:, 4:]).max(axis=1) < 4.0)
    model = learned('structured', TRUE, parted([calm], seed=0), hidden=1, seed=0)
    X = np.array([[0.0, np.pi, np.pi, 0.0, 0.0, 0.0], [0.0, 0.0, np.pi / 2, 0.0, 8.0, 8.0]])
    near, far = disagreement(model, X, np.zeros(2))
    assert 0 < 3 * near < far
