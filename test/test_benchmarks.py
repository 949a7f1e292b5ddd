# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The benchmark times the same problem for everyone; peers that are not installed are skipped."""

import json
import math
import shutil
import sys
import time
from types import SimpleNamespace

import benchmark
import benchmark_figures
import benchmark_page
import numpy as np
import pytest
import timing
import torch

from dp_swing_ros.control import controllers
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.pendulum.state import hanging
from dp_swing_ros.problem.cost import running, terminal, trajectory_cost
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.problem.problem import plan_of
from dp_swing_ros.solvers import SOLVERS


@pytest.fixture
def problem():
    return controllers.problem({})


def test_the_ratio_of_a_race_is_that_of_the_work(rng, monkeypatch):
    monkeypatch.setattr(timing, 'time', SimpleNamespace(   # of which others take none
        perf_counter=time.process_time, sleep=time.sleep))
    A = rng.normal(size=1_000_000)

    def work(times):
        def run():
            for _ in range(times):
                np.sin(A)
            return 1
        return run
    times = timing.race({'one': work(1), 'eight': work(8)}, 15)
    found = timing.ratio(times['eight'], times['one'])
    assert found.low <= found.value <= found.high
    assert 4 < found.value < 16


def test_solves_are_timed_to_the_same_cost(problem, monkeypatch):
    import peers_solvers as peers
    monkeypatch.setattr(peers, 'STARTS', 3)
    monkeypatch.setattr(peers, 'others', dict)   # ours alone
    found = json.loads(json.dumps(peers.solves(problem, 2)))
    assert set(found) == {'cold', 'warm'}
    for rows in found.values():
        ends = np.array([rows[name]['end'] for name in peers.OURS])
        for name in peers.OURS:
            row = rows[name]
            there = [count is not None for count in row['iterations']]
            goal = (1 + peers.CLOSE) * ends.min(axis=0)
            np.testing.assert_array_equal(there, row['end'] <= goal)
            assert row['reached']['successes'] == sum(there)
            assert (name in row['ratios']) == (sum(there) >= peers.LEAST)
            if name in row['ratios']:
                assert row['ratios'][name]['value'] == 1
                assert row['ratios'][name]['starts'] == sum(there)
    text = benchmark_page.solves(found)
    assert f"| ddp | {found['cold']['ddp']['reached']['successes']} of 3 " in text
    there, _ = benchmark_figures.DRAWN['solves'](found).axes   # no ratio of so few starts
    assert [label.get_text() for label in there.get_yticklabels()] == ['iLQR', 'DDP']


def test_a_solve_stops_where_it_first_reaches_the_goal(problem):
    import peers_solvers as peers
    guess = peers.cold(problem)[0]
    make = peers.ours(problem, 'ilqr')
    (name, of), = peers.reached(problem, {'ilqr': make}, guess).items()
    goal = (1 + peers.CLOSE) * of.end
    costs = [peers.followed(problem, guess.x_0, *make(guess, count)()).J
             for count in (of.iterations - 1, of.iterations)]
    assert costs[1] <= goal < costs[0]
    X, U = make(guess, 500)()
    assert peers.reached(problem, {'ilqr': make}, guess._replace(X=X, U=U)) == {}


def test_a_plan_counts_as_it_is_followed():
    import peers_gradient
    import peers_solvers as peers
    problem = peers_gradient.problem()
    plan = peers_gradient.first_plan(problem)
    X, U = peers.ours(problem, 'ilqr')(peers.Guess(plan.X[0], plan.X, plan.U), 50)()
    J = trajectory_cost(problem.cost, X, U)
    assert peers.followed(problem, X[0], X, U).J == pytest.approx(J, rel=1e-9)
    # what does not follow from its forces is held to its states
    apart = peers.followed(problem, X[0], X, U + 0.1).J
    alone = trajectory_cost(problem.cost, rollout(problem.model, X[0], U + 0.1), U + 0.1)
    assert J < apart < 0.1 * alone
    assert peers.followed(problem, X[0], X * np.nan, U * np.nan).J == np.inf


def test_warm_starts_begin_where_the_last_plan_leads(problem, monkeypatch):
    import peers_solvers as peers
    monkeypatch.setattr(peers, 'STARTS', 6)
    guesses = peers.warm(problem)
    assert len(guesses) == 6
    for guess in guesses:
        np.testing.assert_array_equal(guess.X[0], guess.x_0)
        np.testing.assert_allclose(rollout(problem.model, guess.x_0, guess.U), guess.X, atol=1e-9)


@pytest.mark.parametrize('solver', ['ipopt', 'fatrop'])
def test_casadi_s_c_code_solves_what_its_machine_does(solver, problem, monkeypatch):
    pytest.importorskip('casadi', reason='casadi is not installed; see make results')
    import peers_casadi
    import peers_solvers as peers
    if not peers_casadi.COMPILER:
        pytest.skip('there is no C compiler')
    monkeypatch.setattr(peers_casadi, 'FLAGS', ('-O0', '-shared', '-fPIC'))   # in seconds
    guess = peers.warm(problem)[0]
    found = [peers_casadi.Program(problem, solver, 1e-9, compiled).solve(guess, 50)
             for compiled in (True, False)]
    best = peers.ours(problem, 'ilqr')(guess, 500)()
    for compiled, machine, ours in zip(*found, best):
        np.testing.assert_allclose(compiled, machine, rtol=0, atol=1e-5)
        np.testing.assert_allclose(compiled, ours, rtol=0, atol=1e-2)


@pytest.fixture(params=['default', 'euler', 'one link'])
def ours(request):
    import peers_gradient
    return peers_gradient.problem(**{
        'default': {'horizon': 50}, 'euler': {'model': 'euler'}, 'one link': {'links': 1}}[
            request.param])


def test_acados_s_problem_is_the_same_number_for_number(ours):
    pytest.importorskip('acados', reason='acados is not installed; see make results')
    peers = pytest.importorskip('peers_acados')
    import peers_gradient
    plan, sqp = peers_gradient.first_plan(ours), peers.Descent(ours, 1e-9)
    X, U = plan.X.copy(), plan.U.copy()
    sqp.limit(100)
    assert 0 < sqp.solve(X, U) < 100
    # where it has converged, its states are the rollout of its forces, within its tolerance
    assert sqp.acados.cost() == pytest.approx(trajectory_cost(ours.cost, X, U), rel=1e-12)
    assert sqp.acados.cost() == pytest.approx(
        trajectory_cost(ours.cost, rollout(ours.model, plan.X[0], U), U), rel=1e-6)


def test_acados_takes_as_many_iterations_as_were_asked_for():
    pytest.importorskip('acados', reason='acados is not installed; see make results')
    peers = pytest.importorskip('peers_acados')
    import peers_gradient
    works = peers.descents(peers_gradient.problem('euler'))
    assert list(works) == ['acados SQP', 'acados RTI']
    assert {work() for work in (*works.values(), *works.values())} == {peers_gradient.ITERATIONS}


@pytest.fixture(scope='module')
def of_cpp():
    """Return by name what makes the solvers of peers that are C++, and an option of each."""
    pytest.importorskip('casadi', reason='casadi is not installed; see make results')
    if not all(map(timing.has, ('libaligator', 'libcrocoddyl', 'libmim-solvers'))):
        pytest.skip('aligator, crocoddyl or mim-solvers is not installed; see make results')
    import peers_aligator
    import peers_casadi
    import peers_crocoddyl
    if not (peers_casadi.COMPILER and shutil.which('c++')):
        pytest.skip('there is no C++ compiler')
    return {'aligator': (peers_aligator.ProxDDP, peers_aligator.PENALTY), **{
        kind: (peers_crocoddyl.Crocoddyl, number)
        for number, kind in enumerate(peers_crocoddyl.KINDS)}}


@pytest.mark.parametrize('name', [
    'aligator', 'crocoddyl DDP', 'crocoddyl FDDP', 'crocoddyl BoxDDP', 'crocoddyl BoxFDDP',
    'mim_solvers SQP', 'mim_solvers CSQP'])
def test_the_problem_in_cpp_is_the_same_number_for_number(name, of_cpp, ours):
    import peers_gradient
    plan, (peer, option) = peers_gradient.first_plan(ours), of_cpp[name]
    X, U = plan.X.copy(), plan.U.copy()
    solver = peer(ours, 1e-9, option)
    assert solver.solve(X, U, 50) > 0
    assert solver.cost[0] < plan.stats.cost
    assert solver.cost[0] == pytest.approx(trajectory_cost(ours.cost, X, U), rel=1e-12)
    assert solver.cost[0] == pytest.approx(
        trajectory_cost(ours.cost, rollout(ours.model, plan.X[0], U), U), rel=1e-6)


def test_an_iteration_of_crocoddyl_is_one_of_ilqr(of_cpp):
    """So its derivatives are ours, too, also far from the goal."""
    import peers_gradient
    ours, (peer, option) = peers_gradient.problem(bound=math.inf), of_cpp['crocoddyl DDP']
    U = np.random.default_rng(0).uniform(-10, 10, ours.horizon)
    plan = plan_of(ours, rollout(ours.model, hanging(), U), U, Status.COMPLETE)
    X, U = plan.X.copy(), plan.U.copy()
    assert peer(ours, 1e-300, option).solve(X, U, 1) == 1
    one = SOLVERS['ilqr'](ours, SOLVERS['ilqr'].Parameters(iterations=1)).solve(
        plan.X[0], plan, math.inf)
    np.testing.assert_allclose(U, one.U, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(X, one.X, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize(('horizon', 'links'), [(10, 2), (500, 2), (30, 1), (30, 3)])
def test_near_the_goal_every_step_is_whole_and_two_are_enough(horizon, links):
    import peers_gradient
    ours = peers_gradient.problem(horizon=horizon, links=links)
    plan = peers_gradient.first_plan(ours)
    assert np.abs(plan.U).max() < peers_gradient.BOUND
    for name in peers_gradient.OURS:
        costs = [SOLVERS[name](ours, SOLVERS[name].Parameters(
            iterations=count, tolerance=0.0)).solve(plan.X[0], plan, math.inf).stats.cost
            for count in (1, peers_gradient.ITERATIONS, 50)]
        assert costs[0] < plan.stats.cost * (1 - 1e-3)
        assert costs[1] == pytest.approx(costs[2], rel=1e-9) and costs[1] < costs[0]


@pytest.mark.parametrize('name', ['aligator', 'crocoddyl BoxFDDP', 'mim_solvers CSQP'])
def test_what_cannot_be_solved_leaves_the_next_solve_as_it_was(name, of_cpp):
    import peers_gradient
    from peers_casadi import Guess
    ours, (peer, option) = peers_gradient.problem(), of_cpp[name]
    plan, solver = peers_gradient.first_plan(ours), peer(ours, 1e-9, option)
    guess = Guess(plan.X[0], plan.X, plan.U)
    before = solver.trajectory(guess, 20)
    beyond = guess._replace(X=np.full_like(guess.X, np.nan))
    solver.trajectory(beyond, 20)
    for after, first in zip(solver.trajectory(guess, 20), before):
        np.testing.assert_allclose(after, first, rtol=1e-9, atol=1e-12)


def test_all_contenders_take_as_many_iterations_as_were_asked_for(of_cpp):
    import peers_gradient
    counts = {name: work() for name, work in peers_gradient.descents(
        peers_gradient.problem()).items() if name != peers_gradient.ALONE}
    assert set(counts.values()) == {peers_gradient.ITERATIONS}
    assert {'ilqr', 'ddp', 'aligator ProxDDP', 'crocoddyl BoxDDP'} <= set(counts)


def test_the_fewest_that_reach_a_goal_are_found():
    import peers_solvers as peers
    assert [peers.fewest(lambda count, of=of: count >= of) for of in (1, 2, 77, 500)] == [
        1, 2, 77, 500]


def test_torch_has_our_step_and_cost(problem, rng):
    peers = pytest.importorskip('peers_sampling')
    X, U = rng.normal(size=(50, 6)), 10 * rng.normal(size=50)
    following = [rollout(problem.model, x, np.array([u]))[1] for x, u in zip(X, U)]
    theirs = peers.torch_step(problem)(torch.tensor(X), torch.tensor(U))
    np.testing.assert_allclose(theirs, following, rtol=0, atol=1e-12)
    of_running, of_terminal = peers.costs(problem, torch.float64)
    np.testing.assert_allclose(of_running(torch.tensor(X), torch.tensor(U[:, None])),
                               [running(problem.cost, x, u) for x, u in zip(X, U)], rtol=1e-12)
    np.testing.assert_allclose(of_terminal(torch.tensor(X[:, None]), torch.empty(0)),
                               [terminal(problem.cost, x) for x in X], rtol=1e-12)


def test_hydrax_has_our_step_and_cost(problem, rng):
    pytest.importorskip('hydrax', reason='hydrax is not installed; see make results')
    import jax
    import peers_hydrax
    x, U = rng.normal(size=6), rng.uniform(-10, 10, (5, problem.horizon))
    with jax.enable_x64(True):
        found = peers_hydrax.costs(problem, x, U)
    np.testing.assert_allclose(found + running(problem.cost, x, 0.0), [
        trajectory_cost(problem.cost, rollout(problem.model, x, forces), forces) for forces in U],
        rtol=1e-12)


def test_casadi_has_our_step_and_cost(problem, rng):
    pytest.importorskip('casadi', reason='casadi is not installed; see make results')
    import peers_casadi
    f, of_running, of_terminal = peers_casadi.functions(problem)
    for x, u in zip(rng.normal(size=(20, 6)), 10 * rng.normal(size=20)):
        np.testing.assert_allclose(np.ravel(f(x, u)), rollout(problem.model, x, np.array([u]))[1],
                                   rtol=0, atol=1e-12)
        assert float(of_running(x, u)) == pytest.approx(running(problem.cost, x, u), rel=1e-12)
        assert float(of_terminal(x)) == pytest.approx(terminal(problem.cost, x), rel=1e-12)


def test_growth_is_a_table_and_a_picture():
    import peers_gradient

    def race(times):
        return {'seconds': {name: {'value': t} for name, t in times.items()}, 'ratios': {
            name: {'ilqr': {'value': t / times['ilqr']}} for name, t in times.items()}}
    races = {'horizon': {'10': race({'ilqr': 1e-5, 'other': 5e-6}),
                         '500': race({'ilqr': 4e-4, 'other': 8e-4})},
             'links': {'1': race({'ilqr': 1e-5, 'other': 3e-5})}}
    text = benchmark_page.growth(races)
    assert '| horizon | 10 | 500 |' in text
    assert '| other | 5 (0.5) | 800 (2) |' in text and '| other | 30 (3) |' in text
    assert benchmark_page.ahead({'growth': races}) == [
        'other takes 0.5 times as long as ours (horizon 10)']
    assert [axes.get_xlabel() for axes in benchmark_figures.growth(races).axes] == [
        'horizon [steps]', 'links']
    counts = [(by, count) for by, count, _ in peers_gradient.growing()]
    assert counts == [*(('horizon', N) for N in peers_gradient.HORIZONS),
                      *(('links', n) for n in peers_gradient.LINKS)]


def test_the_page_says_met_missed_and_what_is_missing():
    seconds = {'value': 1e-4, 'low': 9e-5, 'high': 1.1e-4}
    ours, kinds = 'mppi, 2 threads', ('closed', 'compiled')
    race = {'seconds': dict.fromkeys((ours, *kinds), seconds), 'ratios': {
        name: {ours: {'value': value, 'low': 1, 'high': 2}}
        for name, value in ((ours, 1), ('closed', 300), ('compiled', 30))}}
    page = benchmark_page.page({
        'made': 'Made today.\n', 'rounds': 3, 'sampling': {'1024': race, '8192': race},
        'missing': {'solves': 'casadi is not installed'}})
    assert '1024 samples | at least 100 | 300 | met |' in page
    assert '8192 samples | at least 40 | 30 | **missed** |' in page
    assert 'solves, for casadi is not installed' in page


def test_the_page_begins_with_where_a_peer_is_ahead():
    def row(there, **ratios):
        return {'reached': {'successes': there, 'runs': 20},
                'iterations': [*[3] * there, *[None] * (20 - there)],
                'ratios': {our: {'value': value} for our, value in ratios.items()}}
    results = {
        'gradient': {'rk4': {'ratios': {
            'ilqr': {'ilqr': {'value': 1}, 'ddp': {'value': 0.7}},
            'ddp': {'ilqr': {'value': 1.4}, 'ddp': {'value': 1}},
            'fast': {'ilqr': {'value': 0.8}, 'ddp': {'value': 0.6}},
            'between': {'ilqr': {'value': 1.2}, 'ddp': {'value': 0.9}},
            'CasADi, step, cost and derivatives alone': {'ilqr': {'value': 0.5},
                                                         'ddp': {'value': 0.4}}}}},
        'solves': {'cold': {'ilqr': row(17, ilqr=1, ddp=1.5), 'ddp': row(16, ilqr=0.7, ddp=1),
                            'often': row(18, ilqr=3, ddp=4), 'quick': row(17, ilqr=0.4, ddp=0.6),
                            'never': row(0)}}}
    assert benchmark_page.ahead(results) == [
        'fast takes 0.8 times as long as ours (rk4)',
        'often gets to the least cost from 18 of 20 starts, of ours ilqr from 17 (cold; '
        'McNemar p 1)',
        'quick takes 0.6 times as long as ours (cold)']


def test_a_solver_of_others_goes_through_closed_loops_alone_and_with_ours_around_it(monkeypatch):
    import closed_loops
    import peers_solvers
    stranger = closed_loops.whole('stranger', lambda problem, tolerance: peers_solvers.ours(
        problem, 'ilqr'))
    wild = closed_loops.whole('wild', lambda problem, tolerance: lambda guess, count: (
        lambda: (guess.X * np.nan, guess.U * np.nan)))
    monkeypatch.setitem(closed_loops.SOLVERS, 'stranger', stranger)
    monkeypatch.setitem(closed_loops.SOLVERS, 'wild', wild)
    found = closed_loops.loops(closed_loops.played(1))
    assert set(found) == {
        (name, kind) for name in ('ilqr', 'ddp', 'mppi', closed_loops.BOUNDED, 'stranger', 'wild')
        for kind in closed_loops.KINDS}
    around = found['ilqr', closed_loops.AROUND]
    assert around.cost.value == 1 and around.held == (1, 1, *around.held[2:])
    assert found['stranger', closed_loops.AROUND].held.successes == 1
    assert not found['wild', closed_loops.ALONE].held.successes   # and it ends all the same
    quick = around._replace(p50=1e-3)
    others = {key: loop._replace(p50=1e3, p99=1e3) for key, loop in found.items()
              if key[0] in ('stranger', 'wild')}
    quicker = found['wild', closed_loops.AROUND]._replace(p50=1e-4)   # one of ours, holds nothing
    page = closed_loops.page({**found, **others, ('stranger', closed_loops.AROUND): quick,
                              (closed_loops.BOUNDED, closed_loops.AROUND): quicker}, 'Made')
    assert 'ahead:** the p50 of a tick of `stranger` with ours around it is shorter.' in page
    assert '| `stranger` | alone |' in page
    alone = {key: loop for key, loop in found.items() if key != ('wild', closed_loops.AROUND)}
    benchmark_figures.loops(alone, closed_loops.KINDS)


def test_where_there_is_no_gpu_the_page_says_so(tmp_path, monkeypatch):
    torch = pytest.importorskip('torch')
    if torch.cuda.is_available():
        pytest.skip('there is a GPU')
    monkeypatch.setattr(sys, 'argv', ['', '--only', 'gpu', '--docs', str(tmp_path)])
    benchmark.main()
    text = (tmp_path / 'results' / 'benchmark.md').read_text()
    assert 'Not measured: ' in text and 'gpu, for torch' in text
    assert 'finds no NVIDIA GPU' in text


def test_an_update_on_a_gpu_stands_beside_the_published_one():
    seconds = {'value': 1e-4, 'low': 9e-5, 'high': 1.1e-4}
    one = 'mppi, 2,048 samples'
    page = benchmark_page.page({
        'made': 'Made today.\n', 'rounds': 3, 'missing': {}, 'gpu': {
            'device': 'some GPU', 'seconds': {one: seconds},
            'ratios': {one: {one: {'value': 1, 'low': 1, 'high': 1}}}}})
    assert '## MPPI on some GPU, 100 steps' in page
    assert '| mppi, 2,048 samples | 0.1 |' in page
    assert '0.146 ms' in page
