# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of what each part of the controller is worth, on a few episodes of it."""

import ablation
import numpy as np
import pytest
from results import row

from dp_swing_ros.control import controllers
from dp_swing_ros.control.supervisor import Supervisor
from dp_swing_ros.estimators import kalman
from dp_swing_ros.evaluation.campaign.contestants import key, parse, play, simulated

BY_CODE = [part for part in ablation.PARTS if part.code]


def first(title, name, trial):
    return ablation.Cell(ablation.BY_TITLE[title], name, trial).episodes()[0]


@pytest.mark.parametrize('part', ablation.PARTS[1:], ids=lambda part: part.title)
def test_what_is_left_out_is_there_by_default(part):
    defaults = controllers.MPC.complete({})
    assert part.mpc or part.code
    assert controllers.MPC.complete({**part.mpc}) != defaults or not part.mpc
    for name, value in part.mpc.items():
        solver, _, parameter = name.rpartition('.')
        assert value != defaults.get(name, defaults.get(parameter)), name
    for (owner, name), value in part.code.items():
        assert getattr(owner, name) is not value


@pytest.mark.parametrize('part', BY_CODE, ids=lambda part: part.title)
def test_the_code_is_as_before_after_each_tick(part):
    before = {(owner, name): getattr(owner, name) for owner, name in part.code}
    contestant, case = ablation.Cell(part, 'ilqr', ablation.TRIALS[1]).episodes()[0]
    controller = contestant.prepare()(0)
    controller.update(0.0, np.array(case.plant['initial_state']), 0.0)
    controller.fallback(0.05)
    assert all(getattr(*place) is value for place, value in before.items())


def test_the_code_is_another_during_a_tick():
    controller = first('estimator: three refusals before it starts anew (one)', 'ilqr',
                       ablation.PUSHES)[0].prepare()(0)
    seen = []
    controller.controller.planner.search = lambda *about: seen.append(kalman.REFUSALS) or []
    with pytest.raises(ValueError):   # of no plans there is no cheapest
        controller.update(0.0, np.full(6, 0.01), 0.0)
    assert seen == [1]
    assert kalman.REFUSALS == 3


def test_without_a_part_of_none_a_run_is_that_of_the_defaults():
    contestant, case = first(ablation.DEFAULTS, 'ilqr', ablation.TRIALS[1])
    assert np.array_equal(simulated(contestant, case).X, simulated(parse('ilqr'), case).X)


@pytest.mark.parametrize('title', [
    'delay compensation', 'start: the regulator', 'estimator: its pendulum in the plans'])
def test_without_its_code_a_run_is_another(title):
    trial = ablation.BY_TITLE[title].meant or ablation.TRIALS[-1]
    default, without = (simulated(*first(each, 'mppi', trial))
                        for each in (ablation.DEFAULTS, title))
    assert not np.array_equal(default.X, without.X)


def test_without_the_fallback_a_lost_state_is_answered_by_zero():
    contestant, _ = first('the fallback (zero force instead)', 'ilqr', ablation.TRIALS[1])
    controller = contestant.prepare()(0)
    controller.update(0.0, np.array([0.0, 0.1, 0.1, 0.0, 0.0, 0.0]), 0.0)
    assert controller.fallback(0.05).U[0] == 0
    assert Supervisor.fallback is not ablation.no_force


def test_without_the_estimator_wrong_velocities_are_believed():
    with_it, without = ([play(*episode).metrics.success for episode in ablation.Cell(
        ablation.BY_TITLE[title], 'ilqr', ablation.NOISE).episodes()[:4]]
        for title in (ablation.DEFAULTS, 'all around the solver'))
    assert sum(with_it) >= 3 and not any(without)


@pytest.mark.parametrize('trial', dict.fromkeys((*ablation.TRIALS, *(
    part.meant for part in ablation.PARTS if part.meant))), ids=str)
def test_a_trial_has_a_case_for_each_seed(trial):
    assert [case.seed for case in trial.cases()] == list(trial.seeds)


def of(held, costs):
    return [row(held=one, closed_loop_cost=cost) for one, cost in zip(held, costs)]


@pytest.mark.parametrize('held, cost, verdict', [
    (20, 1.2, 1), (20, 1.0, 0), (20, 0.8, -1), (10, 1.0, 1), (18, 1.0, 0)])
def test_worse_and_better_are_told_from_nothing(held, cost, verdict):
    costs = np.linspace(100, 200, 20)
    found = ablation.difference(of([n < held for n in range(20)], cost * costs),
                                of([True] * 20, costs))
    assert found.verdict == verdict
    assert (found.held, found.of_defaults, found.cases) == (held, 20, 20)
    assert found.cost.value == pytest.approx(cost)


def test_the_page_says_what_each_part_is_worth(monkeypatch):
    monkeypatch.setattr(ablation, 'SEEDS', range(4))
    monkeypatch.setattr(ablation, 'FEW', range(4))
    trials = tuple(trial._replace(seeds=range(12)) for trial in ablation.TRIALS)
    parts = [ablation.PARTS[0], *(ablation.BY_TITLE[title]._replace(meant=None) for title in (
        'delay compensation', 'start: no force', 'all around the solver'))]
    monkeypatch.setattr(ablation, 'TRIALS', trials)
    monkeypatch.setattr(ablation, 'PARTS', parts)
    rows = []
    for contestant, case in ablation.episodes():
        worse = contestant.part == 'delay compensation' and case.scenario == 'random'
        one = row(held=not worse or case.seed < 2, closed_loop_cost=100.0 + case.seed)
        rows.append(type(one)(key(contestant, case), one.outcome, '', one.metrics, np.zeros(0)))
    text = ablation.page(rows, 'made up')
    assert '| delay compensation | `ilqr` | **2 of 12, ' in text
    assert 'Worth it: delay compensation.' in text
    assert 'Nothing shown: start: no force; all around the solver.' in text
    assert 'with nothing around it, 12 of 12 (`random`), 12 of 12 (`rig_all`)' in text
