# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The example of a solver in C, by acados: what its code computes, and when it is made."""

from dataclasses import replace
import math
import shutil
import sys

import numba
import numpy as np
import pytest

from dp_swing_ros.control import controllers
from dp_swing_ros.dynamics.structured import Structured
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.pendulum.state import hanging, SIZES
from dp_swing_ros.problem.cost import running, terminal, trajectory_cost
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.problem.problem import Bounds, plan_of, regulator_rollout
from dp_swing_ros.solvers import SOLVERS

ca = pytest.importorskip('casadi', reason='casadi is not installed; see examples/acados_rti')
pytest.importorskip('acados', reason='acados is not installed; see examples/acados_rti')
expressions = pytest.importorskip('acados_rti.expressions')
library = pytest.importorskip('acados_rti.library')
AcadosRTI = pytest.importorskip('acados_rti.solver').AcadosRTI


def problem(**values):
    return controllers.problem({'force_limit': 20.0, **values})


def solver(of, **parameters):
    return AcadosRTI(of, AcadosRTI.Parameters(**parameters))


def wild_trajectory(of, rng):
    """Return states that are no rollout, beyond the soft limits, too, and forces."""
    n = len(of.cost.S)
    X = rng.normal(0, 2, (of.horizon + 1, n))
    return X, rng.normal(0, 10, of.horizon)


@pytest.mark.parametrize('values', [
    {}, {'links': 1}, {'links': 3}, {'model': 'euler', 'angle_error': 'angle'},
    {'goal': 'down_up', 'cart_dry_friction': 1.0, 'joint2_dry_friction': 0.1},
    {'cart_speed_limit': 2.0}, {'drive': 'acceleration'},
    {'joint1_stiffness': 0.3, 'joint2_preload': 0.2}], ids=str)
def test_step_and_cost_are_ours(values, rng):
    of = problem(**values)
    model, cost = of.model, of.cost
    e = expressions.Expressions.of(model, cost)
    compute = ca.Function('all', [e.x, e.u, e.p], [e.step, e.running.value, e.terminal.value])
    X, U = wild_trajectory(of, rng)
    for x, u in zip(X, U):
        x_next, of_running, of_terminal = compute(x, u, expressions.numbers_of(model, cost))
        np.testing.assert_allclose(np.ravel(x_next), rollout(model, x, np.array([u]))[1],
                                   rtol=1e-11, atol=1e-11)
        assert float(of_running) == pytest.approx(running(cost, x, u), rel=1e-11)
        assert float(of_terminal) == pytest.approx(terminal(cost, x), rel=1e-11)


def test_learned_dynamics_are_taken_as_they_are(rng):
    of = problem()
    model = of.model._replace(pendulum=Structured.of(of.model.pendulum))
    e = expressions.Expressions.of(model, of.cost)
    step = ca.Function('f', [e.x, e.u, e.p], [e.step])
    X, U = wild_trajectory(of, rng)
    np.testing.assert_allclose(
        np.ravel(step(X[0], U[0], expressions.numbers_of(model, of.cost))),
        rollout(model, X[0], U[:1])[1], rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize('links', SIZES)
def test_acados_counts_a_trajectory_as_we_do(links, rng):
    of = problem(links=links)
    X, U = wild_trajectory(of, rng)
    acados = solver(of).acados
    acados.iterate(X, U)   # which leaves it there
    assert acados.cost() == pytest.approx(trajectory_cost(of.cost, X, U), rel=1e-12)


@pytest.mark.parametrize('force_limit', [20.0, 2.0, math.inf])
def test_iterations_end_where_those_of_ilqr_do(force_limit):
    of, x_0 = problem(force_limit=force_limit), np.array([0.3, 0.03, -0.03, 0.0, 0.0, 0.0])
    _, X, U, K = regulator_rollout(of, x_0)
    start = plan_of(of, X, U, Status.COMPLETE, K)
    expected, plan = (kind(of, kind.Parameters(iterations=500, tolerance=1e-12)).solve(
        x_0, start, math.inf) for kind in (SOLVERS['ilqr'], AcadosRTI))
    assert plan.stats.cost == pytest.approx(expected.stats.cost, rel=1e-6)
    np.testing.assert_allclose(plan.U, expected.U, atol=1e-2)
    assert (np.abs(plan.U).max() == force_limit) == (force_limit == 2.0)


def test_one_code_serves_all_numbers(monkeypatch):
    """Other masses, weights, goals, bounds and horizons compile nothing."""
    solver(problem())
    monkeypatch.setattr(library, 'compiled', lambda *_: pytest.fail('compiled again'))
    for values in ({'link2_mass': 0.6}, {'goal': 'down_up'}, {'horizon': 7}, {'step': 0.03},
                   {'force_limit': 5.0, 'track_limit': 1.0}, {'force_weight': 0.01}):
        of = problem(**values)
        assert solver(of).solve(hanging() + 0.1, None, math.inf).usable
    moved = replace(problem(), bounds=Bounds(1.0, 2.0))
    U = solver(moved).solve(hanging() + 0.1, None, math.inf).U
    assert 1.0 <= U.min() and U.max() <= 2.0


def test_a_solve_leaves_nothing_behind():
    of, x_0 = problem(), hanging() + 0.3
    one = solver(of, iterations=5)
    first = one.solve(x_0, None, math.inf)
    one.solve(np.array([1.0, 0.1, -0.1, 0.0, 3.0, -3.0]), None, math.inf)
    again = one.solve(x_0, None, math.inf)
    np.testing.assert_array_equal(again.U, first.U)
    np.testing.assert_array_equal(again.K, first.K)


def test_a_solver_takes_over_the_memory_of_one_that_is_gone_and_of_no_other():
    x_0, usual, heavy = hanging() + 0.3, problem(), problem(link2_mass=0.8)
    one, other = solver(usual), solver(heavy)
    assert one.acados.memory != other.acados.memory
    plans = [each.solve(x_0, None, math.inf) for each in (one, other, one)]
    np.testing.assert_array_equal(plans[2].U, plans[0].U)
    assert np.any(plans[1].U != plans[0].U)
    memory = one.acados.memory
    del one
    heir = solver(heavy)
    assert heir.acados.memory == memory
    np.testing.assert_array_equal(heir.solve(x_0, None, math.inf).U, plans[1].U)


@pytest.fixture
def new_cache(tmp_path, monkeypatch):
    """Return an empty cache, with nothing loaded, and another folder to work in."""
    here = tmp_path / 'here'
    here.mkdir()
    monkeypatch.chdir(here)
    monkeypatch.setattr(numba.config, 'CACHE_DIR', str(tmp_path / 'cache'))
    monkeypatch.setattr(library, '_loaded', {})
    monkeypatch.setattr(library, 'FLAGS', ('-O0', '-fPIC', '-shared'))   # in a second
    return tmp_path / 'cache' / 'acados_rti'


def test_code_is_made_once_in_the_cache_and_nowhere_else(new_cache, tmp_path, capfd):
    of = problem(links=1)
    assert solver(of).solve(hanging(1), None, math.inf).usable
    made, = new_cache.iterdir()
    written = made.stat().st_mtime_ns
    library._loaded.clear()
    solver(of)
    assert [file.stat().st_mtime_ns for file in new_cache.iterdir()] == [written]
    assert not list((tmp_path / 'here').iterdir())
    assert capfd.readouterr() == ('', '')


def test_what_is_missing_is_named(new_cache, monkeypatch):
    monkeypatch.setattr(shutil, 'which', lambda _: None)
    with pytest.raises(ParameterError, match='there is no C compiler; install one'):
        solver(problem(links=1))
    monkeypatch.setitem(sys.modules, 'acados', None)
    with pytest.raises(ParameterError, match='needs acados, which is not installed'):
        solver(problem(links=1))
