# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of scaffold and solver, on a few episodes of it."""

import ablation
import numpy as np
import pytest
from results import row

from dp_swing_ros import configuration
from dp_swing_ros.evaluation.campaign.contestants import key, play


@pytest.mark.parametrize('name', ablation.SOLVERS)
def test_each_part_alone_differs_from_none_and_all_is_as_by_default(name):
    made = {title: ablation.contestant(title, name) for title in ablation.SET_UPS}
    defaults = configuration.complete('mpc', {})
    of = {title: configuration.complete('mpc', one.mpc) for title, one in made.items()}
    for part, value in ablation.NONE.items():
        assert of['none'][part] == value != of[ablation.ALL][part] == defaults[part]
    for title, parts in ablation.ALONE.items():
        differ = {part for part, value in of[title].items() if value != of['none'][part]}
        assert differ == set(parts), title


def test_every_part_of_none_is_there_alone():
    assert set().union(*ablation.ALONE.values()) == set(ablation.NONE)


@pytest.mark.parametrize('trial', ablation.TRIALS, ids=lambda trial: trial.title)
def test_a_trial_has_a_case_for_each_seed(trial):
    assert [case.seed for case in trial.cases()] == list(trial.seeds)


def test_without_the_estimator_wrong_velocities_are_believed():
    trial = ablation.Trial('noise', 'position_noise', range(1), 0.01)
    with_it, without = (play(*ablation.of_trial(title, 'ilqr', trial)[0])
                        for title in (ablation.ALL, 'none'))
    assert with_it.metrics.success and not without.metrics.success


def test_the_page_counts_what_was_held_and_compares_costs(monkeypatch):
    monkeypatch.setattr(ablation, 'TRIALS', (ablation.Trial('starts', 'random', range(4)),))
    rows = []
    for contestant, case in ablation.episodes():
        default = contestant.label.endswith(ablation.ALL)
        one = row(held=default or case.seed != 1,
                  closed_loop_cost=100.0 + case.seed if default else 150.0 + 1.5 * case.seed)
        rows.append(type(one)(key(contestant, case), one.outcome, '', one.metrics, np.zeros(0)))
    text = ablation.page(rows, 'made up')
    assert '| `ilqr` | none | 3 of 4 | 3 of 4 (30-95 %) | 1.50 (1.50-1.50), 3 |' in text
    assert '| `ddp` | all, the defaults | 4 of 4 |' in text
    assert ablation.picture(rows).axes[0].get_title() == 'starts'
