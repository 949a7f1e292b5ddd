# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The filter: against a plain one, its own statistics, and what it must refuse or survive."""

from dataclasses import replace
from functools import lru_cache
import math

from controllers import controller, plant
import numpy as np
import pytest
from scipy.stats import chi2

from dp_swing_ros.control import controllers
from dp_swing_ros.control.commands import SentCommands
from dp_swing_ros.estimators.gaussian import constrain, correct
from dp_swing_ros.estimators.kalman import (
    CREEP, ExtendedKalmanFilter, KalmanParameters, SCALES, SMALL, UNMEASURED)
from dp_swing_ros.evaluation.metrics import measure
from dp_swing_ros.evaluation.scenarios import push_profile
from dp_swing_ros.pendulum.drive import HISTORY
from dp_swing_ros.pendulum.equations import derivative, mass_matrix, Pendulum
from dp_swing_ros.pendulum.integrators import INTEGRATORS, rk4
from dp_swing_ros.pendulum.model import hold, Model
from dp_swing_ros.pendulum.parameters import (
    DIRECT, Drive, DriveParameters, LimitParameters, PendulumParameters)
from dp_swing_ros.pendulum.state import angles, hanging, LINKS, turned
from dp_swing_ros.problem.parameters import PredictionParameters
from dp_swing_ros.problem.problem import Problem
from dp_swing_ros.simulation.closed_loop import simulate
from dp_swing_ros.simulation.plant import Plant, PlantParameters

PHYSICAL = PendulumParameters(joint1_friction=0.1)
HANGING = hanging()
KNOWN = dict.fromkeys((
    'body_error', 'inertia_error', 'gain_error', 'friction_error', 'cart_dry_friction_error',
    'joint_dry_friction_error', 'balance_error', 'delay_error', 'lag_error', 'force_bias'), 0.0)
SLOW = Drive(delay=0.03, time_constant=0.02, gain=1.1, bias=0.5)
STEP = 0.01   # [s] of the filter


def swinging(links):
    return np.array([0.2, 2.0, -1.0, 1.5][:links + 1] + [0.5, 2.0, -3.0, 1.0][:links + 1])


SWINGING = swinging(2)


def scaled(physical):
    """Return the names of the masses and lengths."""
    count = range(1, physical.links + 1)
    return ['cart_mass', *(f'link{i}_{what}' for what in ('mass', 'length') for i in count)]


SCALED = scaled(PHYSICAL)


def estimator(physical=PHYSICAL, drive=DIRECT, **parameters):
    problem = Problem.of(physical, LimitParameters(), controllers.cost({'links': physical.links}),
                         PredictionParameters())
    return ExtendedKalmanFilter(problem, drive, KalmanParameters(**parameters))


def model_of(physical, h=0.01):
    return Model(Pendulum.of(physical), INTEGRATORS['rk4'], h)


def other(factor, physical=PHYSICAL):
    """Return parameters with other masses and lengths, and without friction."""
    return replace(physical, joint1_friction=0.0,
                   **{name: factor * getattr(physical, name) for name in scaled(physical)})


def sent(*commands):
    """Return what remembers commands, each with the time from which it holds [s]."""
    forces = SentCommands()
    for begins, command in commands:
        forces.add(begins, command)
    return forces


NONE = sent()


def with_values(nominal, drive, p):
    """Return the pendulum, the drive and the balance that p stands for, written out plainly."""
    n, rest = nominal.links, iter(p)
    count = range(1, n + 1)
    values = {name: getattr(nominal, name) * math.exp(next(rest)) for name in (
        *scaled(nominal), *(f'link{i}_inertia_factor' for i in count))}
    gain = drive.gain * math.exp(next(rest))
    for name in ('cart_friction', *(f'joint{i}_friction' for i in count), 'cart_dry_friction',
                 *(f'joint{i}_dry_friction' for i in count)):
        values[name] = getattr(nominal, name) + next(rest)
    balance = np.array([next(rest) for _ in count])
    for name in (f'joint{i}_{each}' for each in ('stiffness', 'preload') for i in count):
        values[name] = getattr(nominal, name) + next(rest)
    delay, time_constant, bias = rest
    # finite differences may go below zero, which parameters may not
    found = replace(nominal)
    for name, value in values.items():
        object.__setattr__(found, name, value)
    return found, Drive(drive.delay + delay, drive.time_constant + time_constant, gain,
                        drive.bias + bias), balance


@lru_cache
def frictionless(physical):
    """Return what is left of a pendulum without its friction."""
    joints = (f'joint{i}' for i in range(1, physical.links + 1))
    none = {f'{each}_{kind}': 0.0 for each in ('cart', *joints)
            for kind in ('friction', 'dry_friction')}
    return Pendulum.of(replace(physical, **none))


def accelerations(physical, x, force):
    """Return those of cart and links, with viscous and dry friction added by hand."""
    n, p = physical.links, frictionless(physical)
    v = np.diff(x[n + 2:], prepend=0.0)      # of the joints
    y = np.clip(np.array([x[n + 1], *v]) / CREEP, -1, 1)
    at_joints = (np.array(physical.frictions) * (x[n + 1], *v)
                 + np.array(physical.dry_frictions) * (15 * y - 10 * y ** 3 + 3 * y ** 5) / 8)
    torques = [-at_joints[0], *(after - before for before, after in zip(
        at_joints[1:], (*at_joints[2:], 0.0)))]
    th = x[angles(x)]
    D = np.array(mass_matrix(p, np.sin(th), np.cos(th)))
    return np.array(derivative(p, x, force))[n + 1:] + np.linalg.solve(D, torques)


def moved(physical, drive, x, t, commands, duration):
    """
    Return the state after a time, by plain integration of τ ḟ = u(t - d) - f and F = g f + b.

    Commands are pairs of when [s] and what [N], zero before them.
    """
    half = len(x) // 2
    changes = [begins + drive.delay for begins, _ in commands]
    f, u, now = 0.0, 0.0, -math.inf

    def lagged(elapsed):
        """Return f after a time, and its mean over it."""
        tau = drive.time_constant
        if tau < 1e-9:
            return u, u
        left = math.exp(-elapsed / tau)
        return u + (f - u) * left, u + (f - u) * (1 - left) * tau / elapsed

    for until, command in zip((*changes, math.inf), (*(u for _, u in commands), 0.0)):
        if now < t and until > now:     # what was before counts for the motor alone
            end = min(until, t)
            f = lagged(end - now)[0] if now > -math.inf else u
            now = end
        end = min(until, t + duration)
        if end > now >= t:
            steps = math.ceil((end - now) / STEP - 1e-9)
            for _ in range(steps):
                h = (end - now) / steps
                f, mean = lagged(h)
                x = np.array(rk4(lambda x, u: [*x[half:], *accelerations(
                    physical, np.array(x), u)], x, drive.gain * mean + drive.bias, h))
            now = end
        u = command
    return x


def plain_filter(e, nominal, drive, z, P, t, commands, measured, duration, time_noise):
    """Return mean, covariance and innovation after some time, by the textbook's formulas."""
    about, size = e.parameters, 2 * nominal.links + 2
    half, unit = size // 2, np.eye(len(z))

    def flow(z, duration=duration):
        physical, driven, balance = with_values(nominal, drive, z[size:])
        x = moved(physical, driven, turned(z[:size], -balance), t, commands, duration)
        return np.concatenate((turned(x, balance), z[size:]))
    # one-sided, for a friction may be at its least
    after = flow(z)
    F = np.transpose([(flow(z + d) - after) / SMALL for d in SMALL * unit])
    Q = np.zeros_like(P)    # the force of a period of 50 ms, and white accelerations
    G = F[:size, -1]        # the last unknown is a force
    Q[:size, :size] = about.force_noise ** 2 * 0.05 / duration * np.outer(G, G)
    q, eye = about.acceleration_noise ** 2 * 0.05, np.eye(half)
    Q[:size, :size] += q * np.block([[duration ** 3 / 3 * eye, duration ** 2 / 2 * eye],
                                     [duration ** 2 / 2 * eye, duration * eye]])
    P = F @ P @ F.T + Q
    R = np.diag(np.repeat([about.position_noise ** 2, about.velocity_noise ** 2], half))
    rate = (after - flow(z, duration - SMALL))[:size] / SMALL
    R = R + time_noise ** 2 * np.outer(rate, rate)
    seen = np.flatnonzero(~np.isnan(measured))
    H, R = unit[seen], R[np.ix_(seen, seen)]
    S = H @ P @ H.T + R
    K = P @ H.T @ np.linalg.inv(S)
    innovation = measured - after[:size]
    z, P = after + K @ innovation[seen], (unit - K @ H) @ P
    # nothing that is never negative below zero, and along with it what it is correlated with
    for j in range(size, len(z)):
        bound = max(z[j], e.unknowns.lowest[j - size])
        if bound > z[j]:
            z = z - P[:, j] * (z[j] - bound) / P[j, j]
    z[size:] = np.maximum(z[size:], e.unknowns.lowest)
    return (z, P, innovation,
            math.sqrt(innovation[seen] @ np.linalg.inv(S) @ innovation[seen]))


DRY = {'cart_dry_friction': 1.0, 'joint1_dry_friction': 0.02, 'joint2_dry_friction': 0.01,
       'joint3_dry_friction': 0.01}


@pytest.mark.parametrize('velocities', [True, False], ids=['velocities', 'positions'])
@pytest.mark.parametrize('drive', [DIRECT, SLOW], ids=['direct', 'slow'])
@pytest.mark.parametrize('links', LINKS)
def test_it_is_the_textbook_s(links, drive, velocities, rng):
    nominal = replace(PHYSICAL, links=links, **DRY)
    e = estimator(nominal, drive, memory=math.inf, adaptation=0.0, push_gate=math.inf)
    e.with_springs = drive is SLOW
    x = swinging(links)
    e.update(0.0, x, NONE)
    z, P, forces, commands = e.z, e.P, SentCommands(), []
    real = other(1.05, nominal)
    for n in range(1, 5):
        time_noise = 2e-3 * (n % 2)
        # two commands a period, that end nowhere near a step
        for begins in (0.05 * n - 0.037, 0.05 * n - 0.011):
            commands.append((begins, rng.uniform(-20, 20)))
            forces.add(*commands[-1])
        x = moved(real, drive, x, 0.05 * (n - 1), commands, 0.05)
        measured = x + rng.normal(0.0, np.sqrt(e.R))
        if not velocities:
            measured[links + 1:] = np.nan
        z, P, innovation, distance = plain_filter(
            e, nominal, drive, z, P, 0.05 * (n - 1), commands, measured, 0.05, time_noise)
        estimate = e.update(0.05 * n, measured, forces, time_noise)
        assert estimate.accepted
        np.testing.assert_allclose(estimate.innovation, innovation, atol=1e-6)
        assert estimate.distance == pytest.approx(distance, rel=1e-5)
        np.testing.assert_allclose(e.z, z, atol=1e-6)
        sizes = np.sqrt(np.outer(np.diag(P), np.diag(P))) + (P == 0)
        np.testing.assert_allclose(e.P / sizes, P / sizes, atol=1e-6)


@pytest.mark.parametrize(('unknown', 'time_noise'), [(0.0, 2e-3), (1.0, 0.0)])
def test_the_innovations_are_as_large_as_it_says(unknown, time_noise, rng):
    """Over runs that are as the filter takes them to be, the squared distances are χ²."""
    parameters = {**KNOWN, 'body_error': 0.05 * unknown, 'inertia_error': 0.05 * unknown,
                  'gain_error': 0.05 * unknown, 'friction_error': 0.01 * unknown,
                  'balance_error': 0.02 * unknown, 'delay_error': 0.004 * unknown,
                  'lag_error': 0.003 * unknown, 'force_bias': 0.5 * unknown}
    nominal = PendulumParameters(cart_friction=0.1, joint1_friction=0.1, joint2_friction=0.1)
    total, runs, ticks, h = 0.0, 10, 40, 0.01
    for _ in range(runs):
        e = estimator(nominal, SLOW, adaptation=0.0, memory=math.inf, push_gate=math.inf,
                      **parameters)
        about, R, forces, commands = e.parameters, np.sqrt(e.R), SentCommands(), []
        physical, drive, balance = with_values(
            nominal, SLOW, rng.normal(0.0, np.sqrt(e.prior)))
        x = SWINGING + rng.normal(0.0, 0.1, 6)
        e.update(0.0, turned(x, balance) + rng.normal(0.0, R), forces)
        for n in range(1, ticks + 1):
            commands.append((0.05 * (n - 1), rng.uniform(-10, 10)))
            forces.add(*commands[-1])
            push = rng.normal(0.0, about.force_noise)
            pushed = drive._replace(bias=drive.bias + push)
            for k in range(5):
                x = moved(physical, pushed, x, 0.05 * (n - 1) + k * h, commands[-12:], h)
                kick = rng.normal(0.0, about.acceleration_noise * math.sqrt(0.05 * h), 3)
                x = x + np.concatenate((h / 2 * kick, kick))
            shortly = moved(physical, pushed, x, 0.05 * n, commands[-12:], 1e-4)
            late = (shortly - x) / 1e-4 * rng.normal(0.0, time_noise)
            seen = turned(x, balance) + late + rng.normal(0.0, R)
            total += e.update(0.05 * n, seen, forces, time_noise).distance ** 2
        assert e.refused == 0
    low, high = chi2.ppf((0.0005, 0.9995), 6 * runs * ticks)
    assert low < total < high


def test_velocities_are_far_better_than_measured():
    c, errors = controller(), []
    p = plant(velocity_noise=0.5)
    before = p.x.copy()

    def compare(t, plan):
        errors.append(c.belief.estimate.x - before)
        before[:] = p.x
    simulate(p, c, 6.0, on_tick=compare)
    # the median, for where the cart hits the end of its track the estimate is off for a tick
    error = np.median(np.abs(errors), axis=0)
    assert error[:3].max() < 0.002
    assert error[3:].max() < 0.05


def swung(physical, rng, velocity_noise=0.3, **parameters):
    """Return a filter that watched a pendulum for 5 s of random forces, and its estimate."""
    half, model = physical.links + 1, model_of(physical)
    e, x = estimator(PendulumParameters(links=physical.links), **parameters), swinging(
        physical.links)
    forces = SentCommands()
    e.update(0.0, x, forces)
    for n in range(1, 101):
        u = rng.uniform(-20, 20)
        forces.add(0.05 * (n - 1), u)
        x = hold(model, x, u, 0.05)
        seen = x + rng.normal(0.0, [1e-3] * half + [velocity_noise] * half)
        estimate = e.update(0.05 * n, seen, forces)
    return e, estimate


@pytest.mark.parametrize('links', LINKS)
@pytest.mark.parametrize('factor', [0.75, 1.25])
def test_a_swing_identifies_all_masses_and_lengths(factor, links, rng):
    """The masses as shares of the gain alone: with twice of all the motion is the same."""
    nominal = PendulumParameters(links=links)
    physical, rest = other(factor, nominal), rng.bit_generator.state
    e, estimate = swung(physical, rng)
    for name in scaled(physical):
        share = estimate.drive.gain if name.endswith('mass') else 1.0
        assert estimate.physical[name] / share == pytest.approx(getattr(physical, name), rel=0.05)
    assert e.refused == 0
    assert e.has_moved(nominal)
    assert not e.has_moved(replace(nominal, **estimate.physical))
    # where the gain is known, the masses themselves, as well as it says
    rng.bit_generator.state = rest
    e, estimate = swung(physical, rng, gain_error=0.0)
    deviations = dict(zip(e.unknowns.names, np.sqrt(np.diag(e.P)[e.size:])))
    for name in scaled(physical):
        error = math.log(estimate.physical[name] / getattr(physical, name))
        assert abs(error) < 3 * deviations[name] < 0.3
    assert estimate.drive.gain == 1.0


@pytest.mark.parametrize('factor', [0.7, 1.3])
def test_a_pendulum_that_differs_swings_up(factor):
    def run(estimator):
        p = plant(physical=other(factor, PendulumParameters()))
        return measure(simulate(p, controller(estimator=estimator), 10.0)).success
    assert run('ekf')
    assert not run('none')


def test_a_lasting_force_is_told_from_the_parameters():
    e, forces = estimator(), SentCommands()
    x = SWINGING
    for n in range(60):
        e.update(0.05 * n, x, forces)
        forces.add(0.05 * n, 5.0 * math.sin(n))
        x = hold(model_of(PHYSICAL), x, 5.0 * math.sin(n) + 1.5, 0.05)
    assert e.z[-1] == pytest.approx(1.5, abs=0.15)


def drifting(e, states):
    """Feed a pendulum that hangs at rest; return what the filter says of each state."""
    return [e.update(0.05 * n, x, NONE) for n, x in enumerate(states)]


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
    estimate = e.update(0.5, pushed, NONE)
    assert estimate.refused == 0
    np.testing.assert_allclose(estimate.x[3:], pushed[3:], atol=abs(pushed[4]) / 2)
    # nor do the parameters suffer
    assert max(abs(estimate.physical[name] / getattr(PHYSICAL, name) - 1)
               for name in SCALED) < 0.05


def spring(joint):
    return 0.3 * joint - 0.5


@pytest.mark.parametrize('added, noise, period, explained', [
    (None, 1e-3, 0.05, True), (None, 0.03, 0.05, True),
    (lambda joint: 3.0 * math.sin(3 * joint), 1e-3, 0.05, False), (spring, 1e-3, 0.05, True),
    (spring, 1e-3, 0.01, True)], ids=['exact', 'noisy', 'magnet', 'sprung', 'sprung_and_fast'])
def test_what_no_pendulum_does_is_not_explained(added, noise, period, explained, rng):
    """
    A torque [N m] in joint 2; noise is none, however large: it does not go on.

    Springs are looked for where something is missing, and found where they are what it is, and at
    once, from what was measured before.
    """
    e, x, forces, seen, h = estimator(), SWINGING, SentCommands(), [], 0.005
    e.looks_at = 1.12   # [s] between two that are remembered, where measurements come faster
    first = None   # of the estimates with springs
    p = Pendulum.of(PHYSICAL)

    def moving(x, u):
        D = np.array(mass_matrix(p, np.sin(x[1:3]), np.cos(x[1:3])))
        torque = added(x[2] - x[1]) if added else 0.0
        return np.array(derivative(p, x, u)) + np.append(
            np.zeros(3), np.linalg.solve(D, [0.0, torque, -torque]))
    for n in range(round(6.0 / period)):
        estimate = e.update(period * n, x + rng.normal(0.0, [noise] * 3 + [0.3] * 3), forces)
        seen.append(estimate.explained)
        if e.with_springs and first is None:
            first = estimate
            np.testing.assert_allclose(first.x[:3], x[:3], atol=0.02)   # as it is now
        u = rng.uniform(-10, 10)
        forces.add(period * n, u)
        for _ in range(round(period / h)):
            x = np.array(rk4(lambda x, u: list(moving(np.array(x), u)), x, u, h))
    # of springs all is explained once they are found
    assert all(seen[round(1.5 / period):] if added is spring else seen) is explained
    assert all(seen[:10])   # it takes a while to tell
    assert e.with_springs is (added is spring)
    for each, error in ((first, 0.2), (estimate, 0.05)) if added is spring else ():
        # all forces may be larger, with all masses
        found = [each.physical[name] / each.drive.gain
                 for name in ('joint2_stiffness', 'joint2_preload')]
        np.testing.assert_allclose(found, [0.3, 0.5], atol=error)
    if added is None:
        assert not estimate.physical['joint2_stiffness']


@pytest.mark.parametrize('push_gate, falls', [(3.0, False), (math.inf, True)])
def test_a_push_of_a_held_pendulum_is_no_delay(push_gate, falls):
    """Two of some 13 N; an answer to them that does little looks like one that is late."""
    c, delays = controllers.controller({'ekf.push_gate': push_gate}), []
    episode = simulate(plant(), c, 7.0, pushes=1.5 * push_profile(1, 140),
                       on_tick=lambda t, plan: delays.append(c.belief.estimate.drive.delay))
    upright = np.cos(episode.X[60:, angles(c.belief.estimate.x)])
    assert bool(upright.min() < 0.95) is falls
    assert (max(delays) > 0.01) is falls


def test_it_starts_anew_after_some_refusals():
    elsewhere = np.array([1.0, 0.5, 0.5, 0.0, 0.0, 0.0])
    estimates = drifting(estimator(), [HANGING] * 5 + [elsewhere] * 4)
    np.testing.assert_allclose([e.x for e in estimates[5:7]], [HANGING] * 2, atol=1e-9)
    np.testing.assert_array_equal(estimates[7].x, elsewhere)
    assert [e.refused for e in estimates[4:]] == [0, 1, 2, 3, 3]


def test_refusals_that_are_not_in_a_row_are_no_new_start():
    elsewhere = np.array([1.0, 0.5, 0.5, 0.0, 0.0, 0.0])
    estimates = drifting(estimator(), [HANGING] * 5 + [elsewhere, HANGING] * 4)
    np.testing.assert_allclose([e.x for e in estimates], [HANGING] * 13, atol=1e-9)
    assert estimates[-1].refused == 4


def test_it_starts_anew_after_a_long_gap_and_remembers_the_parameters(rng):
    e, last = swung(other(1.2, PendulumParameters()), rng)
    assert np.all(e.scales != 1.0)
    estimate = e.update(e.t + 2.0, SWINGING, NONE)
    np.testing.assert_array_equal(e.scales, 1.0)
    np.testing.assert_array_equal(estimate.x, SWINGING)
    assert estimate.physical == last.physical
    assert estimate.drive == last.drive


def test_what_is_known_of_the_parameters_is_forgotten_in_its_memory(rng):
    """The variances go back to those of the beginning by the share of the memory that passed."""
    e, _ = swung(PendulumParameters(), rng, gain_error=0.0)
    known = np.diag(e.P)[e.size:]
    bodies = slice(0, len(SCALED))
    assert np.all(known[bodies] < 0.5 * e.prior[bodies])
    P = e.predicted(e.t + 0.3, NONE.since(e.t, HISTORY), 0.0)[1]
    share = 0.3 / e.parameters.memory
    np.testing.assert_allclose(np.diag(P)[e.size:],
                               known + share * np.maximum(e.prior - known, 0.0), rtol=1e-9)


def test_a_short_gap_is_bridged():
    e, model = estimator(), model_of(PHYSICAL)
    forces = sent((0.0, 3.0), (0.15, -3.0))
    e.update(0.0, SWINGING, forces)
    x = hold(model, SWINGING, 3.0, 0.05)
    e.update(0.05, x, forces)
    x = hold(model, hold(model, x, 3.0, 0.1), -3.0, 0.1)
    estimate = e.update(0.25, x, forces)
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
            if n % 7 == 0:
                seen[3:] = np.nan
            e.update(t, seen, NONE)
            np.testing.assert_array_equal(e.P, e.P.T)
            uncertain = np.diag(e.P) > 0
            assert np.linalg.eigvalsh(e.P[np.ix_(uncertain, uncertain)]).min() > 0
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


def random_covariance(rng, size):
    root = rng.normal(size=(size, size))
    return root @ root.T + 0.1 * np.eye(size)


def test_what_is_not_measured_corrects_nothing(rng):
    z, P, R = rng.normal(size=5), random_covariance(rng, 5), np.array([0.1, 0.2, 0.3, 0.4])
    nothing, variance = z.copy(), P.copy()
    none = np.zeros(4)
    assert not correct(np.full(4, np.nan), R, none, 0.0, nothing, variance).any()
    np.testing.assert_array_equal(nothing, z)
    np.testing.assert_array_equal(variance, P)
    measured = np.array([0.5, np.nan, -0.5, np.nan])
    H = np.eye(5)[[0, 2]]
    S = H @ P @ H.T + np.diag(R[[0, 2]])
    K, innovation = P @ H.T @ np.linalg.inv(S), measured[[0, 2]] - z[[0, 2]]
    mean, variance = z.copy(), P.copy()
    distance = np.sum(correct(measured, R, none, 0.0, mean, variance) ** 2)
    assert distance == pytest.approx(innovation @ np.linalg.solve(S, innovation), rel=1e-10)
    np.testing.assert_allclose(mean, z + K @ innovation, rtol=1e-10)
    np.testing.assert_allclose(variance, (np.eye(5) - K @ H) @ P, rtol=1e-9)


def test_a_bound_takes_along_what_is_correlated_with_it(rng):
    """The nearest point on the bound, as P measures what is near."""
    z, P = np.array([1.0, -2.0, 0.5, 3.0]), random_covariance(rng, 4)
    lowest, highest = np.array([-1.0, -1.0]), np.array([1.0, 1.0])
    inside = np.array([1.0, -2.0, 0.5, -0.9])
    same = inside.copy()
    constrain(lowest, highest, same, P)
    np.testing.assert_array_equal(same, inside)
    found = z.copy()
    constrain(lowest, highest, found, P)
    # min (x - z)ᵀ P⁻¹ (x - z) with the last number on its bound
    free, weight = [0, 1, 2], np.linalg.inv(P)
    step = np.linalg.solve(weight[np.ix_(free, free)], -weight[free, 3] * (1.0 - 3.0))
    np.testing.assert_allclose(found, [*(z[:3] + step)[:2], np.clip(z[2] + step[2], -1, 1), 1.0],
                               rtol=1e-9)


def test_a_bound_is_kept_where_all_is_certain():
    z = np.array([1.0, 2.0, -5.0])
    constrain(np.array([-1.0, -1.0]), np.array([1.0, 1.0]), z, np.zeros((3, 3)))
    np.testing.assert_array_equal(z, [1.0, 1.0, -1.0])


def test_without_velocities_it_begins_uncertain_of_them_and_finds_them(rng):
    e, forces, x, model = estimator(), SentCommands(), SWINGING, model_of(PHYSICAL)
    unseen = np.full(3, np.nan)
    estimate = e.update(0.0, np.concatenate((x[:3], unseen)), forces)
    np.testing.assert_array_equal(estimate.x, [*x[:3], 0.0, 0.0, 0.0])
    np.testing.assert_array_equal(np.diag(e.P)[3:6], UNMEASURED ** 2)
    errors = []
    for n in range(1, 31):
        forces.add(0.05 * (n - 1), rng.uniform(-10, 10))
        x = hold(model, x, forces.last(math.inf)[0], 0.05)
        seen = np.concatenate((x[:3] + rng.normal(0.0, 1e-3, 3), unseen))
        estimate = e.update(0.05 * n, seen, forces)
        errors.append(np.abs(estimate.x - x))
    assert e.refused == 0
    assert np.all(np.isfinite(estimate.x))
    np.testing.assert_array_equal(np.isnan(estimate.innovation), [False] * 3 + [True] * 3)
    assert np.max(errors[-10:], axis=0)[3:].max() < 0.15
    assert math.isfinite(estimate.distance)


def driven(drive=None, physical=None, engine='mujoco', duration=2.5, seed=0, **parameters):
    """Return the filter of a swing-up, told nothing, its estimate, and the scales it learned."""
    c, scales = controller(seed=seed), []
    p = Plant(PendulumParameters(**(physical or {})), LimitParameters(),
              PlantParameters(engine=engine, seed=seed, **parameters),
              DriveParameters(**(drive or {})))
    simulate(p, c, duration, on_tick=lambda t, plan: scales.append(c.observer.estimator.scales))
    return c.observer.estimator, c.belief.estimate, np.array(scales)


@pytest.mark.parametrize('position, velocity', [(5e-3, 0.3), (2e-3, 1.0), (5e-3, 1.0)])
def test_noise_is_learned(position, velocity):
    e, _, scales = driven(engine='own', duration=6.0, position_noise=position,
                          velocity_noise=velocity)
    # of the last four seconds, for the newest ten innovations alone say it to some 20 %
    learned = np.sqrt(scales[-80:].mean(axis=0) * e.R[[0, -1]])
    np.testing.assert_allclose(learned, (position, velocity), rtol=0.3)


def test_exact_sensors_are_learned_to_the_floor():
    _, _, scales = driven(engine='own', duration=6.0)
    np.testing.assert_allclose(np.sqrt(scales[-20:]), SCALES[0], rtol=0.3)


def test_an_encoder_that_stands_still_is_not_taken_for_exact():
    counts = 2000
    e, _, scales = driven(engine='own', duration=3.0, encoder_counts=counts, rate=100.0,
                          velocities='none')
    learned = np.sqrt(scales[:, 0] * e.R[1])   # [rad]
    half = np.pi / counts
    np.testing.assert_allclose(e.steps[1:], 2 * half, rtol=1e-6)
    moving = 20   # states until the joints have moved by some counts
    assert np.all(learned[moving:] >= half * (1 - 1e-6))
    assert learned[moving:].min() == pytest.approx(half, rel=1e-3)   # and no more than needed


def test_without_adaptation_noises_are_as_given(rng):
    e, _ = swung(PendulumParameters(), rng, adaptation=0.0)
    np.testing.assert_array_equal(e.scales, 1.0)


def test_a_wild_state_does_not_make_the_noise_large():
    e = estimator()
    drifting(e, [HANGING] * 10)
    before = e.scales.copy()
    e.update(0.5, HANGING + (0, 1e6, 0, 0, 0, 0), NONE)
    assert np.all(e.scales <= 2 * before)
    assert np.all(e.scales <= SCALES[1] ** 2)


def swing_ups(where, name, value):
    """Yield filters of five swing-ups, not told a number, and what they estimate."""
    for seed in range(5):
        e, estimate, _ = driven(**{where: {name: value}}, seed=seed)
        assert e.refused < 3
        yield e, estimate


@pytest.mark.parametrize('name, value, tolerance, where', [
    ('force_gain', 0.8, 0.2 * 0.8, 'drive'), ('force_bias', 4.0, 0.5, 'drive'),
    ('cart_dry_friction', 3.0, 0.2 * 3.0, 'physical')])
def test_a_swing_up_tells_the_drive(name, value, tolerance, where):
    found = [{'force_gain': estimate.drive.gain, 'force_bias': estimate.drive.bias,
              **estimate.physical}[name] for _, estimate in swing_ups(where, name, value)]
    assert np.median(found) == pytest.approx(value, abs=tolerance)


@pytest.mark.parametrize('name', ['actuation_delay', 'motor_time_constant'])
def test_a_swing_up_tells_how_late_forces_come_whatever_delays_them(name):
    """To 2 ms in all; what is delay of it and what lag as well as the filter says it knows."""
    together, off = [], []
    for e, estimate in swing_ups('drive', name, 0.03):
        delay, lag = estimate.drive.delay, estimate.drive.time_constant
        together.append(delay + lag)
        deviation = math.sqrt(e.P.diagonal()[e.size + e.unknowns.names.index(name)])
        off.append(abs((delay if name == 'actuation_delay' else lag) - 0.03) / deviation)
        assert deviation < 0.005
    assert np.median(together) == pytest.approx(0.03, abs=0.002)
    assert max(off) < 2.0
