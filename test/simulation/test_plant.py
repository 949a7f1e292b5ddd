# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The plant, and the closed loop: the swing-up itself."""

import math

from controllers import controller, LIMITS, plant
import numpy as np
import pytest

from dp_swing_ros.control import controllers
from dp_swing_ros.evaluation.metrics import measure
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.equations import energy, mass_matrix, Pendulum
from dp_swing_ros.pendulum.integrators import INTEGRATORS
from dp_swing_ros.pendulum.model import Model, rollout
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import angles, from_joints, hanging, LINKS, SIZES, to_joints
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate
from dp_swing_ros.simulation.engines import stop_at_end
from dp_swing_ros.simulation.plant import PlantParameters
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.streams import Stream, stream

START = (0.0, 1.0, 0.5, 0.0, 0.0, 0.0)
STARTS = {1: (0.0, 1.0, 0.0, 0.0), 2: START, 3: (0.0, 1.0, 0.5, 0.7, 0.0, 0.0, 0.0, 0.0)}

of_links = pytest.mark.parametrize('links', LINKS)


def fine(physical):
    """Return the model that the plant integrates."""
    return Model(Pendulum.of(physical), INTEGRATORS['rk4'], 0.005)


def test_a_pace_in_real_time_is_refused():
    with pytest.raises(ParameterError, match="parameter 'pace' is 1; expected 0 in real time"):
        PlantParameters(pace=1.0)


@of_links
def test_the_plant_integrates_finely_under_a_held_force(links):
    p = plant(physical=PendulumParameters(links=links), initial_state=STARTS[links])
    p.obey(5.0)
    p.advance(0.05)
    expected = rollout(fine(p.physical), np.array(STARTS[links]), np.full(10, 5.0))[-1]
    np.testing.assert_allclose(p.x, expected, rtol=1e-12)
    assert p.t == pytest.approx(0.05)


def test_an_initial_state_of_another_pendulum_is_refused():
    with pytest.raises(ParameterError, match='has 6 numbers; expected 8 for links 3'):
        plant(physical=PendulumParameters(links=3), initial_state=START)


def test_it_starts_in_an_equilibrium_by_its_name_and_goes_back_there():
    p = plant(initial_state=(0.5, 1.0, 1.0, 0.0, 0.0, 0.0), start='down_up')
    for _ in range(2):
        np.testing.assert_array_equal(p.x, (0.5, math.pi, 0.0, 0.0, 0.0, 0.0))
        p.obey(10.0)
        p.advance(0.1)
        p.reset()


def test_a_start_of_another_number_of_links_is_refused():
    with pytest.raises(ParameterError, match="start is 'down_up'; expected one of given, down, up "
                                             'for links 1'):
        plant(physical=PendulumParameters(links=1), initial_state=STARTS[1], start='down_up')


def test_uneven_steps_lead_to_the_same_place():
    even, uneven = plant(initial_state=START), plant(initial_state=START)
    even.advance(0.1)
    for duration in (0.013, 0.0, 0.0501, 0.0369):
        uneven.advance(duration)
    np.testing.assert_allclose(uneven.x, even.x, atol=1e-6)


def test_the_paper_s_euler_plant_is_an_option():
    p = plant(initial_state=START, integrator='euler', physics_step=0.05)
    p.advance(0.05)
    np.testing.assert_allclose(p.x[:3], START[:3])   # velocities were zero
    off = math.pi - 0.5
    p = plant(initial_state=(0.0, off, off, 0.0, 0.0, 0.0), integrator='euler', physics_step=0.05)
    pendulum, before = Pendulum.of(PendulumParameters()), p.x.copy()
    p.advance(5.0)
    assert energy(pendulum, p.x) - energy(pendulum, before) == pytest.approx(16.1, abs=0.1)


@pytest.mark.parametrize(('command', 'applied'), [(50.0, 20.0), (-50.0, -20.0), (7.0, 7.0)])
def test_the_actuator_saturates(command, applied):
    p = plant()
    p.obey(command)
    p.advance(0.05)
    assert p.force == p.mean_force == applied


def test_the_force_of_a_period_is_its_mean():
    p = plant()
    for command, duration in ((10.0, 0.01), (0.0, 0.03), (-10.0, 0.01), (20.0, 0.0)):
        p.obey(command)
        p.advance(duration)
    assert p.mean_force == pytest.approx(0.0)
    p.begin_period(0.0)
    assert p.mean_force == 0.0


def test_the_end_stop_holds_the_cart():
    p = plant(initial_state=(2.3, math.pi, math.pi, 3.0, 0.0, 0.0))
    p.obey(20.0)
    for _ in range(20):
        p.advance(0.05)
        assert p.x[0] <= 2.4
    assert p.x[0] == 2.4
    assert p.x[3] == 0.0


@of_links
def test_the_end_stop_conserves_the_momentum_of_the_links(links, rng):
    """The impulse acts on the cart alone: the links' own generalised momenta do not change."""
    model = fine(PendulumParameters(links=links, cart_mass=1.3, link1_mass=0.4, link1_length=0.8))
    p, x = model.pendulum, rng.normal(size=SIZES[links])
    x[[0, links + 1]] += 3.0, 5.0
    before = x.copy()
    stop_at_end(model, 2.4, x)
    th = x[angles(x)]
    change = mass_matrix(p, np.sin(th), np.cos(th)) @ (x - before)[links + 1:]
    assert (x[0], x[links + 1]) == (2.4, 0.0)
    assert change[0] < 0
    np.testing.assert_allclose(change[1:], 0, atol=1e-12)
    assert energy(p, x) < energy(p, before)


@of_links
def test_the_end_stop_lets_the_cart_go(links):
    x = np.arange(1.0, SIZES[links] + 1)
    x[0], expected = -2.5, x.copy()
    expected[0] = -2.4
    stop_at_end(fine(PendulumParameters(links=links)), 2.4, x)
    np.testing.assert_array_equal(x, expected)


def test_without_a_limit_there_is_no_end_stop():
    p = plant(limits=LimitParameters(track_limit=math.inf, force_limit=math.inf))
    p.obey(100.0)
    p.advance(2.0)
    assert p.x[0] > 2.4


def test_a_push_lasts_one_period_and_is_not_the_actuator_s():
    pushed, still = plant(), plant()
    pushed.begin_period(10.0)
    for p in (pushed, still):
        p.advance(0.05)
    assert pushed.mean_force == 0.0
    assert pushed.x[3] > still.x[3] + 0.1
    pushed.begin_period(0.0)
    assert pushed.push == 0.0


def test_noise_has_the_size_that_was_asked_for():
    p = plant(position_noise=0.01, velocity_noise=0.2, force_noise=1.5)
    errors = np.array([p.measure().x for _ in range(4000)]) - hanging()
    np.testing.assert_allclose(errors[:, :3].std(0), 0.01, rtol=0.05)
    np.testing.assert_allclose(errors[:, 3:].std(0), 0.2, rtol=0.05)
    forces = []
    for _ in range(4000):
        p.begin_period(0.0)
        p.advance(0.005)
        forces.append(p.force)
    assert np.std(forces) == pytest.approx(1.5, rel=0.05)


@pytest.mark.parametrize('delay', [0.1, 0.0475, 0.0023, 0.1475])
def test_a_measurement_is_as_old_as_asked(delay):
    p = plant(initial_state=START, delay=delay)
    for n in range(5):
        p.advance(0.05)
    t, x = p.measure()
    assert t == pytest.approx(0.25 - delay)
    ideal = plant(initial_state=START)
    ideal.advance(t)
    np.testing.assert_allclose(x, ideal.x, atol=1e-6)


@pytest.mark.parametrize('delay', [0.0, 0.03, 0.1, 0.12])
def test_no_measurement_arrives_before_the_delay_has_passed(delay):
    p, stamps = plant(delay=delay), []
    for n in range(6):
        assert p.is_seen() == (0.05 * n >= delay - 1e-9)
        measured = p.measure()
        assert (measured is not None) == p.is_seen()
        if measured is not None:
            stamps.append(p.t - measured.t)
        p.advance(0.05)
    np.testing.assert_allclose(stamps, delay, atol=1e-12)


class Listener:
    """A controller that sends no force and remembers what it is told."""

    def __init__(self):
        self.inner, self.told = controller(), []

    def update(self, t, x, delay):
        self.told.append((t, delay))
        return self.inner.fallback(t + delay)

    def fallback(self, begins):
        return self.inner.fallback(begins)


@pytest.mark.parametrize('delay', [0.0, 0.05, 0.07])
def test_the_delay_that_a_controller_is_told_is_the_parameter(delay):
    listener = Listener()
    simulate(plant(delay=delay), listener, 0.5)
    stamps, delays = zip(*listener.told)
    assert set(delays) == {delay}
    first = math.ceil(delay / 0.05 - 1e-9)
    np.testing.assert_allclose(stamps, 0.05 * np.arange(first, 10) - delay, atol=1e-9)


@pytest.mark.parametrize('rate', [20.0, 30.0, 70.0])
def test_any_delay_can_be_simulated(rate):
    """Whole periods too, where sums of times leave remnants of 1e-17 s."""
    for delay in (*np.arange(0.0, 0.1501, 0.0025).tolist(), *(np.arange(4) / rate).tolist()):
        c = controller(first_starts=1, other_starts=0, of_solver={'iterations': 1})
        episode = simulate(plant(delay=delay, rate=rate), c, 0.4)
        assert np.all(np.isfinite(episode.X)), delay


def test_a_delay_of_a_whole_period_is_made_up_for():
    metrics = measure(simulate(plant(delay=0.05), controller(), 6.0))
    assert metrics.success
    assert metrics.settling_time < 3.0


def test_a_reset_begins_the_same_noise_anew():
    p = plant(velocity_noise=0.1, force_noise=1.0)

    def run():
        p.begin_period(0.0)
        p.advance(0.05)
        return p.measure().x
    first = run()
    p.reset()
    np.testing.assert_array_equal(run(), first)
    assert not np.array_equal(plant(seed=1, velocity_noise=0.1).measure().x[3:], first[3:])


def test_a_plant_without_faults_is_its_equations_and_two_noises():
    p = plant(3, initial_state=(0.2, 1.0, 0.5, 1.0, 0.0, 0.0), force_noise=3.0,
              velocity_noise=0.1, position_noise=0.01)
    noises = stream(3, Stream.FORCE_NOISE).normal(0.0, 3.0, 5)[1:]  # one was for the start
    x = p.x.copy()
    for n, command in enumerate((-30.0, 4.0, 12.0, -1.0)):
        push = 5.0 if n == 2 else 0.0
        p.begin_period(push)
        p.obey(command)
        p.advance(0.03)
        p.obey(2.0 * n)
        p.advance(0.02)
        forces = np.clip(np.repeat((command, 2.0 * n), (6, 4)) + noises[n], -20.0, 20.0)
        x = rollout(fine(p.physical), x, forces + push)[-1]
        assert p.mean_force == pytest.approx(np.mean(forces), rel=1e-12)
    np.testing.assert_allclose(p.x, x, rtol=1e-12)
    noise = stream(3, Stream.SENSOR_NOISE).normal(0.0, np.repeat((0.01, 0.1), 3))
    np.testing.assert_allclose(p.measure().x, x + noise, rtol=1e-12)


@pytest.mark.parametrize('response', [0.1, 0.7, 1.0, 1.6, 2.0])
def test_the_actuator_goes_its_share_of_the_way_each_step(response):
    p = plant(initial_state=START, actuator_response=response)
    x, force = np.array(START), 0.0
    for command, push in ((10.0, 0.0), (-20.0, 3.0), (18.0, 0.0), (50.0, 0.0)):
        p.begin_period(push)
        p.obey(command)
        p.advance(0.05)
        forces = []
        for _ in range(10):
            force += response * (min(command, 20.0) - force)
            force = max(-20.0, min(force, 20.0))
            forces.append(force)
        x = rollout(fine(p.physical), x, np.array(forces) + push)[-1]
        assert p.force == pytest.approx(force, rel=1e-12)
        assert p.mean_force == pytest.approx(np.mean(forces), rel=1e-12)
        np.testing.assert_allclose(p.x, x, rtol=1e-10)


def test_how_time_is_divided_does_not_change_the_actuator_s_lag():
    whole, parts = (plant(actuator_response=0.1) for _ in range(2))
    for p, durations in ((whole, (0.05,)), (parts, (0.0013, 0.0361, 0.0126))):
        p.obey(10.0)
        for duration in durations:
            p.advance(duration)
    assert parts.force == pytest.approx(whole.force, rel=1e-9)
    assert whole.force == pytest.approx(10 * (1 - 0.9 ** 10))


def test_a_late_command_acts_from_its_time_on():
    late, ideal = plant(initial_state=START, command_jitter=0.03), plant(initial_state=START)
    late.obey(8.0)
    wait = late.commands.next_change()
    late.advance(0.05)
    ideal.advance(wait)
    ideal.obey(8.0)
    ideal.advance(0.05 - wait)
    assert 0.001 < wait < 0.03
    np.testing.assert_array_equal(late.x, ideal.x)
    assert late.mean_force == pytest.approx(8.0 * (0.05 - wait) / 0.05)


def test_a_command_may_come_periods_late():
    p, acting = plant(command_jitter=1.0), []
    p.obey(8.0)
    due = p.commands.next_change()
    for _ in range(20):
        p.begin_period(0.0)
        p.advance(0.05)
        acting.append(p.mean_force / 8.0 * 0.05)
    assert due > 0.1
    assert sum(acting) == pytest.approx(1.0 - due)


def test_an_older_command_is_never_obeyed_after_a_newer_one():
    p, obeyed = plant(command_jitter=0.05), []
    for n in range(300):
        p.obey(float(n))
        p.advance(0.01)
        obeyed.append(p.commands.force)
    assert np.all(np.diff(obeyed) >= 0)
    assert 100 < len(np.unique(obeyed)) < 250   # the others were overtaken
    p.advance(0.06)
    assert p.commands.force == 299


def test_a_command_may_expire():
    p = plant()
    p.obey(5.0, lasts=0.02)
    p.advance(0.05)
    assert p.mean_force == pytest.approx(2.0)
    assert p.commands.expired
    p.obey(5.0, lasts=0.1)
    p.begin_period(0.0)
    p.advance(0.05)
    assert p.mean_force == 5.0
    assert not p.commands.expired


@pytest.mark.parametrize('probability', [0.0, 0.2, 1.0])
def test_losses_come_as_often_as_asked(probability):
    p = plant(command_loss=probability, state_loss=probability)
    lost = [(not p.obey(1.0), p.measure() is None) for _ in range(4000)]
    np.testing.assert_allclose(np.mean(lost, axis=0), probability, rtol=0.1)


def test_a_lost_command_changes_nothing():
    p = plant(command_loss=1.0)
    p.obey(5.0)
    p.advance(0.05)
    assert p.force == p.mean_force == 0.0


def test_one_fault_does_not_change_the_numbers_of_another():
    def fates(**faults):
        p, fates = plant(5, velocity_noise=0.1, force_noise=1.0, **faults), []
        for _ in range(200):
            p.begin_period(0.0)
            received = p.obey(1.0)
            begins = p.commands.coming[-1].acts_at if received else None
            fates.append((p.noise, begins, p.measure()))
        return zip(*fates)
    none, loss, jitter, states = ({}, {'command_loss': 0.3}, {'command_jitter': 0.1},
                                  {'state_loss': 0.3})
    noise, begins, measured = fates(**loss, **jitter, **states, actuator_response=0.5)
    noise_alone, _, measured_alone = fates(**none)
    assert noise == noise_alone
    for x, alone in zip(measured, measured_alone):
        np.testing.assert_array_equal(alone.x if x is None else x.x, alone.x)
    lost, lost_states = [b is None for b in begins], [x is None for x in measured]
    assert lost == [b is None for b in list(fates(**loss))[1]]
    assert lost_states == [x is None for x in list(fates(**states))[2]]
    assert lost != lost_states
    assert all(b in (None, alone) for b, alone in zip(begins, list(fates(**jitter))[1]))


def test_pushes_are_those_of_their_periods():
    pushes = np.zeros(10)
    pushes[3] = 10.0
    pushed = simulate(plant(command_loss=1.0), controller(), 0.5, pushes=pushes)
    still = np.tile(hanging(), (4, 1))
    np.testing.assert_allclose(pushed.X[:4], still, atol=1e-12)
    assert pushed.X[4, 3] > 0.1
    p = plant(initial_state=tuple(pushed.X[4]))
    p.advance(0.05)
    np.testing.assert_allclose(pushed.X[5], p.x, rtol=1e-9)
    assert not np.any(pushed.U)


@pytest.mark.parametrize('pushes', [np.zeros(9), np.zeros((10, 1)), np.full(10, np.nan)])
def test_impossible_pushes_are_refused(pushes):
    with pytest.raises(ValueError, match='expected 10 finite forces'):
        simulate(plant(), controller(), 0.5, pushes=pushes)


@pytest.mark.parametrize('name', sorted(SOLVERS))
def test_the_last_plan_stands_in_for_lost_states(name):
    episode = simulate(plant(state_loss=0.1, command_loss=0.1), controller(name), 10.0, name)
    assert 10 < episode.ticks.status.count(Status.LAST_POLICY.name) < 30
    assert len(episode.ticks.status) == 200
    assert measure(episode).success


def test_without_any_state_there_is_no_force():
    episode = simulate(plant(state_loss=1.0), controller(), 1.0)
    assert set(episode.ticks.status) == {Status.ZERO.name}
    np.testing.assert_array_equal(episode.U, 0.0)


@pytest.mark.parametrize(('name', 'value', 'expected'), [
    ('actuator_response', 0.0, 'at least 0.001, at most 2'),
    ('actuator_response', 2.1, 'at least 0.001, at most 2'),
    ('state_loss', 1.1, 'at least 0, at most 1'), ('state_loss', -0.1, 'at least 0, at most 1'),
    ('command_loss', 1.1, 'at least 0, at most 1'), ('command_loss', math.nan, 'a finite number'),
    ('command_jitter', 1.5, 'at least 0 s, at most 1 s'),
    ('command_jitter', -0.1, 'at least 0 s, at most 1 s')])
def test_impossible_faults_are_refused(name, value, expected):
    with pytest.raises(ParameterError, match=f"'{name}' is {value}; expected {expected}"):
        PlantParameters(**{name: value})


@pytest.mark.parametrize('name', sorted(SOLVERS))
@pytest.mark.parametrize('seed', [0, 7])
def test_the_pendulum_swings_up_and_stays(name, seed):
    """A quick version of the campaign of 20 seeds a solver in docs/results/swing_up.md."""
    metrics = measure(simulate(plant(seed), controller(name, seed), 10.0, name))
    assert metrics.success
    assert metrics.largest_force <= LIMITS.force_limit
    assert metrics.largest_position < LIMITS.track_limit


@pytest.mark.parametrize('name', sorted(SOLVERS))
@pytest.mark.parametrize('links', [1, 3])
def test_another_number_of_links_comes_up_too(name, links):
    """One link swings up; three, near the top, come to rest there."""
    values = {'links': links}
    if links == 3:
        values['initial_state'] = (0.1, 0.02, 0.02, 0.02, 0.0, 0.0, 0.0, 0.0)
    of_mpc = {'links': links, 'solver': name}
    metrics = measure(simulate(plants.plant(values), controllers.controller(of_mpc), 5.0))
    assert metrics.success


@pytest.mark.parametrize('name', sorted(SOLVERS))
def test_two_runs_of_a_seed_are_the_same_to_the_bit(name):
    first, second = (simulate(plant(2, velocity_noise=0.02), controller(name, 2), 1.0)
                     for _ in range(2))
    np.testing.assert_array_equal(first.X, second.X)
    np.testing.assert_array_equal(first.U, second.U)


def test_an_episode_holds_what_happened():
    seen = []
    episode = simulate(plant(), controller(), 1.0, 'ilqr', lambda t, plan: seen.append(t))
    assert episode.X.shape == (21, 6)
    assert episode.U.shape == (20,)
    np.testing.assert_allclose(episode.t, np.arange(21) * 0.05)
    np.testing.assert_allclose(seen, episode.t[1:])
    assert set(episode.ticks.status) <= {status.name for status in Status}
    for n in range(20):
        X = rollout(fine(episode.physical), episode.X[n], np.full(10, episode.U[n]))
        np.testing.assert_allclose(X[-1], episode.X[n + 1], atol=1e-9)


def counts_of(x, unit):
    """Return by how many counts positions, each against the one before, are from zero."""
    links = len(x) // 2 - 1
    relative = np.concatenate((x[:2], np.diff(x[1:links + 1])))
    return relative / np.array([unit[0], *[unit[1]] * links])


@of_links
@pytest.mark.parametrize('counts', [64, 2048])
def test_encoders_count(links, counts, rng):
    """A pulley's turn is 0.2 m of the cart's way; each joint turns against the one before."""
    p = plant(physical=PendulumParameters(links=links), initial_state=STARTS[links],
              encoder_counts=counts)
    unit, exact = (0.2 / counts, 2 * math.pi / counts), []
    for n in range(40):
        p.obey(rng.uniform(-10, 10))
        p.advance(0.05)
        seen = counts_of(p.measure().x, unit)
        np.testing.assert_allclose(seen, np.round(seen), atol=1e-6)
        exact.append(np.abs(seen - counts_of(p.x, unit)).max())
    assert 0.4 < max(exact) <= 0.5 + 1e-6


def test_encoders_count_what_is_noisy():
    p = plant(encoder_counts=2048, position_noise=0.01)
    unit = (0.2 / 2048, 2 * math.pi / 2048)
    X = np.array([p.measure().x for _ in range(2000)])
    seen = np.array([counts_of(x, unit) for x in X])
    np.testing.assert_allclose(seen, np.round(seen), atol=1e-6)
    np.testing.assert_allclose(X[:, :3].std(axis=0), 0.01, rtol=0.1)


@of_links
def test_an_encoder_stands_still_within_the_play_and_follows_beyond(links):
    p = plant(physical=PendulumParameters(links=links), initial_state=STARTS[links],
              joint_backlash=0.1)
    x, start = np.array(STARTS[links]), to_joints(np.array(STARTS[links])[:links + 1])
    for turn, seen in ((0.0, 0.0), (0.04, 0.0), (0.07, 0.02), (-0.02, 0.02), (-0.06, -0.01),
                       (0.03, -0.01), (0.05, 0.0)):
        joints = start + turn
        x[:links + 1] = from_joints(joints)
        found = to_joints(p.behind(x)[:links + 1])
        np.testing.assert_allclose(found, [joints[0], *(start + seen)[1:]], atol=1e-12)
    np.testing.assert_array_equal(p.behind(x)[links + 1:], x[links + 1:])


@of_links
def test_what_is_measured_is_within_half_the_play_at_both_of_its_ends(links, rng):
    p, errors = plant(physical=PendulumParameters(links=links), initial_state=STARTS[links],
                      joint_backlash=0.02, encoder_counts=1 << 20), []
    for _ in range(40):
        p.obey(rng.uniform(-10, 10))
        p.advance(0.05)
        errors.append(to_joints(p.measure().x[:links + 1]) - to_joints(p.x[:links + 1]))
    errors = np.array(errors)
    np.testing.assert_allclose(errors[:, 0], 0.0, atol=1e-6)
    np.testing.assert_allclose(errors[:, 1:].max(axis=0), 0.01, rtol=1e-3)
    np.testing.assert_allclose(errors[:, 1:].min(axis=0), -0.01, rtol=1e-3)


def test_a_reset_puts_the_encoders_into_the_middle_of_their_play():
    p = plant(initial_state=START, joint_backlash=0.1)
    p.advance(0.5)
    p.measure()
    p.reset()
    np.testing.assert_allclose(p.measure().x, START, atol=1e-12)


@pytest.mark.parametrize('counts', [0, 4096])
def test_differenced_velocities_are_those_of_measured_positions(counts):
    p = plant(initial_state=START, velocities='differenced', encoder_counts=counts,
              position_noise=1e-3, velocity_noise=5.0)
    before = p.measure().x
    np.testing.assert_array_equal(before[3:], 0.0)
    for n in range(10):
        p.advance(0.05)
        x = p.measure().x
        np.testing.assert_allclose(x[3:], (x[:3] - before[:3]) / 0.05, rtol=1e-9)
        before = x


def test_a_reset_forgets_what_velocities_are_differences_of():
    p = plant(initial_state=START, velocities='differenced')
    p.measure()
    p.advance(0.05)
    assert np.abs(p.measure().x[3:]).max() > 0.1
    p.reset()
    p.advance(0.05)
    np.testing.assert_array_equal(p.measure().x[3:], 0.0)


@pytest.mark.parametrize('velocities, differ', [('exact', False), ('none', True)])
def test_velocities_that_are_not_measured_are_no_numbers(velocities, differ):
    p = plant(initial_state=START, velocities=velocities, velocity_noise=0.1)
    assert np.isnan(p.measure().x[3:]).all() == differ
    assert np.isfinite(p.measure().x[:3]).all()


def test_how_velocities_are_measured_changes_no_other_number():
    exact, none = (plant(4, velocities=kind, position_noise=0.01, velocity_noise=0.1)
                   for kind in ('exact', 'none'))
    for _ in range(5):
        np.testing.assert_array_equal(exact.measure().x[:3], none.measure().x[:3])


def test_other_parameters_count_from_now_on():
    p, other = plant(initial_state=START), plant(physical=PendulumParameters(link1_mass=0.8))
    p.obey(5.0)
    p.advance(0.1)
    x, t = p.x.copy(), p.t
    p.reconfigure(other)
    np.testing.assert_array_equal(p.x, x)
    assert (p.t, p.commands.force) == (t, 5.0)
    p.advance(0.05)
    expected = rollout(fine(other.physical), x, np.full(10, 5.0))[-1]
    np.testing.assert_allclose(p.x, expected, rtol=1e-12)
    p.reset()
    np.testing.assert_array_equal(p.x, hanging())


@pytest.mark.parametrize('seed, same', [(0, True), (1, False)])
def test_noise_goes_on_unless_the_seed_is_another(seed, same):
    p, q = plant(position_noise=0.01), plant(position_noise=0.01)
    p.measure()
    q.measure()
    q.reconfigure(plant(position_noise=0.01, seed=seed))
    assert np.array_equal(p.measure().x, q.measure().x) is same


def test_no_state_is_measured_twice_where_the_delay_grows():
    p, stamps = plant(), []
    for n in range(12):
        if n in (4, 8):
            p.reconfigure(plant(delay=0.1 if n == 4 else 0.0))
        measured = p.measure()
        stamps += [measured.t] if measured else []
        p.advance(0.05)
    # what was measured at 0.2 s comes at 0.3 s; that of 0.35 and 0.4 s is overtaken
    np.testing.assert_allclose(
        stamps, [0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.45, 0.5, 0.55], atol=1e-9)
