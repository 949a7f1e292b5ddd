# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page of learned dynamics, of few seeds."""

import learned
import learned_rigs
import numpy as np
import pandas as pd
import pytest
from rig import Rig
import unmodelled

from dp_swing_ros.learning.experience import Experience
from dp_swing_ros.learning.models import parted
from dp_swing_ros.learning.priors import structured
from dp_swing_ros.learning.regression import FINE, fitted, predicted, spread
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.parameters import Drive, PendulumParameters
from dp_swing_ros.pendulum.state import hanging, upright
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.engines import ENGINES, Motor


def test_experience_in_trials_and_without_a_break(monkeypatch):
    monkeypatch.setattr(learned, 'TOTAL', 15.0)
    rows = learned.in_trials('ilqr', 0)
    assert [row['trial'] for row in rows] == list(range(1, len(rows) + 1))
    assert rows[0]['held'] == 0.0 and max(row['held'] for row in rows) >= learned.HOLD
    assert rows[0]['experience'] == pytest.approx(learned.TRIAL)
    one = learned.without_break('our own', 'ilqr', 0)
    assert learned.FIRST < one['since'] < learned.LONG


def test_a_log_tells_enough_to_hold():
    rows = learned.by_log(0, ('ilqr',))
    assert [row.key[:2] for row in rows] == [
        ('ilqr', 'hanging'), ('ilqr, learned', 'hanging'), ('ilqr', 'random'),
        ('ilqr, learned', 'random')]
    assert all(row.metrics.success for row in rows)
    text = learned.of_log(rows)
    assert text.count('1 of 1') == 4 and 'Everything was held' in text


def test_a_rig_is_held_by_what_its_swing_ups_have_taught():
    pytest.importorskip('mujoco')
    case, = Rig('rig_gain').cases(range(1))
    rows = learned_rigs.played(case, (1,))
    assert [row.key.contestant for row in rows] == [
        'equations, estimator', 'equations alone', 'learned, 1 swing-up', 'told']
    assert all(row.metrics.success for row in rows)
    groups = learned_rigs.by_rig(rows)
    text = learned_rigs.page(groups, 'made\n')
    assert text.count('1 of 1') == 4 and '| `rig_gain` | told | 1 of 1' in text
    assert len(learned_rigs.picture(groups).axes) == 2


@pytest.mark.parametrize('name', unmodelled.UNEVEN)
def test_a_rig_with_uneven_links_is_what_its_exact_model_says(name):
    """And no pendulum with its mass in the middle."""
    pytest.importorskip('mujoco')
    with unmodelled.engines():
        case, = unmodelled.UnevenRig(name).cases(range(1))
        engine, told = plants.plant(case.plant).engine, unmodelled.exact(case).dynamics
        h, u, x = 1e-5, 3.0, np.array([0.2, 1.0, -2.0, 0.5, 2.0, -1.0])
        moved = x.copy()
        engine.advance(moved, Motor(1.0, 0.0, 20.0, 1.0, False), 0.0, u, 0.0, h, 1)
        a = (moved - x)[3:] / h
        np.testing.assert_allclose(told.accelerations(x, u), a, atol=1e-3)
        even = Pendulum.of(PendulumParameters()).accelerations(x, u)
        assert np.abs(a - even).max() > 0.1   # a hundred times what is the engine's step
    rows = learned_rigs.played(case, ())
    assert [row.metrics.success for row in rows if row.key.contestant == 'told'] == [True]
    assert name not in ENGINES   # they are none of the product


def test_a_fit_that_passes_by_dynamics_that_are_singular_ends_well():
    """As of this swing-up, of which some slopes are beyond all numbers on the way."""
    pytest.importorskip('mujoco')
    case, = Rig('rig_lag', 0.05).cases(range(9, 10))
    run = learned_rigs.swing_up(case, learned_rigs.OTHER + 9)
    drive = run.controller.belief.drive
    parts = parted(run.experience(Drive(drive.delay, drive.time_constant)), 9)
    (untold, prior), seen = structured(2), Experience.joined(parts.seen)
    dynamics = untold.with_creep(FINE.creep)
    with np.errstate(all='ignore'):
        found = fitted(dynamics, seen, prior, FINE.step)
    off = seen.Y[:, 3:] - predicted(dynamics.with_free(found), seen, FINE.step)
    assert np.all(spread(off) < 1.0)


def test_the_tip_is_in_its_place_within_a_tenth_of_a_metre():
    X = np.array([hanging()] * 10 + [upright()] * 20)
    assert learned.tip_for(X) == 1.0
    X[20:, 0] = 0.11
    assert learned.tip_for(X) == 0.0


def test_the_page_counts_seeds():
    of_trials = pd.DataFrame([
        {'solver': solver, 'seed': seed, 'trial': trial, 'experience': 5.0 * trial,
         'held': float(trial > 1 + seed + (solver == 'ddp')), 'tip': 0.0, 'seconds': 1.0 * trial}
        for solver in ('ilqr', 'ddp') for seed in range(2) for trial in (1, 2, 3)])
    breakless = pd.DataFrame([
        {'bodies': bodies, 'solver': 'ilqr', 'seed': seed, 'since': since, 'seconds': 1.0}
        for bodies in learned.PLANTS for seed, since in enumerate((8.0, np.nan))])
    predicted = pd.DataFrame([{'model': 'one', 'seed': seed, 'speed': 0.1, 'median': 0.2,
                               'p95': 1.0} for seed in range(2)])
    text = learned.page(of_trials, breakless, [], predicted, 'made\n')
    assert '| `ilqr` | all angles within 0.2 rad | 0 | 1 | 2 | 2 of 2' in text
    assert '| `ddp` | the tip within 0.1 m of its place | 0 | 0 | 0 | 0 of 2' in text
    assert '| all angles | 10 s | 0 | 1 | 1.000 |' in text
    assert '| our own | `ilqr` | 1 of 2' in text and '| one | 0.1 ' in text
    assert len(learned.picture(of_trials, breakless).axes) == 4
