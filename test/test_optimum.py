# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The least cost of a swing-up: the program is that of the plant, and what it finds is played."""

import numpy as np
import optimum
import pytest

from dp_swing_ros.control import controllers
from dp_swing_ros.evaluation.campaign.contestants import parse, play
from dp_swing_ros.evaluation.metrics import closed_loop_cost
from dp_swing_ros.pendulum.state import is_upright
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate

ca = pytest.importorskip('casadi', reason='casadi is not installed; see make results')


@pytest.fixture(scope='module')
def problem():
    return controllers.problem({})


@pytest.fixture(scope='module')
def library(tmp_path_factory):
    import peers_casadi
    if not peers_casadi.COMPILER:
        pytest.skip('there is no C compiler')
    return peers_casadi.compiled(optimum.solver(optimum.program()),
                                 tmp_path_factory.mktemp('program'))


def test_a_run_of_the_plant_meets_the_constraints_at_its_cost():
    case = optimum.cases()[0]
    duration = optimum.N * controllers.problem({}).dt
    run = simulate(plants.plant(case.plant), parse('ilqr').prepare()(0), duration)
    program = optimum.program()
    cost_and_gaps = ca.Function('run', [program['x'], program['p']], [program['f'], program['g']])
    J, gaps = cost_and_gaps(np.append(run.X, run.U), run.X[0])
    np.testing.assert_allclose(np.array(gaps), 0, atol=1e-9)
    # upright at its end, so that its tail costs nothing
    assert float(J) == pytest.approx(closed_loop_cost(run), rel=1e-3)


@pytest.mark.parametrize('number', [0, 7, 40])
def test_a_guess_begins_with_a_rollout_and_is_upright_from_then_on(problem, number):
    case = optimum.cases()[3]
    X, U = optimum.guess(problem, case, number)
    rise = optimum.RISES[number % len(optimum.RISES)]
    np.testing.assert_array_equal(X[0], case.plant['initial_state'])
    assert np.all(np.abs(U) <= problem.u_max) and np.ptp(U[:rise]) > 0 and not U[rise:].any()
    assert is_upright(X[rise:]).all() and not is_upright(X[:rise]).any()
    other, _ = optimum.guess(problem, case, number + len(optimum.RISES))
    assert np.abs(X - other).max() > 0.1


def test_what_is_found_costs_no_more_than_a_closed_loop(library):
    case = optimum.cases()[0]
    found = optimum.optimum(library, case, 7)
    assert found == optimum.optimum(library, case, 7)
    assert found.cost == pytest.approx(found.program, rel=optimum.SAME)
    assert 1 <= found.same <= found.converged <= 7 and 0 <= found.guess < 7
    assert found.cost < play(parse('ilqr'), case).metrics.closed_loop_cost


def test_what_the_plant_does_not_repeat_counts_for_nothing(problem, library):
    case = optimum.cases()[0]
    X, U = optimum.guess(problem, case, 0)
    as_guessed = optimum.Found(True, 1.0, X, U, 0)
    assert not abs(optimum.played(problem, case, as_guessed) - 1.0) <= optimum.SAME
    nothing = optimum.optimum(library, case, 0)
    assert np.isnan(nothing.cost) and nothing.guess == -1


def test_the_page_counts_what_was_found(tmp_path):
    optima = [optimum.Optimum(1000, 10.0, 10.001, 5, 3, 100, 2),
              optimum.Optimum(1001, 30.0, 30.0, 4, 1, 300, 0),
              optimum.Optimum(1002, np.nan, np.nan, 0, 0, 500, -1)]
    text = optimum.page(optima, 'made')
    assert '2 of 3' in text and 'only one in seeds 1001' in text
    assert '| Σℓ | 20 (10 to 30) | 10 | 30 |' in text
    assert 'differ by 1.0e-04' in text
