# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The filter: against a plain one, its own statistics, and what it must refuse or survive."""

from dataclasses import replace
import math

from controllers import controller, plant
import numpy as np
import pytest
from scipy.stats import chi2

from dp_swing_ros.configuration import default_cost
from dp_swing_ros.estimators.estimator import Force
from dp_swing_ros.estimators.kalman import (
    ExtendedKalmanFilter, KalmanParameters, parameter_names)
from dp_swing_ros.evaluation.metrics import measure
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.integrators import INTEGRATORS
from dp_swing_ros.pendulum.model import hold, Model
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import hanging, LINKS
from dp_swing_ros.problem.parameters import PredictionParameters
from dp_swing_ros.problem.problem import Problem
from dp_swing_ros.simulation.closed_loop import simulate

PHYSICAL = PendulumParameters(joint1_friction=0.1)
HANGING = hanging()
KNOWN = {'force_bias': 0.0, 'body_error': 0.0, 'friction_error': 0.0}


def swinging(links):
    return np.array([0.2, 2.0, -1.0, 1.5][:links + 1] + [0.5, 2.0, -3.0, 1.0][:links + 1])


SWINGING = swinging(2)


def scaled(physical):
    """Return the names of the masses and lengths."""
    return parameter_names(physical.links)[:2 * physical.links + 1]


SCALED = scaled(PHYSICAL)
BIAS = len(SWINGING)   # where it is in z


def estimator(physical=PHYSICAL, **parameters):
    problem = Problem.of(physical, LimitParameters(), default_cost(physical.links),
                         PredictionParameters())
    return ExtendedKalmanFilter(problem, KalmanParameters(**parameters))


def model_of(physical, h=0.01):
    return Model(Pendulum.of(physical), INTEGRATORS['rk4'], h)


def other(factor, physical=PHYSICAL):
    """Return parameters with other masses and lengths, and without friction."""
    return replace(physical, joint1_friction=0.0,
                   **{name: factor * getattr(physical, name) for name in scaled(physical)})


def flow(nominal, z, u, h=0.01):
    """Return z a step later, written out plainly."""
    n = nominal.links
    names, size = parameter_names(n), 2 * n + 2
    p = z[size + 1:]
    physical = replace(nominal, **{
        name: getattr(nominal, name) * math.exp(p[i]) if i < 2 * n + 1
        else getattr(nominal, name) + p[i] for i, name in enumerate(names)})
    return np.concatenate((hold(model_of(physical, h), z[:size], u + z[size], h), z[size:]))


def plain_filter(nominal, z, P, u, measured, about, h=0.01):
    """Return mean, covariance and innovation after 0.05 s, by the textbook's formulas."""
    half, n = nominal.links + 1, len(measured)
    unit = np.eye(len(z))
    for _ in range(5):
        # one-sided, for a friction may be at its least
        F = np.transpose([(flow(nominal, z + d, u) - flow(nominal, z, u)) / 1e-6
                          for d in 1e-6 * unit])
        G = F[:, n] - unit[n]
        z = flow(nominal, z, u)
        Q = about.force_noise ** 2 * 0.05 / h * np.outer(G, G)
        Q[half:n, half:n] += about.acceleration_noise ** 2 * 0.05 * h * np.eye(half)
        P = F @ P @ F.T + Q
    R = np.diag(np.repeat([about.position_noise ** 2, about.velocity_noise ** 2], half))
    H = unit[:n]
    S = H @ P @ H.T + R
    K = P @ H.T @ np.linalg.inv(S)
    innovation = measured - z[:n]
    return (z + K @ innovation, (unit - K @ H) @ P, innovation,
            math.sqrt(innovation @ np.linalg.inv(S) @ innovation))


@pytest.mark.parametrize('links', LINKS)
def test_it_is_the_textbook_s(links, rng):
    nominal = replace(PHYSICAL, links=links)
    e, x, frictions = estimator(nominal, memory=math.inf), swinging(links), slice(-links - 1, None)
    e.update(0.0, x, [])
    z, P = e.z, e.P
    for n in range(1, 8):
        u = rng.uniform(-20, 20)
        x = hold(model_of(other(1.05, nominal)), x, u, 0.05)
        measured = x + rng.normal(0.0, np.sqrt(e.R))
        z, P, innovation, distance = plain_filter(nominal, z, P, u, measured,
                                                  e.parameters)
        # no friction below zero
        z[frictions] = np.maximum(z[frictions], -np.array(nominal.frictions))
        estimate = e.update(0.05 * n, measured, [Force(u, 0.02), Force(u, 0.03)])
        np.testing.assert_allclose(estimate.innovation, innovation, atol=1e-4)
        assert estimate.distance == pytest.approx(distance, rel=1e-3)
        np.testing.assert_allclose(e.z, z, atol=1e-4)
        np.testing.assert_allclose(e.P, P, rtol=5e-3, atol=1e-7)


@pytest.mark.parametrize('unknown', [0.0, 0.05])
def test_the_innovations_are_as_large_as_it_says(unknown, rng):
    """Over runs that are as the filter takes them to be, the squared distances are χ²."""
    parameters = {**KNOWN, 'force_bias': 10 * unknown, 'body_error': unknown,
                  'friction_error': 0.0}
    total, ticks = 0.0, 40
    for _ in range(20):
        e = estimator(**parameters)
        about = e.parameters
        physical = replace(PHYSICAL, **{name: getattr(PHYSICAL, name) * math.exp(
            rng.normal(0.0, unknown)) for name in SCALED})
        bias, R = rng.normal(0.0, about.force_bias), np.sqrt(e.R)
        x = SWINGING + rng.normal(0.0, 0.1, 6)
        e.update(0.0, x + rng.normal(0.0, R), [])
        for n in range(1, ticks + 1):
            u = rng.uniform(-10, 10)
            for _ in range(5):
                push = rng.normal(0.0, about.force_noise * math.sqrt(5))
                x = hold(model_of(physical), x, u + bias + push, 0.01)
                x[3:] += rng.normal(0.0, about.acceleration_noise * math.sqrt(0.05 * 0.01), 3)
            total += e.update(0.05 * n, x + rng.normal(0.0, R), [Force(u, 0.05)]).distance ** 2
        assert e.refused == 0
    low, high = chi2.ppf((0.0005, 0.9995), 6 * 20 * ticks)
    assert low < total < high


def test_velocities_are_far_better_than_measured():
    c, errors = controller(), []
    p = plant(velocity_noise=0.5)
    before = p.x.copy()

    def compare(t, plan):
        errors.append(c.estimate.x - before)
        before[:] = p.x
    simulate(p, c, 6.0, on_tick=compare)
    # the median, for where the cart hits the end of its track the estimate is off for a tick
    error = np.median(np.abs(errors), axis=0)
    assert error[:3].max() < 0.002
    assert error[3:].max() < 0.05


def swung(physical, rng, velocity_noise=0.3):
    """Return a filter that watched a pendulum for 5 s of random forces, and its estimate."""
    half, model = physical.links + 1, model_of(physical)
    e, x = estimator(PendulumParameters(links=physical.links)), swinging(physical.links)
    e.update(0.0, x, [])
    for n in range(1, 101):
        u = rng.uniform(-20, 20)
        x = hold(model, x, u, 0.05)
        seen = x + rng.normal(0.0, [1e-3] * half + [velocity_noise] * half)
        estimate = e.update(0.05 * n, seen, [Force(u, 0.05)])
    return e, estimate


@pytest.mark.parametrize('links', LINKS)
@pytest.mark.parametrize('factor', [0.75, 1.25])
def test_a_swing_identifies_all_masses_and_lengths(factor, links, rng):
    nominal = PendulumParameters(links=links)
    physical = other(factor, nominal)
    e, estimate = swung(physical, rng)
    for name in scaled(physical):
        assert estimate.physical[name] == pytest.approx(getattr(physical, name), rel=0.05)
    assert e.refused == 0
    assert e.has_moved(nominal)
    assert not e.has_moved(replace(nominal, **estimate.physical))


@pytest.mark.parametrize('factor', [0.7, 1.3])
def test_a_pendulum_that_differs_swings_up(factor):
    def run(estimator):
        p = plant(physical=other(factor, PendulumParameters()))
        return measure(simulate(p, controller(estimator=estimator), 10.0)).success
    assert run('ekf')
    assert not run('none')


def test_a_lasting_force_is_told_from_the_parameters():
    e = estimator()
    x = SWINGING
    for n in range(60):
        u = 5.0 * math.sin(n)
        e.update(0.05 * n, x, [Force(5.0 * math.sin(n - 1), 0.05)])
        x = hold(model_of(PHYSICAL), x, u + 1.5, 0.05)
    assert e.z[BIAS] == pytest.approx(1.5, abs=0.15)


def drifting(e, states):
    """Feed a pendulum that hangs at rest; return what the filter says of each state."""
    return [e.update(0.05 * n, x, [Force(0.0, 0.05)]) for n, x in enumerate(states)]


@pytest.mark.parametrize('outlier', [
    [0.0, 0.2, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, 20.0], [0.0, 0.0, 1e200, 0, 0, 0]])
def test_an_outlier_is_refused(outlier):
    e = estimator()
    *_, before, estimate, after = drifting(e, [HANGING] * 10 + [HANGING + outlier, HANGING])
    np.testing.assert_allclose(estimate.x, HANGING, atol=1e-9)
    assert (before.refused, estimate.refused, after.refused) == (0, 1, 1)
    assert estimate.distance > e.parameters.gate > after.distance
    np.testing.assert_allclose(estimate.innovation, outlier, atol=1e-9)


@pytest.mark.parametrize('push', [15.0, 60.0])
def test_a_push_is_no_outlier(push):
    e = estimator()
    drifting(e, [HANGING] * 10)
    pushed = hold(model_of(PHYSICAL), HANGING, push, 0.05)
    estimate = e.update(0.5, pushed, [Force(0.0, 0.05)])
    assert estimate.refused == 0
    np.testing.assert_allclose(estimate.x[3:], pushed[3:], atol=abs(pushed[4]) / 2)
    # nor do the parameters suffer
    assert max(abs(estimate.physical[name] / getattr(PHYSICAL, name) - 1)
               for name in SCALED) < 0.05


def test_it_starts_anew_after_some_refusals():
    elsewhere = np.array([1.0, 0.5, 0.5, 0.0, 0.0, 0.0])
    estimates = drifting(estimator(), [HANGING] * 5 + [elsewhere] * 4)
    np.testing.assert_allclose([e.x for e in estimates[5:7]], [HANGING] * 2, atol=1e-9)
    np.testing.assert_array_equal(estimates[7].x, elsewhere)
    assert [e.refused for e in estimates[4:]] == [0, 1, 2, 3, 3]


def test_it_starts_anew_after_a_long_gap_and_remembers_the_parameters(rng):
    e, last = swung(other(1.2, PendulumParameters()), rng)
    estimate = e.update(e.t + 2.0, SWINGING, [Force(0.0, 2.0)])
    np.testing.assert_array_equal(estimate.x, SWINGING)
    assert estimate.physical == last.physical


def test_what_is_known_of_the_parameters_is_forgotten_in_its_memory(rng):
    """The variances go back to those of the beginning by the share of the memory that passed."""
    e, _ = swung(PendulumParameters(), rng)
    known = np.diag(e.P)[BIAS:]
    assert np.all(known[1:1 + len(SCALED)] < 0.5 * e.prior[1:1 + len(SCALED)])
    # hanging still, it learns nothing of them: what is left is what it forgets
    _, P = e.predicted([Force(0.0, 0.3)], 0.0)
    share = 0.3 / e.parameters.memory
    np.testing.assert_allclose(np.diag(P)[BIAS:], known + share * (e.prior - known), rtol=1e-9)


def test_a_short_gap_is_bridged():
    e, model = estimator(), model_of(PHYSICAL)
    e.update(0.0, SWINGING, [])
    x = hold(model, SWINGING, 3.0, 0.05)
    e.update(0.05, x, [Force(3.0, 0.05)])
    x = hold(model, hold(model, x, 3.0, 0.1), -3.0, 0.1)
    estimate = e.update(0.25, x, [Force(3.0, 0.1), Force(-3.0, 0.1)])
    np.testing.assert_allclose(estimate.innovation, 0.0, atol=1e-6)


def test_the_covariance_stays_one():
    """Symmetric and positive, after noise, a push, a refusal and a gap; and rerun, the same."""
    def run():
        rng, e, x, t = np.random.default_rng(3), estimator(), SWINGING, 0.0
        for n in range(300):
            wait = 0.3 if n == 200 else 0.05
            x = hold(model_of(other(1.1)), x, 20.0 if n == 50 else 0.0, wait)
            t += wait
            seen = x + rng.normal(0, [1e-3] * 3 + [0.3] * 3) + (n == 100)
            e.update(t, seen, [Force(0.0, wait)])
            np.testing.assert_array_equal(e.P, e.P.T)
            assert np.linalg.eigvalsh(e.P).min() > 0
        return e
    first, second = run(), run()
    assert first.refused >= 1
    np.testing.assert_array_equal(first.z, second.z)
    np.testing.assert_array_equal(first.P, second.P)


def test_a_reset_forgets():
    e = estimator()
    first = drifting(e, [SWINGING, HANGING, SWINGING, SWINGING])
    e.reset()
    again = drifting(e, [SWINGING, HANGING, SWINGING, SWINGING])
    for a, b in zip(first, again):
        np.testing.assert_array_equal(a.x, b.x)
        assert a.physical == b.physical and a.refused == b.refused
