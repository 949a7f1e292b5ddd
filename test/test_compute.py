# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Equal-compute curves: the ladder, what is made of its rows, and that more computing pays."""

import math

import compute
import numpy as np
import optimum
import pandas as pd
import pytest
from results import error_row, row

from dp_swing_ros.control import controllers
from dp_swing_ros.evaluation.campaign.contestants import play
from dp_swing_ros.evaluation.metrics import TIME_LIMIT

LEAST = {1000: 100.0, 1001: 200.0, 1002: 300.0}


@pytest.fixture(autouse=True)
def optima(tmp_path, monkeypatch):
    """Let the optima of three starts be these."""
    monkeypatch.setattr(compute, 'OPTIMA', tmp_path / 'optimum.csv.gz')
    pd.DataFrame([optimum.Optimum(seed, cost, cost, 1, 1, 1, 0)
                  for seed, cost in LEAST.items()]).to_csv(compute.OPTIMA, index=False)


def made_up(*costs, rung=0, times=(0.002,) * 40 + (1e-4,) * 160, **of_row):
    """Return rows of a rung on the three starts."""
    return [row(compute.ladder()[rung].label, 'random', seed, closed_loop_cost=cost,
                solve_times=times, **of_row)
            for seed, cost in zip(LEAST, costs)]


def test_rungs_are_what_they_say_and_no_two_are_the_same():
    ladder = compute.ladder()
    assert len({rung.label for rung in ladder}) == len(ladder)
    complete = [controllers.MPC.complete({**rung.mpc, 'solver': rung.solver})
                for rung in ladder]   # refuses names that are none
    assert len(set(map(repr, complete))) == len(ladder)
    defaults = controllers.MPC.complete({})
    for rung, values in zip(ladder, complete):
        changed = {name for name in values if values[name] != defaults[name]} - {'solver'}
        assert rung.method == compute.TEXTBOOK or changed <= set(rung.mpc)
    textbook = next(rung for rung in ladder if rung.method == compute.TEXTBOOK)
    assert textbook.mpc['mppi.importance_sampling'] and not textbook.mpc['mppi.elite']


def test_every_rung_meets_the_same_starts_and_some_are_timed():
    episodes = compute.episodes()
    assert len(episodes) == len(compute.ladder()) * len(optimum.SEEDS)
    assert sum(compute.is_timed(case) for _, case in episodes) == (
        len(compute.ladder()) * compute.TIMED)


def test_a_rung_that_may_compute_more_costs_less():
    ladder = compute.ladder()
    one, most = (next(n for n, rung in enumerate(ladder) if rung.label == f'ilqr, passes {count}')
                 for count in (1, 50))
    of = len(optimum.SEEDS)
    first, last = (play(*compute.episodes()[n * of]) for n in (one, most))
    assert first.key.seed == last.key.seed == 1000
    assert last.metrics.closed_loop_cost < 0.8 * first.metrics.closed_loop_cost


def test_cost_is_over_the_least_known_be_it_of_a_run():
    rows = made_up(200.0, 400.0, 150.0) + made_up(400.0, 800.0, 300.0, rung=1, held=False)
    least = compute.least_known(rows)
    assert least == {1000: 100.0, 1001: 200.0, 1002: 150.0}
    first, second = compute.results(rows, least)
    assert first.cost.value == pytest.approx(4 ** (1 / 3))
    assert second.cost.value == pytest.approx(32 ** (1 / 3))   # though not held
    assert (first.held.successes, second.held.successes, second.held.runs) == (3, 0, 3)
    text = compute.page(rows, 'made')
    assert 'which is less in 1 of 3 starts' in text
    assert '| `ilqr` | passes 1 | 2.00 | 2.0 | 3 of 3' in text


def test_what_has_no_cost_is_left_out_and_counted():
    diverged = [*made_up(200.0, math.inf), error_row(compute.ladder()[0].label, 'random', 1002)]
    found, = compute.results(diverged, compute.least_known(diverged))
    assert (found.cost.pairs, found.left_out, found.held.runs) == (1, 2, 3)
    assert found.cost.value == pytest.approx(2.0)


def test_the_time_of_a_rung_is_that_of_the_swing_up():
    found, = compute.results(made_up(1.0, 1.0, 1.0), LEAST)
    assert found.time == pytest.approx(2.0)
    assert found.p99 == pytest.approx(2.0)


def test_a_budget_is_spent_on_the_slowest_rung_that_keeps_it():
    rows = (made_up(200.0, 400.0, 600.0) + made_up(150.0, 300.0, 450.0, rung=1, times=(0.008,))
            + made_up(100.0, 200.0, 300.0, rung=2, times=(0.09,)))
    found = compute.results(rows, LEAST)
    assert compute.within(found, 1.0) == '-'
    assert compute.within(found, 3.0).endswith('passes 1')
    assert compute.within(found, 10.0).startswith('1.500 ')


def test_the_picture_has_a_line_a_method_and_marks_the_limit():
    rungs = [rung.method for rung in compute.ladder()]
    rows = [one for n, _ in enumerate(rungs) for one in made_up(200.0, 400.0, 310.0 + n, rung=n)]
    figure = compute.picture(rows)
    above, below = figure.axes
    assert len(above.containers) == len(below.containers) == len(set(rungs))
    marked = {line.get_xdata()[0] for line in above.lines if len(set(line.get_xdata())) == 1}
    assert 1e3 * TIME_LIMIT in marked
    shown = np.concatenate([container.lines[0].get_ydata() for container in above.containers])
    assert len(shown) == len(rungs) and np.all(shown > 1)
