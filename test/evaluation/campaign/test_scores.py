# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
import math

import pytest
from results import row

from dp_swing_ros.evaluation.campaign.summary import (
    CRITERIA, Level, levels, NORMS, passed_fraction, performance, score)


def test_performance_is_the_leaderboards_formula():
    costs = {name: norm / 2 for name, norm in NORMS.items()}
    assert performance(row(**costs).metrics) == pytest.approx(1 - math.tanh(math.pi / 2))
    assert performance(row(**dict.fromkeys(NORMS, 0.0)).metrics) == 1.0
    assert performance(row(held=False).metrics) == 0.0


def test_performance_weighs_five_costs_alike():
    free = dict.fromkeys(NORMS, 0.0)
    for name in NORMS:
        assert performance(row(**{**free, name: 1e9}).metrics) == pytest.approx(0.8)


@pytest.mark.parametrize('held, runs, passed', [(1, 1, True), (0, 1, False), (5, 10, False),
                                                (6, 10, True)])
def test_a_level_passes_with_more_than_half(held, runs, passed):
    assert Level(0.1, held, runs).passed is passed


def test_runs_are_gathered_by_level_in_order():
    rows = [row(parameter='delay', level=0.1, seed=0),
            row(parameter='delay', level=0.0, seed=0),
            row(parameter='delay', level=0.1, seed=1, held=False), row()]
    assert levels(rows) == {'delay': [Level(0.0, 1, 1), Level(0.1, 1, 2)]}
    assert passed_fraction(rows) == 0.5


def test_robustness_needs_all_six():
    assert len(CRITERIA) == 6
    groups = {('ilqr', name): [
        row(scenario=name, parameter='swept', level=0.0),
        row(scenario=name, parameter='swept', level=1.0, held=n % 2 == 0)]
        for n, name in enumerate(CRITERIA)}
    assert score('ilqr', groups).robustness == pytest.approx(0.75)
    del groups['ilqr', 'delay']
    assert math.isnan(score('ilqr', groups).robustness)
