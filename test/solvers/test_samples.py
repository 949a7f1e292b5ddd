# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Many samples at once in single precision, against one at a time in double."""

import numpy as np
import pytest

from dp_swing_ros.control import controllers
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.pendulum.state import hanging, LINKS, SIZES
from dp_swing_ros.problem.cost import trajectory_cost
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.problem.problem import Bounds, plan_of, regulator_rollout, Rollout
from dp_swing_ros.solvers.mppi import MPPI, MPPIParameters, spread, weights
from dp_swing_ros.solvers.noise import fill, LANES, state_from
from dp_swing_ros.solvers.samples import average, draw, Samples, single

N = 20
F = np.float32
WIDE = Bounds(-1e3, 1e3)


def drawn(problem, rng, samples, sigma=3.0, correlation=0.0, gain=0.0,
          bounds=Bounds(-15.0, 12.0)):
    """Draw samples; return trajectory and forces they are drawn about, noise, forces, costs."""
    U = rng.uniform(-10, 10, N)
    x_0 = hanging(problem.physical.links)
    X = rollout(problem.model, x_0, U)
    blocks = -(-samples // LANES)
    V, J = np.full((blocks, N, LANES), np.nan, F), np.full((blocks, LANES), np.nan, F)
    random, again = (state_from(np.random.default_rng(3)) for _ in range(2))
    noise = np.empty_like(V)
    for block in noise:
        fill(again, block.reshape(-1))
    draw(single(problem.model), single(problem.cost), X, U, np.full((N, len(x_0)), gain), random,
         np.full_like(J, sigma), F(correlation), single(bounds), V, J)
    noise, V = (many.transpose(1, 0, 2).reshape(N, -1)[:, :samples] for many in (noise, V))
    return X, U, noise, V, J.reshape(-1)[:samples]


def problem(**values):
    return controllers.problem({'horizon': N, **values})


@pytest.mark.parametrize(('samples', 'values'), [
    (1, {}), (63, {}), (64, {}), (200, {}), (200, {'links': 1}), (200, {'links': 3}),
    (200, {'model': 'euler'}), (200, {'angle_error': 'angle', 'terminal_cost': 'scaled'})])
def test_costs_are_those_of_the_forces(samples, values, rng):
    p = problem(track_limit=0.5, **values)
    X, U, noise, V, J = drawn(p, rng, samples)
    for n in range(samples):
        forces = V[:, n].astype(float)
        expected = trajectory_cost(p.cost, rollout(p.model, X[0], forces), forces)
        assert J[n] == pytest.approx(expected, rel=2e-3)
    np.testing.assert_allclose(V, np.clip(U[:, None] + 3 * noise, -15, 12), atol=1e-4)
    assert samples == 1 or (V.min(), V.max()) == (-15, 12)   # both bounds act


@pytest.mark.parametrize('links', LINKS)
def test_feedback_pulls_the_samples_to_their_policy(links, rng):
    p = problem(links=links)
    X, U, noise, V, _ = drawn(p, rng, 50, sigma=0.1, gain=-2.0, bounds=WIDE)
    for n in range(50):
        states = rollout(p.model, X[0], V[:, n].astype(float))
        expected = U - 2.0 * (states[:-1] - X[:-1]).sum(axis=1) + 0.1 * noise[:, n]
        np.testing.assert_allclose(V[:, n], expected, atol=2e-3)


def test_the_noise_is_as_correlated_as_asked(rng):
    _, U, _, V, _ = drawn(problem(), rng, 20_000, sigma=2.0, correlation=0.8, bounds=WIDE)
    e = V - U[:, None].astype(F)
    for t in (0, 1, N - 1):
        assert e[t].std() == pytest.approx(2.0, rel=0.03)
    assert np.mean(e[5] * e[6]) / 4 == pytest.approx(0.8, abs=0.03)
    assert np.mean(e[5] * e[7]) / 4 == pytest.approx(0.64, abs=0.03)


def mppi(**parameters):
    return MPPI(problem(), MPPIParameters(**parameters))


def test_the_average_is_that_of_numpy(rng):
    V, w = rng.normal(size=(5, N, LANES)).astype(F), rng.uniform(size=(5, LANES)).astype(F)
    np.testing.assert_allclose(average(V, w), np.einsum('btn,bn->t', V, w), atol=1e-3)


def test_weights_are_boltzmann_s():
    J = np.array([3.0, 1.0, 2.0, np.nan, np.inf], F)
    w = weights(J, 0.5)
    expected = np.exp(-np.array([2.0, 0.0, 1.0]) / 0.5)
    np.testing.assert_allclose(w, [*expected / expected.sum(), 0, 0], rtol=1e-5)


def test_a_relative_temperature_counts_from_the_best_to_the_best_tenth(rng):
    J = np.arange(100, dtype=F)
    assert spread(rng.permutation(7 + 3 * J)) == 3 * 10


def test_weights_survive_costs_that_are_all_lost():
    J = np.full(40, np.nan, F)
    w = weights(J, 0.1 * spread(J))
    assert w.sum() == pytest.approx(1.0, rel=1e-5)


@pytest.mark.parametrize('cost', [np.inf, np.nan])
@pytest.mark.parametrize('lost', [89, 95])
def test_samples_that_are_lost_weigh_nothing(lost, cost):
    J = np.arange(100, dtype=F)
    J[:lost] = cost
    w = weights(J, 0.1 * spread(J))
    assert np.all(w[:lost] == 0)
    assert w.sum() == pytest.approx(1.0, rel=1e-5)


@pytest.mark.parametrize('samples', [64, 100, 1000])
def test_threads_draw_each_its_part(samples):
    """Each part is what one thread draws from the state that it was given."""
    sigma = np.geomspace(0.5, 40, samples).astype(F)
    alone, shared, again = (Samples(problem(), sigma, 0.8, threads) for threads in (1, 3, 3))
    best = Rollout(0.0, np.zeros((N + 1, 6)), np.zeros(N), np.zeros((N, 6)))
    for each in (alone, shared):
        each.J[:] = np.nan
        each.draw(best, np.random.default_rng(0))
    np.testing.assert_array_equal(alone.J[shared.parts[0]], shared.J[shared.parts[0]])
    assert np.all(np.isfinite(shared.J))
    assert len(np.unique(shared.J)) >= samples - 1
    np.testing.assert_array_equal(again.draw(best, np.random.default_rng(0)),
                                  shared.J.reshape(-1)[:samples])


def test_proposals_are_the_average_and_the_heaviest(rng):
    samples = Samples(problem(), np.full(70, 5, F), 0.8, 1)
    samples.draw(Rollout(0.0, np.zeros((N + 1, 6)), np.zeros(N), np.zeros((N, 6))), rng)
    V, w = samples.V.transpose(1, 0, 2).reshape(N, -1)[:, :70], rng.uniform(size=70).astype(F)
    np.testing.assert_allclose(samples.proposals(w), [V @ w, V[:, np.argmax(w)]], atol=1e-3)


@pytest.mark.parametrize('device', ['cpu', 'torch'])
@pytest.mark.parametrize('correlation', [0.0, 0.8])
def test_importance_is_the_textbook_s(device, correlation, rng):
    """Uᵀ Σ⁻¹ ε with Σ written out."""
    sigma = 5.0
    solver = mppi(samples=70, smallest_noise=sigma, largest_noise=sigma, feedback=False,
                  noise_correlation=correlation, importance_sampling=True, device=device)
    U = rng.uniform(-10, 10, N)
    X = rollout(solver.problem.model, hanging(), U)
    solver.samples.draw(Rollout(0.0, X, U, np.zeros((N, 6))), rng)
    V = np.array([solver.samples.forces(k) for k in range(70)])
    t = np.arange(N)
    covariance = sigma ** 2 * correlation ** np.abs(t[:, None] - t)
    expected = U @ np.linalg.solve(covariance, (V - U).T)
    expected[0] = 0.0   # a sample without noise
    np.testing.assert_allclose(solver.importance(U), expected, rtol=1e-4, atol=1e-3)


def test_importance_sampling_is_for_samples_about_forces():
    with pytest.raises(ParameterError, match='importance_sampling and mppi.feedback are both'):
        MPPIParameters(importance_sampling=True)


def test_an_update_that_costs_more_is_not_taken():
    loud = {'samples': 64, 'iterations': 1, 'smallest_noise': 20.0, 'largest_noise': 20.0,
            'temperature': 1e9, 'temperature_scale': 'fixed', 'feedback': False, 'elite': False}
    x_0 = np.array([0.0, 0.01, 0.0, 0.0, 0.0, 0.0])
    best = mppi().solve(x_0, None, np.inf)
    kept = mppi(**loud).solve(x_0, best, np.inf)
    assert kept.stats.cost == best.stats.cost
    np.testing.assert_array_equal(kept.U, best.U)


def test_without_an_elite_the_average_alone_is_a_candidate():
    """About a plan that is far off, the cheapest sample is cheaper than the average of all."""
    one = {'samples': 256, 'iterations': 1, 'temperature': 1e9, 'temperature_scale': 'fixed',
           'feedback': False}
    elite, average_alone = (mppi(elite=elite, **one).solve(hanging(), None, np.inf)
                            for elite in (True, False))
    assert elite.stats.cost < average_alone.stats.cost


@pytest.mark.parametrize('links', LINKS)
@pytest.mark.parametrize('values', [{}, {'device': 'torch', 'samples': 64}])
def test_near_the_goal_the_plan_is_the_regulator_s(values, links):
    """Where the problem is linear and unbounded, its optimum is known."""
    p = controllers.problem({'links': links, 'force_limit': np.inf})
    x, plan = np.zeros(SIZES[links]), None
    x[:2] = 1e-3, 1e-4
    for _ in range(3):
        plan = MPPI(p, MPPIParameters(**values)).solve(x, plan, np.inf)
    assert plan.U[0] == pytest.approx(-p.lqr.K @ x, rel=0.02)
    assert plan.stats.cost == pytest.approx(x @ p.lqr.P @ x, rel=0.02)


def test_every_force_within_the_bound_follows_the_state():
    solver = mppi()
    for n in range(10):
        x_0 = hanging() + 0.1 * n
        plan = solver.solve(x_0, None, np.inf)
        follows = np.any(plan.K != 0.0, axis=1)
        np.testing.assert_array_equal(follows, np.abs(plan.U) < solver.problem.u_max)


def test_the_paper_s_mppi_is_a_choice_of_parameters(rng):
    """White noise of one size about forces alone, a fixed temperature."""
    solver = mppi(samples=100, iterations=1, temperature=0.01, temperature_scale='fixed',
                  smallest_noise=5.0, largest_noise=5.0, noise_correlation=0.0,
                  feedback=False)
    plan = solver.solve(hanging(), None, np.inf)
    assert np.abs(plan.U).max() > 0
    np.testing.assert_array_equal(plan.K, 0.0)


@pytest.mark.parametrize('feedback', [True, False])
def test_the_regulator_is_a_candidate_where_samples_follow_policies(feedback):
    """Two quiet samples about full force cannot hold what is nearly upright; it can."""
    solver = mppi(samples=2, iterations=1, smallest_noise=1e-3, largest_noise=1e-3,
                  feedback=feedback)
    x_0, U = np.array([0.0, 0.02, 0.02, 0.0, 0.0, 0.0]), np.full(N, 20.0)
    poor = plan_of(solver.problem, rollout(solver.problem.model, x_0, U), U, Status.COMPLETE)
    plan = solver.solve(x_0, poor, np.inf)
    held = regulator_rollout(solver.problem, x_0)
    if feedback:
        assert plan.stats.cost == held.J
    else:
        assert plan.stats.cost > 10 * held.J
