# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The benchmark times the same problem for everyone; peers that are not installed are skipped."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
import json
import sys

import benchmark
import benchmark_page
import near_goal
import numpy as np
import operations
import oracle
import pytest
import timing
import torch

from dp_swing_ros.control import controllers
from dp_swing_ros.control.bounded_lqr import BoundedLQR
from dp_swing_ros.evaluation.campaign.rows import read
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.pendulum.state import hanging
from dp_swing_ros.problem.cost import running, terminal, trajectory_cost


@pytest.fixture
def problem():
    return controllers.problem({})


def test_the_ratio_of_a_race_is_that_of_the_work(rng):
    A = rng.normal(size=1_000_000)   # so long that others interrupt both alike, if there are any

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


def test_the_exponent_of_a_power_is_found(rng):
    sizes = np.array([10, 20, 40, 80, 160])
    found = timing.exponent(sizes, 3e-6 * sizes ** 1.5 * np.exp(rng.normal(0, 0.01, 5)))
    assert found.low < 1.5 < found.high < found.low + 0.1


def test_operations_are_those_of_the_source():
    a, b = operations.remembering(2)
    assert operations.count([a * b + a * b, 2 / (b * a)]) == {'add': 1, 'multiply': 1, 'divide': 1}
    limit = pytest.importorskip('limit')
    counts = limit.operations()
    assert 500 < sum(counts['step'].values()) < sum(counts['sample'].values()) < 1000


def test_the_limit_is_reached_in_full_registers():
    limit = pytest.importorskip('limit')
    for chains in limit.CHAINS[limit.widest()]:
        spinner = limit.Spinner('float32', limit.widest(), chains)   # refuses code that is not
        assert spinner.run() == spinner.multiply_adds


def test_whatever_is_fastest_is_the_limit(monkeypatch):
    """No contender exceeds it, whoever wins: it is their maximum by construction."""
    limit = pytest.importorskip('limit')
    monkeypatch.setattr(limit, 'MATRICES', (64, 128))
    with ThreadPoolExecutor(2) as pool:
        names = [name for name in limit.machine_works(2, pool) if 'float32' in name]
    for words in ('matrix product of 64', '8 chains', '1 of 2 cores', '2 of 2 cores'):
        assert any(words in name for name in names)
    for winner in names:
        rates = {'rollouts': 3.0, **dict.fromkeys(names, 1.0), winner: 2.0}
        assert limit.limit_of(rates) == winner


def test_the_limit_is_the_best_of_all_that_is_measured(monkeypatch):
    limit = pytest.importorskip('limit')
    monkeypatch.setattr(limit, 'ROUNDS', 20_000)
    monkeypatch.setattr(limit, 'MATRICES', (64, 128))
    found = limit.measure(2)
    rates = {name: rate for name, rate in found['rates'].items() if 'float32' in name}
    assert any('matrix product' in name for name in rates)
    assert found['rates'][found['limit']] == max(rates.values())
    ours = {name: rate for name, rate in found['rates'].items() if 'rollouts' in name}
    assert found['rates'][found['best']] == max(ours.values())
    assert found['share']['low'] <= found['share']['value'] <= found['share']['high']
    assert found['share']['value'] == pytest.approx(
        found['per_step'] * max(ours.values()) / (2 * max(rates.values())))


def test_solves_are_timed_to_the_same_cost(problem, monkeypatch):
    import peers_solvers as peers
    makes = {name: peers.ours(problem, name) for name in peers.OURS}   # ours alone
    monkeypatch.setattr(peers, 'STARTS', 3)
    monkeypatch.setattr(peers, 'contests', lambda: {'nobody': (problem, makes)})
    found = json.loads(json.dumps(peers.solves(2)))
    assert set(found) == {'nobody, cold', 'nobody, warm'}
    for rows in found.values():
        ends = np.array([rows[name]['end'] for name in peers.OURS])
        for name in peers.OURS:
            row = rows[name]
            there = [count is not None for count in row['iterations']]
            np.testing.assert_array_equal(there, row['end'] <= 1.001 * ends.min(axis=0))
            assert row['reached']['successes'] == sum(there)
            assert (name in row['ratios']) == (sum(there) >= peers.LEAST)
            if name in row['ratios']:
                assert row['ratios'][name]['value'] == 1
                assert row['ratios'][name]['starts'] == sum(there)
    text = benchmark_page.solves(found)
    assert f"| ddp | {found['nobody, cold']['ddp']['reached']['successes']} of 3 " in text


def test_a_solve_stops_where_it_first_reaches_the_goal(problem):
    import peers_solvers as peers
    guess = peers.cold(problem)[0]
    make = peers.ours(problem, 'ilqr')
    (name, of), = peers.reached(problem, {'ilqr': make}, guess, False).items()
    goal = (1 + peers.CLOSE) * of.end
    costs = [trajectory_cost(problem.cost, rollout(problem.model, guess.x_0, U), U) for U in
             (make(guess, False, count)() for count in (of.iterations - 1, of.iterations))]
    assert costs[1] <= goal < costs[0]
    at_goal = guess._replace(U=make(guess, False, 500)())
    at_goal = at_goal._replace(X=rollout(problem.model, guess.x_0, at_goal.U))
    assert peers.reached(problem, {'ilqr': make}, at_goal, False) == {}


def test_warm_starts_begin_where_the_last_plan_leads(problem, monkeypatch):
    import peers_solvers as peers
    monkeypatch.setattr(peers, 'STARTS', 3)
    for guess in peers.warm(problem):
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
    compiled, machine = (peers_casadi.Program(problem, solver, compiled).solve(guess, True, 50)
                         for compiled in (True, False))
    np.testing.assert_allclose(compiled, machine, rtol=0, atol=1e-5)
    best = peers.ours(problem, 'ilqr')(guess, True, 500)()
    np.testing.assert_allclose(compiled, best, rtol=0, atol=1e-2)


def test_crocoddyl_s_problem_is_the_same_number_for_number():
    pytest.importorskip('crocoddyl', reason='crocoddyl is not installed; see make results')
    import peers_gradient as peers
    theirs, ours = peers.Crocoddyl('euler', 'C++', True, 'swing-up'), peers.same_problem()
    assert theirs.problem.nthreads == 1
    U = np.array([u[0] for u in theirs.us])
    X = rollout(ours.model, np.array(peers.STARTS['swing-up'][0]), U)
    np.testing.assert_allclose(np.array(theirs.xs), X @ peers.RELATIVE.T, rtol=0, atol=1e-12)
    assert theirs.problem.calc(theirs.xs, theirs.us) == pytest.approx(
        trajectory_cost(ours.cost, X, U), rel=1e-12)


def test_the_fewest_that_reach_a_goal_are_found():
    import peers_solvers as peers
    assert [peers.fewest(lambda count, of=of: count >= of) for of in (1, 2, 77, 500)] == [
        1, 2, 77, 500]


@pytest.mark.parametrize('kind', ['twin', 'closed'])
def test_torch_has_our_step_and_cost(kind, problem, rng):
    peers = pytest.importorskip('peers_sampling')
    X, U = rng.normal(size=(50, 6)), 10 * rng.normal(size=50)
    following = [rollout(problem.model, x, np.array([u]))[1] for x, u in zip(X, U)]
    theirs = peers.torch_step(problem, kind)(torch.tensor(X), torch.tensor(U))
    np.testing.assert_allclose(theirs, following, rtol=0, atol=1e-12)
    of_running, of_terminal = peers.costs(problem, torch.float64)
    np.testing.assert_allclose(of_running(torch.tensor(X), torch.tensor(U[:, None])),
                               [running(problem.cost, x, u) for x, u in zip(X, U)], rtol=1e-12)
    np.testing.assert_allclose(of_terminal(torch.tensor(X[:, None]), torch.empty(0)),
                               [terminal(problem.cost, x) for x in X], rtol=1e-12)


def test_mujoco_rolls_out_our_model(problem, rng):
    pytest.importorskip('mujoco')
    import peers_sampling as peers
    from mujoco import MjData
    from mujoco import rollout as theirs
    X, U = rng.normal(size=(50, 6)), 10 * rng.normal(size=50)
    model = peers.mujoco_model(problem.physical, problem.dt)
    states, _ = theirs.rollout(model, MjData(model), peers.mujoco_states(X), U[:, None, None])
    following = np.array([rollout(problem.model, x, np.array([u]))[1] for x, u in zip(X, U)])
    np.testing.assert_allclose(states[:, 0, 1:], peers.mujoco_states(following)[:, 1:], rtol=0,
                               atol=1e-9)


@pytest.mark.parametrize('actuation', ['python', 'C++'])
def test_crocoddyl_solves_our_problem(actuation):
    pytest.importorskip('crocoddyl', reason='crocoddyl is not installed; see make results')
    import peers_gradient as peers
    theirs = peers.Crocoddyl('rk4', actuation, False, 'near the goal')
    ours = peers.problem('rk4', False)
    U = np.array([u[0] for u in theirs.us])
    X = rollout(ours.model, np.array(peers.STARTS['near the goal'][0]), U)
    np.testing.assert_allclose(np.array(theirs.xs), X @ peers.RELATIVE.T, rtol=0, atol=1e-9)


@pytest.mark.parametrize('actuation', ['python', 'C++'])
def test_crocoddyl_has_our_cost(actuation):
    pytest.importorskip('crocoddyl', reason='crocoddyl is not installed; see make results')
    import peers_gradient as peers
    theirs = peers.Crocoddyl('euler', actuation, False, 'swing-up')
    X = np.linalg.solve(peers.RELATIVE, np.array(theirs.xs).T).T
    J = trajectory_cost(peers.problem('euler', False).cost, np.ascontiguousarray(X),
                        np.array([u[0] for u in theirs.us]))
    assert theirs.problem.calc(theirs.xs, theirs.us) == pytest.approx(J, rel=1e-12)


def test_casadi_has_our_step_and_cost(problem, rng):
    pytest.importorskip('casadi', reason='casadi is not installed; see make results')
    import peers_casadi
    f, of_running, of_terminal = peers_casadi.functions(problem)
    for x, u in zip(rng.normal(size=(20, 6)), 10 * rng.normal(size=20)):
        np.testing.assert_allclose(np.ravel(f(x, u)), rollout(problem.model, x, np.array([u]))[1],
                                   rtol=0, atol=1e-12)
        assert float(of_running(x, u)) == pytest.approx(running(problem.cost, x, u), rel=1e-12)
        assert float(of_terminal(x)) == pytest.approx(terminal(problem.cost, x), rel=1e-12)


@pytest.mark.parametrize('second_order', [False, True])
def test_the_paper_s_method_finds_our_policy(second_order):
    paper = pytest.importorskip('paper_method')
    problem = paper.paper_problem()
    theirs = paper.PaperMethod(problem, second_order, batched=True).policy()
    ours = paper.our_iteration(problem, second_order)[1]()
    np.testing.assert_allclose(theirs.k, ours.k, rtol=0, atol=1e-7 * np.abs(ours.k).max())
    np.testing.assert_allclose(theirs.K, ours.K, rtol=0, atol=1e-7 * np.abs(ours.K).max())


def test_the_page_says_met_missed_and_what_is_missing():
    seconds = {'value': 1e-4, 'low': 9e-5, 'high': 1.1e-4}
    race = {'seconds': {'ddp': seconds, 'autograd ddp, step by step': seconds,
                        'autograd ddp, batched': seconds},
            'ratios': {'ddp': {'ddp': {'value': 1, 'low': 1, 'high': 1}},
                       'autograd ddp, step by step': {'ddp': {'value': 3000, 'low': 1, 'high': 2}},
                       'autograd ddp, batched': {'ddp': {'value': 300, 'low': 1, 'high': 2}}}}
    page = benchmark_page.page({
        'made': 'Made today.\n', 'rounds': 3,
        'missing': {'solves': 'casadi is not installed'}, 'paper': race})
    assert '3e+03 | met |' in page
    assert '300 | **missed** |' in page
    assert 'solves, for casadi is not installed' in page


def test_where_there_is_no_gpu_the_page_says_so(tmp_path, monkeypatch):
    torch = pytest.importorskip('torch')
    if torch.cuda.is_available():
        pytest.skip('there is a GPU')
    monkeypatch.setattr(sys, 'argv', ['', '--only', 'gpu', '--docs', str(tmp_path)])
    benchmark.main()
    text = (tmp_path / 'results' / 'benchmark.md').read_text()
    assert 'Not measured: gpu, for torch' in text
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


def test_the_oracle_believes_the_plant_alone(problem):
    """A plan that holds on the plant is taken, one that does not is none, whoever made it."""
    case = next(case for case in oracle.cases() if case.seed == 1)
    x_0 = np.array(case.plant['initial_state'])
    none = np.zeros(oracle.AIM.steps)
    assert oracle.tried(problem, case, rollout(problem.model, x_0, none), none) is None
    plan = BoundedLQR(controllers.problem({'horizon': oracle.AIM.steps})).start(x_0)
    metrics = oracle.tried(problem, case, plan.X, plan.U)
    assert metrics.success and metrics.largest_angle < oracle.DROP


def test_the_oracle_finds_what_can_be_held():
    pytest.importorskip('casadi')
    easy, = (case for case in oracle.cases() if case.seed == 1)
    found, = oracle.judged([easy])
    stored, = (one for one in oracle.read(near_goal.VERDICTS) if one.seed == 1)
    assert found.held and found.angle == pytest.approx(stored.angle, abs=1e-3)
    assert found.cost == pytest.approx(stored.cost, rel=1e-3)


def test_near_the_goal_counts_what_the_oracle_holds():
    costs, none_found = near_goal.judged()
    assert costs.keys() | none_found == set(range(100)) and none_found.isdisjoint(costs)
    rows = read(near_goal.VERDICTS.with_name('near_goal.csv.gz'))
    held = near_goal.held_by(rows)
    assert all(of <= costs.keys() | none_found for of in held.values())
    page = near_goal.page(rows, 'made')
    for name, of in held.items():
        assert f'| `{name}` | {len(of & costs.keys())} of {len(costs)} ' in page
    dropped = near_goal.drops(rows, costs)
    assert {(one.solver, one.seed) for one in dropped} == {
        (name, seed) for name, of in held.items() for seed in costs.keys() - of}
    assert all(str(one) in page for one in dropped) and near_goal.reasons(dropped) in page


def test_near_the_goal_says_why_starts_are_dropped():
    cheaper = [near_goal.Drop('ilqr', seed, 0.41 + seed / 100, True, 0.2 + seed / 10)
               for seed in range(3)]
    dearer = near_goal.Drop('mppi', 2, 3.1, True, 6.5)
    lost = near_goal.Drop('ddp', 7, 3.1, False, 0.9)
    assert str(cheaper[1]) == '1: 0.42 rad at 0.30' and 'falls' in str(lost)
    all_three = near_goal.reasons([*cheaper, dearer, lost])
    assert all_three.startswith('5 runs drop starts that the oracle holds, 4 starts in all. 3 of')
    assert "(`ilqr` 0-2) are upright to the end and cost 0.20 to 0.40 of the oracle's" in all_three
    assert 'leaning 0.41 to 0.43 rad is cheaper' in all_three
    assert "1 (`mppi` 2) cost 6.50 times the oracle's" in all_three
    assert all_three.endswith('1 (`ddp` 7) fall, or strike an end of the track.')
    assert 'cheaper' not in near_goal.reasons([lost])
    assert 'worse' not in near_goal.reasons([*cheaper, lost])
    assert near_goal.reasons([]) == 'No solver drops a start that the oracle holds.'


def test_near_the_goal_takes_costs_from_rows_and_oracle():
    row = next(row for row in read(near_goal.VERDICTS.with_name('near_goal.csv.gz'))
               if row.metrics.success)
    metrics = replace(row.metrics, largest_angle=0.5, closed_loop_cost=300.0)
    runs = [replace(row, metrics=metrics),
            replace(row, metrics=replace(metrics, success=False)),
            replace(row, metrics=replace(metrics, largest_angle=0.2))]
    drops = near_goal.drops(runs, {row.key.seed: 200.0})
    assert [(one.ratio, one.upright) for one in drops] == [(1.5, True), (1.5, False)]
    assert near_goal.drops(runs, {}) == []


def test_splines_go_through_their_knots_and_keep_lines():
    import predictive_sampling as peer
    knots = np.linspace(0, 30, 10)
    np.testing.assert_allclose(peer.splines(knots, knots), np.eye(10), atol=1e-12)
    at = np.arange(30)
    np.testing.assert_allclose(peer.splines(knots, at) @ (2 * knots - 1), 2 * at - 1, atol=1e-12)


def test_predictive_sampling_follows_our_model_at_our_cost(problem, rng):
    import predictive_sampling as peer
    spline = peer.splines(np.linspace(0, problem.horizon, 10), np.arange(problem.horizon))
    x_0, drawn = rng.normal(size=6), rng.uniform(-20, 20, (70, 10)).astype(np.float32)
    U = np.clip(drawn @ spline.T, *problem.bounds)
    np.testing.assert_allclose(
        peer.costs(problem, x_0, spline, drawn),
        [trajectory_cost(problem.cost, rollout(problem.model, x_0, u), u) for u in U], rtol=5e-3)


def test_predictive_sampling_takes_the_best_and_never_loses_it(problem):
    import predictive_sampling as peer
    x_0, found = np.array([0, 0.4, -0.2, 0, 0, 0]), []
    for iterations in (1, 2, 20):
        solver = peer.PredictiveSampling(problem, peer.PredictiveSamplingParameters(
            samples=100, iterations=iterations))
        found.append(solver.solve(x_0, None, np.inf).stats.cost)
    none = np.zeros(problem.horizon)
    assert found == sorted(found, reverse=True)
    assert found[0] < trajectory_cost(problem.cost, rollout(problem.model, x_0, none), none)


def test_predictive_sampling_goes_on_from_its_last_plan(problem):
    import predictive_sampling as peer
    solver = peer.PredictiveSampling(problem, peer.PredictiveSamplingParameters(samples=1))
    first = solver.solve(hanging(), None, np.inf)
    U = np.linspace(-5, 5, problem.horizon)
    plan = solver.solve(hanging(), replace(first, U=U).shifted(problem.dt), np.inf)
    np.testing.assert_allclose(plan.U[:24], U[1:25], atol=1e-9)   # a line is its own spline
    assert plan.U[-1] == pytest.approx(5, abs=0.3)                # and what is past it stays


@pytest.mark.parametrize('links', [1, 2])
def test_predictive_sampling_plays_scenarios(links):
    import predictive_sampling as peer
    contender = peer.replanning(0.2, 0.01, links)
    one, = peer.episodes('hanging', range(3, 4), contender)
    again, = peer.episodes('hanging', range(3, 4), contender)
    assert one.closed_loop_cost == again.closed_loop_cost > 0
    assert one.ticks == 1000
    assert f'{int(one.success)} of 1 ' in ' '.join(peer.row('a', [one]))
