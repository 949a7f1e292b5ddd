# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The filter: against a plain one, its own statistics, and what it must refuse or survive."""

from dataclasses import replace
import math

from controllers import controller, plant
import numpy as np
import pytest
from scipy.stats import chi2

from dp_swing_ros.control.estimator import (
    ADDED, BIAS, Estimator, EstimatorParameters, Force, SCALED, SIZE)
from dp_swing_ros.evaluation.metrics import measure
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.rk4 import RK4
from dp_swing_ros.pendulum.trajectory import hold
from dp_swing_ros.simulation.closed_loop import simulate

BODIES = PendulumParameters(joint1_friction=0.1)
SWINGING = np.array([0.2, 2.0, -1.0, 0.5, 2.0, -3.0])
HANGING = np.array([0.0, np.pi, np.pi, 0.0, 0.0, 0.0])
KNOWN = {'force_bias': 0.0, 'body_error': 0.0, 'friction_error': 0.0}


def estimator(bodies=BODIES, **parameters):
    return Estimator(RK4, bodies, EstimatorParameters(**parameters))


def other(factor, bodies=BODIES):
    """Return bodies of other masses and lengths, and without friction."""
    return replace(bodies, joint1_friction=0.0,
                   **{name: factor * getattr(bodies, name) for name in SCALED})


def flow(z, u, h=0.01):
    """Return z a step later, written out plainly."""
    values = [getattr(BODIES, name) * math.exp(p) for name, p in zip(SCALED, z[7:])]
    values += [getattr(BODIES, name) + p for name, p in zip(ADDED, z[12:])]
    bodies = replace(BODIES, **dict(zip(SCALED + ADDED, values)))
    return np.concatenate((hold(RK4.of(Pendulum.of(bodies), h), z[:6], u + z[6], h), z[6:]))


def plain_filter(z, P, u, measured, about, h=0.01):
    """Return mean, covariance and innovation after 0.05 s, by the textbook's formulas."""
    for _ in range(5):
        # one-sided, for a friction may be at its least
        F = np.transpose([(flow(z + d, u) - flow(z, u)) / 1e-6 for d in 1e-6 * np.eye(SIZE)])
        G = F[:, BIAS] - np.eye(SIZE)[BIAS]
        z = flow(z, u)
        Q = about.force_noise ** 2 * 0.05 / h * np.outer(G, G)
        Q[3:6, 3:6] += about.acceleration_noise ** 2 * 0.05 * h * np.eye(3)
        P = F @ P @ F.T + Q
    R = np.diag([about.position_noise ** 2] * 3 + [about.velocity_noise ** 2] * 3)
    H = np.eye(6, SIZE)
    S = H @ P @ H.T + R
    K = P @ H.T @ np.linalg.inv(S)
    innovation = measured - z[:6]
    return (z + K @ innovation, (np.eye(SIZE) - K @ H) @ P, innovation,
            math.sqrt(innovation @ np.linalg.inv(S) @ innovation))


def test_it_is_the_textbook_s(rng):
    e = estimator(memory=math.inf)
    e.update(0.0, SWINGING, [])
    z, P, x = e.z, e.P, SWINGING
    for n in range(1, 8):
        u = rng.uniform(-20, 20)
        x = hold(RK4.of(Pendulum.of(other(1.05)), 0.01), x, u, 0.05)
        measured = x + rng.normal(0.0, np.sqrt(e.R))
        z, P, innovation, distance = plain_filter(z, P, u, measured, e.parameters)
        z[13] = max(z[13], -0.1)    # no friction below zero
        z[[12, 14]] = np.maximum(z[[12, 14]], 0.0)
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
        bodies = replace(BODIES, **{name: getattr(BODIES, name) * math.exp(
            rng.normal(0.0, unknown)) for name in SCALED})
        bias, R = rng.normal(0.0, about.force_bias), np.sqrt(e.R)
        x = SWINGING + rng.normal(0.0, 0.1, 6)
        e.update(0.0, x + rng.normal(0.0, R), [])
        for n in range(1, ticks + 1):
            u = rng.uniform(-10, 10)
            for _ in range(5):
                push = rng.normal(0.0, about.force_noise * math.sqrt(5))
                x = hold(RK4.of(Pendulum.of(bodies), 0.01), x, u + bias + push, 0.01)
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


def swung(bodies, rng, velocity_noise=0.3):
    """Return a filter that watched other bodies for 5 s under random forces, and its estimate."""
    e, x, model = estimator(PendulumParameters()), SWINGING, RK4.of(Pendulum.of(bodies), 0.01)
    e.update(0.0, x, [])
    for n in range(1, 101):
        u = rng.uniform(-20, 20)
        x = hold(model, x, u, 0.05)
        seen = x + rng.normal(0.0, [1e-3] * 3 + [velocity_noise] * 3)
        estimate = e.update(0.05 * n, seen, [Force(u, 0.05)])
    return e, estimate


@pytest.mark.parametrize('factor', [0.75, 1.25])
def test_a_swing_tells_all_masses_and_lengths(factor, rng):
    bodies = other(factor, PendulumParameters())
    e, estimate = swung(bodies, rng)
    for name in SCALED:
        assert estimate.bodies[name] == pytest.approx(getattr(bodies, name), rel=0.05)
    assert e.refused == 0
    assert e.moved(PendulumParameters())
    assert not e.moved(replace(PendulumParameters(), **estimate.bodies))


@pytest.mark.parametrize('factor', [0.7, 1.3])
def test_bodies_that_nobody_told_of_swing_up(factor):
    def run(estimator):
        p = plant(bodies=other(factor, PendulumParameters()))
        return measure(simulate(p, controller(estimator=estimator), 10.0)).success
    assert run('ekf')
    assert not run('none')


def test_a_lasting_force_is_told_from_the_bodies():
    e = estimator()
    x = SWINGING
    for n in range(60):
        u = 5.0 * math.sin(n)
        e.update(0.05 * n, x, [Force(5.0 * math.sin(n - 1), 0.05)])
        x = hold(RK4.of(Pendulum.of(BODIES), 0.01), x, u + 1.5, 0.05)
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
    pushed = hold(RK4.of(Pendulum.of(BODIES), 0.01), HANGING, push, 0.05)
    estimate = e.update(0.5, pushed, [Force(0.0, 0.05)])
    assert estimate.refused == 0
    np.testing.assert_allclose(estimate.x[3:], pushed[3:], atol=abs(pushed[4]) / 2)
    # nor do the bodies suffer
    assert max(abs(estimate.bodies[name] / getattr(BODIES, name) - 1) for name in SCALED) < 0.05


def test_it_starts_anew_after_some_refusals():
    elsewhere = np.array([1.0, 0.5, 0.5, 0.0, 0.0, 0.0])
    estimates = drifting(estimator(), [HANGING] * 5 + [elsewhere] * 4)
    np.testing.assert_allclose([e.x for e in estimates[5:7]], [HANGING] * 2, atol=1e-9)
    np.testing.assert_array_equal(estimates[7].x, elsewhere)
    assert [e.refused for e in estimates[4:]] == [0, 1, 2, 3, 3]


def test_it_starts_anew_after_a_long_gap_and_remembers_the_bodies(rng):
    e, last = swung(other(1.2, PendulumParameters()), rng)
    estimate = e.update(e.t + 2.0, SWINGING, [Force(0.0, 2.0)])
    np.testing.assert_array_equal(estimate.x, SWINGING)
    assert estimate.bodies == last.bodies


def test_what_is_known_of_the_bodies_is_forgotten_in_its_memory(rng):
    """The variances go back to those of the beginning by the share of the memory that passed."""
    e, _ = swung(PendulumParameters(), rng)
    known = np.diag(e.P)[BIAS:]
    assert np.all(known[1:1 + len(SCALED)] < 0.5 * e.prior[1:1 + len(SCALED)])
    # hanging still, it learns nothing of them: what is left is what it forgets
    _, P = e.predicted([Force(0.0, 0.3)], 0.0)
    share = 0.3 / e.parameters.memory
    np.testing.assert_allclose(np.diag(P)[BIAS:], known + share * (e.prior - known), rtol=1e-9)


def test_a_short_gap_is_bridged():
    e, model = estimator(), RK4.of(Pendulum.of(BODIES), 0.01)
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
            x = hold(RK4.of(Pendulum.of(other(1.1)), 0.01), x, 20.0 if n == 50 else 0.0, wait)
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
        assert a.bodies == b.bodies and a.refused == b.refused
