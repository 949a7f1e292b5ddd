# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What no method holds is found among stored rows, and tried again; the oracle judges it."""

from dataclasses import replace
import math
import sys

from campaigns import METHODS
import hard
import numpy as np
import oracle
import pandas as pd
import pytest
import stamp

from dp_swing_ros.control import controllers
from dp_swing_ros.evaluation.campaign.contestants import key, parse, parse_all, play
from dp_swing_ros.evaluation.campaign.rows import identical, read, Row, store, UNKNOWN
from dp_swing_ros.evaluation.scenarios import Case, SCENARIOS
from dp_swing_ros.pendulum.model import hold
from dp_swing_ros.pendulum.state import hanging

EASY = Case('tight', 0, 10.0, 'force_limit', 12.0,
            plant={'initial_state': (0.3, 0.1, -0.05, 0, 0, 0)},
            told={'track_limit': 1.5, 'force_limit': 12.0})


def row_of(contestant, case, success):
    """Return a row that ends so."""
    return Row(key(parse(contestant), case), 'HELD' if success else 'FELL', '',
               replace(UNKNOWN, success=success), np.zeros(0))


def rows_of(case, *held):
    return [row_of(name, case, name in held) for name in METHODS]


@pytest.fixture
def losses():
    """Return cases of half of all forces lost."""
    return [case for case in SCENARIOS['loss'].cases('loss', None, None, 10.0)
            if (case.parameter, case.level) == ('command_loss', 0.5)]


def test_what_none_holds_is_found_by_groups(losses):
    hanging_0, = SCENARIOS['hanging'].cases('hanging', range(1), None, 10.0)
    pushes = list(SCENARIOS['pushes'].cases('pushes', range(3), None, 10.0))
    rows = [*rows_of(losses[0]), *rows_of(losses[1], 'mppi'), *rows_of(losses[2]),
            *rows_of(hanging_0, *METHODS), *rows_of(losses[3])[:2], *rows_of(pushes[0]),
            *rows_of(pushes[2])]
    found = hard.held_by_none(rows)
    assert found == {('loss', 'command_loss', 0.5): [losses[0], losses[2]],
                     ('pushes', '', None): [pushes[0], pushes[2]]}


def test_stored_rows_are_those_of_the_methods_that_are_there(tmp_path, monkeypatch, losses):
    path = tmp_path / 'stress.csv.gz'
    store(path, [*rows_of(losses[0]), row_of('tvlqr', losses[0], False)])
    monkeypatch.setattr(hard, 'STORED', [path, tmp_path / 'random.csv.gz'])
    assert [row.key.contestant for row in hard.stored()] == list(METHODS)
    assert hard.links_to_campaigns() == '[stress](stress.md)'


def test_a_few_are_drawn_always_the_same():
    cases = [Case('random', seed) for seed in range(20)]
    drawn = hard.drawn(cases)
    assert len(drawn) == hard.MOST and drawn == hard.drawn(cases)
    assert [case.seed for case in drawn] == sorted({case.seed for case in drawn})
    assert hard.drawn(cases[:2]) == cases[:2]


@pytest.mark.parametrize('plant, exact', [
    ({'track_limit': 1.5, 'force_limit': 6.0}, True), ({'link1_mass': 0.3}, True),
    ({'initial_state': (0, 1, 1, 0, 0, 0)}, True), ({'force_noise': 0.1}, False),
    ({'command_loss': 0.1}, False), ({'actuation_delay': 0.05}, False),
    ({'cart_dry_friction': 1.0}, False), ({'engine': 'mujoco'}, False)])
def test_the_oracle_is_asked_where_it_knows_the_plant(plant, exact):
    case = Case('tight', 0, plant=plant)
    assert hard.is_exact(case) is exact
    assert not hard.is_exact(replace(case, resets=((20, (0, 1, 1, 0, 0, 0)),)))


def test_a_guess_swings_up():
    x_0 = hanging()
    X = hard.swinging(x_0, 6.0, 4.0)
    assert X.shape == (hard.SWING_UP.steps + 1, 6)
    np.testing.assert_array_equal(X[0], x_0)
    assert not X[121:].any()
    assert np.abs(X[:, 1] - np.pi).max() == pytest.approx(np.pi, rel=0.01)


@pytest.fixture(scope='module')
def program():
    """Return a short program from near the goal, on a plant of its own."""
    pytest.importorskip('casadi')
    plant = oracle.plant_of(Case('model', 0, plant={'link1_mass': 0.3, 'force_limit': 15.0}))
    problem = controllers.problem({}).with_physical(plant.physical)
    return plant, oracle.Program(problem, plant, oracle.Aim(
        steps=60, angle=np.inf, to_centre=True, share=0.8, iterations=100))


@pytest.mark.parametrize('pushed', [False, True])
def test_the_program_follows_the_plant_and_its_pushes(program, pushed):
    """Forces and pushes, played on the plant's model in its steps, lead where it says."""
    plant, of = program
    x_0 = np.array([0.3, 0.1, -0.05, 0, 0, 0])
    pushes = tuple(3 * np.sin(0.3 * np.arange(200))) if pushed else ()
    X, U, _ = of.solve(x_0, np.zeros((61, 6)), pushes)
    model = controllers.problem({}).with_physical(plant.physical).model._replace(h=0.005)
    for t in range(60):
        push = pushes[t] if pushed else 0.0
        np.testing.assert_allclose(hold(model, X[t], U[t] + push, 0.05), X[t + 1], atol=1e-6)
    assert np.abs(U).max() <= 0.8 * 15 + 1e-6
    np.testing.assert_allclose(X[0], x_0, atol=1e-6)
    np.testing.assert_allclose(X[-1], 0, atol=1e-6)


def test_the_oracle_holds_what_can_be_held_and_no_more(monkeypatch):
    pytest.importorskip('casadi')
    monkeypatch.setattr(hard, 'SWING_UP', hard.SWING_UP._replace(steps=60, iterations=60))
    monkeypatch.setattr(hard, 'SWINGS', hard.SWINGS[-1:])
    found = hard.judged(EASY)
    assert found.held and 0.3 <= found.position < 1.5
    assert found[:4] == key(hard.NOBODY, EASY)[1:]
    # half a newton neither catches nor swings up what falls
    nothing = hard.judged(replace(EASY, told={**EASY.told, 'force_limit': 0.5}))
    assert not nothing.held and nothing.guesses == 1 and math.isnan(nothing.position)


def test_cases_that_differ_by_the_seed_alone_are_judged_together():
    noisy, other = replace(EASY, plant={'force_noise': 1.0}), replace(EASY, level=9.0)
    pushed = replace(EASY, pushes=(1.0,) * 200)
    assert hard.alike([EASY, other, noisy, replace(EASY, seed=3), pushed]) == [
        [EASY, replace(EASY, seed=3)], [other], [pushed]]


def test_the_page_is_made_from_stored_rows_and_gone_on_with(tmp_path, monkeypatch, losses):
    pytest.importorskip('casadi')
    path, results = tmp_path / 'stress.csv.gz', tmp_path / 'docs' / 'results'
    results.mkdir(parents=True)
    store(path, [*rows_of(losses[0]), *rows_of(losses[1], 'ddp'), *rows_of(losses[2])])
    monkeypatch.setattr(hard, 'STORED', [path])
    monkeypatch.setattr(hard, 'KEPT', tmp_path / 'kept')
    monkeypatch.setattr(hard, 'MOST', 1)
    monkeypatch.setattr(hard, 'REMEDIES', ('ilqr:horizon=40',))
    monkeypatch.setattr(stamp, 'commit', lambda: 'abc')
    monkeypatch.setattr(sys, 'argv', ['hard.py', '--docs', str(tmp_path / 'docs')])
    hard.main()
    row, = read(results / 'hard.csv.gz')
    case = next(case for case in losses if case.seed == row.key.seed)
    assert identical(row, play(parse('ilqr:horizon=40'), case))
    page = (results / 'hard.md').read_text()
    held = f'{int(row.metrics.success)} of 1 ('
    line = page.split('| loss | command_loss 0.5 | ')[1].splitlines()[0]
    assert line.startswith('2 of 3 (') and f'| 1 | {held}' in line and line.endswith('| - |')
    assert pd.read_csv(results / 'hard_oracle.csv.gz').empty
    kept, = (tmp_path / 'kept').iterdir()
    before = kept.read_bytes()
    hard.main()
    assert kept.read_bytes() == before


def test_all_remedies_are_contestants_of_other_names():
    labels = [one.label for one in parse_all((*METHODS, *hard.REMEDIES))]
    assert tuple(labels[3:]) == hard.REMEDIES   # by which the page finds their rows
