# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page on convergence: its descents are the solvers', its orders those of known sequences."""

from dataclasses import replace
import math

import convergence
import numpy as np
import pandas as pd
from PIL import Image
import pytest

from dp_swing_ros.control import controllers
from dp_swing_ros.problem.cost import trajectory_cost
from dp_swing_ros.problem.plan import Status

DDP = convergence.DESCENTS[1]


@pytest.fixture(scope='module')
def problem():
    return controllers.problem({})


@pytest.mark.parametrize('changed', [{}, {'iterations': 300, 'tolerance': 0.0}, {'iterations': 3}],
                         ids=['as it is', 'to its end', 'three passes'])
@pytest.mark.parametrize('method', convergence.DESCENTS, ids=lambda method: method.label)
def test_the_loop_written_out_ends_where_the_solver_does(problem, method, changed):
    solver = convergence.solver_of(method, problem, **changed)
    for seed in range(6):
        start = convergence.cold(problem, seed)
        plan = solver.solve(*start, math.inf)
        status, passes, end = convergence.descent(solver, start)
        assert (status, end.J, len(passes)) == plan.stats[:3]
        for found, expected in zip(end[1:], (plan.X, plan.U, plan.K)):
            np.testing.assert_array_equal(found, expected)
        np.testing.assert_array_equal(passes[-1].U, end.U)


def test_the_loop_says_where_there_is_no_finite_plan(problem):
    x_0 = np.array([0, 0, 0, 1e200, 0, 0])
    solver = convergence.solver_of(DDP, problem, iterations=2)
    start = convergence.Start(x_0, None)
    assert convergence.descent(solver, start)[0] is Status.FAILED
    assert solver.solve(*start, math.inf).stats.status is Status.FAILED


def test_passes_are_counted_as_they_ended(problem):
    start = convergence.cold(problem, 1)
    _, passes, _ = convergence.descent(convergence.solver_of(DDP, problem), start)
    assert passes[0].share == 1 and not passes[0].positive and not passes[0].accepted
    assert passes[1].share == pytest.approx(0.1)
    row = convergence.counted(problem, DDP, start)
    aborted = [one for one in passes if not one.positive]
    assert row['passes'] == len(passes) and row['aborted'] == len(aborted) > 0
    assert row['on_bound'] == sum(one.bounded for one in aborted)
    assert row['steps_in_full'] <= row['in_full'] == sum(one.share == 1 for one in passes) > 0
    assert row['without'] == 0 and row['accepted'] < len(passes)
    of_ilqr = convergence.counted(problem, convergence.DESCENTS[0], start)
    assert of_ilqr['aborted'] == of_ilqr['in_full'] == 0 < of_ilqr['accepted']
    assert of_ilqr['without'] == of_ilqr['passes']


def test_a_start_has_its_goal_on_the_turn_where_it_ends(problem):
    starts = [convergence.cold(problem, seed) for seed in range(20)]
    for x_0, plan in starts:
        assert np.all(np.abs(plan.X[-1, 1:3]) <= np.pi)
        assert np.array_equal(x_0, plan.X[0]) and not plan.U.any()
        assert plan.stats.cost >= 0
    assert any(np.any(np.abs(x_0[1:3]) > np.pi) for x_0, _ in starts)   # else nothing was turned


def test_warm_starts_are_those_of_a_loop(problem):
    starts = convergence.warm(problem, 0)
    assert len(starts) > 10
    costs = [convergence.counted(problem, DDP, start)['cost'] for start in starts]
    followed = [trajectory_cost(problem.cost, plan.X, plan.U) for _, plan in starts]
    assert all(cost < math.inf for cost in costs)
    # the rest of a good plan: a few passes, and a cost that falls as the pendulum rises
    assert np.median([convergence.counted(problem, DDP, start)['passes']
                      for start in starts]) < 10
    assert followed[-1] < followed[0]


def test_an_optimum_is_one(problem):
    start = convergence.cold(problem, 1005)
    solver = convergence.solver_of(DDP, problem, iterations=300, tolerance=0.0)
    _, passes, end = convergence.descent(solver, start)
    U = convergence.optimum(problem, end)
    assert np.linalg.norm(U - end.U) < 1e-6
    # from the middle of the descent Newton's method does not come to rest nearby
    middle = next(one for one in reversed(passes) if np.linalg.norm(one.U - U) > 10)
    X = convergence.rollout(problem.model, start.x_0, middle.U)
    assert convergence.optimum(problem, end._replace(X=X, U=middle.U)) is None


@pytest.mark.parametrize('q, c, e', [(1.0, 0.3, 1.0), (2.0, 0.5, 0.5), (1.6, 1.0, 0.5)])
def test_the_order_of_a_sequence_is_found(q, c, e):
    distances = [e]
    for _ in range(4):
        distances.append(c * distances[-1] ** q)
    assert convergence.order(np.array(distances)) == pytest.approx(q)
    assert math.isnan(convergence.order(np.array(distances[:2])))


def test_ddp_ends_quadratically_and_ilqr_does_not(problem):
    orders = {method.label: [convergence.order(end) for seed in range(1003, 1015) if (
        end := convergence.ending(problem, method, convergence.cold(problem, seed))) is not None]
        for method in convergence.DESCENTS}
    ilqr, ddp = (np.median(of) for of in orders.values())
    assert ilqr < 1.2 and 1.6 < ddp < 2.4


def test_pooled_shares_are_those_of_all_starts(rng):
    whole = rng.integers(10, 50, 400)
    part = rng.binomial(whole, 0.3)
    found = convergence.pooled(part, whole)
    assert found.value == part.sum() / whole.sum()
    assert found.low < found.value < found.high < found.low + 0.03


def test_iterates_have_the_costs_of_their_limits(problem, monkeypatch):
    monkeypatch.setattr(convergence, 'LIMITS', (1, 2, 5))
    for method in convergence.METHODS:
        rows = convergence.iterates(problem, method, 1000)
        assert [row['iterations'] for row in rows] == [1, 2, 5]
        assert all(row['seconds'] > 0 for row in rows)
        costs = [row['cost'] for row in rows]
        assert costs == sorted(costs, reverse=True)


def test_the_page_says_what_was_found(problem, monkeypatch, tmp_path):
    monkeypatch.setattr(convergence, 'LIMITS', (1, 3, 10))
    monkeypatch.setattr(convergence, 'SHOWN', (1, 3, 10))
    found = convergence.all_iterates(problem, range(1000, 1003))
    passes = convergence.all_passes(problem, range(20), range(2))
    ends = convergence.all_ends(problem, range(1003, 1008))
    above = convergence.suboptimality(found)
    assert above.groupby('seed')['above'].min().tolist() == [0, 0, 0]
    page = convergence.page(found, passes, ends, 'made')
    for method in convergence.METHODS:
        best = above[(above['method'] == method.label) & (above['iterations'] == 10)]['above']
        assert f'{(best <= 0.01).sum()} of 3 (' in page.split(f'| {method.label} | ')[1]
    for method in convergence.DESCENTS:
        of = passes[(passes['method'] == method.label) & (passes['start'] == 'random')]
        line = page.split(f'| random | {method.label} | ')[1].splitlines()[0]
        assert line.startswith(f'20 | {of["passes"].sum()} | ')
        assert f'| {of["converged"].sum()}: ' in line
    path = tmp_path / 'convergence.png'
    convergence.picture(found, ends).savefig(path)
    with Image.open(path) as image:
        image.verify()


def test_what_second_order_terms_bring_is_told_against_ilqr_from_the_same_starts():
    ilqr, ddp = (method.label for method in convergence.DESCENTS[:2])
    solve = {'start': 'random', 'accepted': 8, 'without': 0, 'converged': 1}
    found = pd.DataFrame([
        # the same optimum in fewer passes; another one at twice the cost; one without an end
        *({**solve, 'seed': seed, 'method': ilqr, 'passes': 10, 'in_full': 0, 'steps_in_full': 0,
           'cost': 100.0} for seed in range(3)),
        *({**solve, 'seed': seed, 'method': ddp, 'passes': 8, 'in_full': 2, 'steps_in_full': 1,
           'cost': cost, 'converged': converged, 'without': 4}
          for seed, cost, converged in ((0, 100.5, 1), (1, 200.0, 1), (2, 100.0, 0)))])
    line = convergence.second_order_table(found).splitlines()[-1]
    values = [cell.split(' (')[0].strip() for cell in line.split('|')[3:-1]]
    assert values == ['25.0 %', '25.0 %', '50.0 %', '12.5 %', f'{2.01 ** (1 / 3):.3f}', '0.0 %',
                      '33.3 %', '1', '0.800', '1.000']


def test_the_least_cost_is_that_of_a_start():
    found = pd.DataFrame({'seed': [1, 1, 2], 'method': list('aba'), 'cost': [2.0, 1.0, 5.0]})
    assert convergence.suboptimality(found)['above'].tolist() == [1.0, 0.0, 0.0]


def test_a_method_is_what_its_file_says(problem):
    solver = convergence.solver_of(convergence.METHODS[3], problem)
    assert solver.parameters.importance_sampling and not solver.parameters.elite
    changed = convergence.solver_of(convergence.METHODS[3], problem, iterations=3)
    assert replace(changed.parameters, iterations=solver.parameters.iterations) == (
        solver.parameters)
