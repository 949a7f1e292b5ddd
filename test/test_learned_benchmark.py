# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page of learned dynamics, of few seeds."""

import learned
import numpy as np
import pandas as pd
import pytest

from dp_swing_ros.pendulum.state import hanging, upright


def test_experience_in_trials_and_without_a_break(monkeypatch):
    monkeypatch.setattr(learned, 'TOTAL', 60.0)
    monkeypatch.setattr(learned, 'LONG', 20.0)
    rows = learned.in_trials('ilqr', 1)
    assert [row['trial'] for row in rows] == list(range(1, len(rows) + 1))
    assert rows[0]['held'] == 0.0 and max(row['held'] for row in rows) >= learned.HOLD
    assert rows[0]['experience'] == pytest.approx(learned.TRIAL)
    one = learned.without_break('our own', 'ilqr', 0)
    assert learned.FIRST < one['since'] < learned.LONG


def test_a_log_tells_enough_to_hold(monkeypatch):
    monkeypatch.setattr(learned, 'LOG', 30.0)
    rows = learned.by_log(0, ('ilqr',))
    assert [row.key[:2] for row in rows] == [
        ('ilqr', 'hanging'), ('ilqr, learned', 'hanging'), ('ilqr', 'random'),
        ('ilqr, learned', 'random')]
    assert all(row.metrics.success for row in rows)
    text = learned.of_log(rows)
    assert text.count('1 of 1') == 4 and 'Everything was held' in text


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
