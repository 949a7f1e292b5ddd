# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A cart that moves as it is told: its equations, its followers, and what becomes of a run."""

import dataclasses
import math

import numpy as np
import pytest

from dp_swing_ros.control import controllers
from dp_swing_ros.control.commands import SentCommands, SentVelocity
from dp_swing_ros.control.observer import Belief
from dp_swing_ros.control.supervisor import HELD
from dp_swing_ros.evaluation.metrics import measure
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.equations import mass_matrix, own_units, Pendulum
from dp_swing_ros.pendulum.parameters import (
    ACCELERATION, DIRECT, DRIVEN, FORCE, LimitParameters, PendulumParameters, VELOCITY)
from dp_swing_ros.pendulum.state import LINKS, upright
from dp_swing_ros.pendulum.urdf import from_urdf, urdf
from dp_swing_ros.problem.plan import Status
from dp_swing_ros.rerun.answers import answer, Tick
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate
from dp_swing_ros.solvers import SOLVERS

PERIOD = 0.05   # [s]
STEPPER = {'drive': VELOCITY, 'acceleration_limit': 5.0, 'cart_speed_limit': 1.0,
           'motor_time_constant': 0.02}


def bodies(links, **others):
    frictions = {f'joint{i}_friction': 0.02 * i for i in range(1, links + 1)}
    return PendulumParameters(links=links, cart_friction=3.0, cart_dry_friction=1.0, **frictions,
                              **others)


@pytest.mark.parametrize('links', LINKS)
def test_links_move_as_the_acceleration_of_their_joint_has_it(links, rng):
    """Of the equations with a cart that is free, those of the links, with ẍ given."""
    free, driven = (Pendulum.of(bodies(links, drive=drive)) for drive in (FORCE, ACCELERATION))
    for x in rng.normal(size=(10, 2 * links + 2)) * 2:
        u = rng.normal() * 10
        found = driven.accelerations(x, u)
        assert found[0] == pytest.approx(u, abs=2e-3)   # a millionth of what the links do to it
        # the rows of the links: D_l0 ẍ + D_ll θ̈ is the same for any ẍ, of which one is known
        other = np.array(free.accelerations(x, 0.0))
        th = x[1:links + 1]
        D = np.array(mass_matrix(free, np.sin(th), np.cos(th)))[1:]
        expected = np.linalg.solve(D[:, 1:], D @ other - D[:, 0] * found[0])
        np.testing.assert_allclose(found[1:], expected, rtol=1e-6, atol=1e-6)


def test_mass_and_friction_of_a_driven_cart_count_for_nothing():
    values = {'drive': ACCELERATION, 'joint1_friction': 0.01}
    light, heavy = (PendulumParameters(cart_mass=mass, cart_friction=friction, **values)
                    for mass, friction in ((0.2, 0.0), (7.0, 50.0)))
    assert Pendulum.of(light) == Pendulum.of(heavy)
    assert own_units(light) == own_units(heavy)
    # nor does what all links weigh together
    twice = dataclasses.replace(
        light, joint1_friction=0.02, link1_mass=1.0, link2_mass=1.0)
    assert Pendulum.of(twice).a == pytest.approx(Pendulum.of(light).a)
    assert Pendulum.of(twice).friction == pytest.approx(Pendulum.of(light).friction)


def test_a_description_says_which_drive_it_has_and_what_bodies_weigh():
    told = bodies(2, drive=VELOCITY), LimitParameters(
        cart_speed_limit=1.5, acceleration_limit=7.0)
    assert from_urdf(urdf(*told)) == told
    assert 'drive' not in urdf(bodies(2), told[1])


def follower(engine='own', **values):
    plant = plants.plant({'engine': engine, **STEPPER, **values,
                          'initial_state': upright().tolist()})
    plant.obey(0.4)
    return plant


@pytest.mark.parametrize('engine', ['own', 'mujoco'])
def test_a_follower_comes_to_its_speed_as_fast_as_it_may_and_then_late(engine):
    if engine == 'mujoco':
        pytest.importorskip('mujoco')
    plant, speeds = follower(engine, physics_step=0.001), []
    for _ in range(400):
        plant.advance(0.001)
        speeds.append(plant.x[3])
    change = np.diff([0.0, *speeds]) / 0.001
    assert np.abs(change).max() == pytest.approx(5.0, rel=1e-3)
    assert speeds[59] == pytest.approx(0.3, rel=1e-2)    # from 0.1 m/s below on its lag is slower
    left = 0.4 - np.array(speeds)
    assert left[99] / left[79] == pytest.approx(math.exp(-1), rel=2e-2)   # in a time constant
    assert abs(left[-1]) < 1e-4


def test_a_follower_exceeds_its_speed_limit_for_no_command():
    plant = follower()
    plant.obey(3.0)
    plant.advance(1.0)
    assert plant.x[3] == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize('drive', DRIVEN)
def test_without_a_command_a_driver_stops_at_its_deceleration(drive):
    plant = plants.plant({**STEPPER, 'drive': drive, 'motor_time_constant': 0.0,
                          'physics_step': 0.001})
    plant.place(np.array([0.0, np.pi, np.pi, 0.5, 0.0, 0.0]))
    plant.obey(0.5 if drive == VELOCITY else 0.0, lasts=0.1)
    plant.advance(0.1)
    assert plant.x[3] == pytest.approx(0.5, abs=1e-5)
    plant.advance(0.05)
    assert plant.x[3] == pytest.approx(0.25, abs=1e-2)
    plant.advance(0.1)
    assert plant.x[3] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize('drive', DRIVEN)
@pytest.mark.parametrize('links', LINKS)
@pytest.mark.parametrize('solver', sorted(SOLVERS))
def test_it_swings_up_and_stays_on_a_driven_cart(solver, links, drive):
    values = {'links': links, 'drive': drive, 'solver': solver}
    common = {name: values[name] for name in ('links', 'drive')}
    episode = simulate(plants.plant({**common, 'rate': 50.0}), controllers.controller(values),
                       6.0 if links == 3 else 4.0)
    assert measure(episode).success
    limit = 40.0 if links == 3 else 20.0
    assert np.abs(episode.U).max() <= limit + 1e-9


def test_what_is_sent_is_the_integral_of_what_is_planned():
    controller, plant = controllers.controller(STEPPER), plants.plant(STEPPER)
    sent, planned = [], []

    def on_tick(t, plan):
        sent.append(plan.command(math.inf))
        planned.append(plan.U[0])
    simulate(plant, controller, 6.0, on_tick=on_tick)
    assert max(map(abs, sent)) <= 1.0 and max(map(abs, planned)) <= 5.0
    inside = np.abs(sent[1:]) < 1.0
    np.testing.assert_allclose((np.diff(sent) / PERIOD)[inside],
                               np.array(planned[1:])[inside], atol=1e-9)


def test_it_goes_on_from_the_speed_that_the_cart_has():
    controller = controllers.controller(STEPPER)
    moving = np.array([0.0, np.pi, np.pi, 0.5, 0.0, 0.0])
    assert controller.update(0.0, moving).command(math.inf) == pytest.approx(0.5)


def test_enabled_again_it_goes_on_from_the_speed_to_which_the_drive_has_come():
    """The zero of a mpc that was disabled is sent at once; the cart brakes no faster than ever."""
    controller = controllers.controller({**STEPPER, 'motor_time_constant': 0.0})
    speeds = 0.9, 0.9, 0.9, 0.65, 0.4   # [m/s] by 5 m/s^2 down from when it is disabled on
    sent = []
    for n, speed in enumerate(speeds):
        controller.enable(n not in (2, 3))
        x = np.array([0.04 * n, np.pi + 0.01 * n, np.pi, speed, 0.0, 0.0])
        sent.append(controller.update(PERIOD * n, x).command(math.inf))
    assert sent[2:4] == [0.0, 0.0]
    before = sent[1] - 2 * 5.0 * PERIOD
    assert abs(sent[4] - before) <= 5.0 * PERIOD + 1e-9
    assert controller.commands.forces[2:4] == pytest.approx(-5.0)


@pytest.mark.parametrize('sent', [0.3, 0.0])
def test_a_drive_that_hears_no_more_stays_at_its_velocity(sent):
    """As the plant does; it comes there as fast as it may, whatever time it was given for it."""
    controller, plant = controllers.controller(STEPPER), plants.plant(
        {**STEPPER, 'motor_time_constant': 0.0, 'physics_step': 0.001})
    commands, x = SentCommands(), np.array([0.0, np.pi, np.pi, 0.8, 0.0, 0.0])
    belief = Belief(0.0, x, controller.nominal, DIRECT, '', None)
    plant.place(x)
    plant.obey(sent)
    commands.add_velocity(SentVelocity(0.0, 0.8, sent, PERIOD, 5.0))
    for _ in range(6):
        plant.advance(PERIOD)
        found = commands.compensate(belief, plant.t)
        np.testing.assert_allclose(found, plant.x, atol=2e-3)
        assert commands.sent.at(plant.t) == pytest.approx(plant.x[3], abs=1e-3)
    # which is known of what came before the next command, too
    commands.add_velocity(SentVelocity(plant.t, sent, sent + 0.2, PERIOD, 5.0))
    np.testing.assert_allclose(commands.compensate(belief, plant.t), plant.x, atol=2e-3)


def swinging(controller, plant, count):
    """Return the ticks of a controller that sees positions alone: times, states, velocities."""
    ticks = []
    for _ in range(count):
        t, x = plant.measure()
        ticks.append((t, x, controller.update(t, x).command(math.inf)))
        plant.obey(ticks[-1][2])
        plant.advance(PERIOD)
        plant.begin_period(0.0)
    return ticks


def test_after_a_reset_it_goes_on_from_the_velocity_that_was_sent():
    controller, plant = controllers.controller(STEPPER), plants.plant(
        {**STEPPER, 'velocities': 'none'})
    (*_, (_, _, before)) = swinging(controller, plant, 12)
    controller.reset()
    later = swinging(controller, plant, 12)
    assert abs(before) > 0.1 and later[0][2] == before
    # as a bag says that begins there
    again = controllers.controller(STEPPER)
    for n, (t, x, velocity) in enumerate(later):
        tick = Tick(n, 0, t, x, 0.0, 0.0, False, n == 0, True, False, (), '', 0.0, velocity)
        assert answer(again, tick).command(math.inf) == velocity


def test_in_another_run_it_begins_with_the_velocity_of_the_cart():
    controller, plant = controllers.controller(STEPPER), plants.plant(
        {**STEPPER, 'velocities': 'none'})
    assert abs(swinging(controller, plant, 12)[-1][2]) > 0.1
    plant.reset()   # its time goes back
    assert swinging(controller, plant, 1)[0][2] == pytest.approx(0.0, abs=1e-12)
    controller.reset()
    moving = np.array([0.0, np.pi, np.pi, 0.5, 0.0, 0.0])
    assert controller.update(1.0, moving).command(math.inf) == pytest.approx(0.5)


def test_a_last_acceleration_before_silence_brings_the_cart_to_rest_and_the_model_knows():
    values = {**STEPPER, 'drive': ACCELERATION, 'motor_time_constant': 0.0}
    controller, plant = controllers.controller({**values, 'carry_over': 0.0}), plants.plant(values)
    plant.place(np.array([0.0, np.pi, np.pi, 0.6, 0.0, 0.0]))
    plant.obey(controller.update(0.0, plant.measure().x).command(math.inf))
    plant.advance(PERIOD)
    before = plant.x.copy()
    plan = controller.fallback(PERIOD)
    assert plan.stats.status is Status.ZERO and abs(before[3]) > 0.3
    plant.obey(plan.command(math.inf), HELD)
    belief = controller.belief._replace(t=plant.t, x=before)
    for _ in range(3):
        plant.advance(HELD)
        assert plant.x[3] == pytest.approx(0.0, abs=0.02)
        np.testing.assert_allclose(controller.commands.compensate(belief, plant.t), plant.x,
                                   atol=0.02)


@pytest.mark.parametrize('velocities', ['exact', 'none'])
@pytest.mark.parametrize('limit', [5.0, 100.0])
def test_a_cart_may_stand_still_where_the_drive_was_told_to_stop(limit, velocities):
    """However hard the driver brakes; where it was told to go, its encoder is dead."""
    controller, plant = controllers.controller(STEPPER), plants.plant(
        {**STEPPER, 'acceleration_limit': limit, 'motor_time_constant': 0.0,
         'velocities': velocities, 'encoder_counts': 2000})
    while abs(plant.x[3]) < 0.9:
        swinging(controller, plant, 1)
    controller.enable(False)
    rejections = []
    for _ in range(12):
        swinging(controller, plant, 1)
        rejections.append(controller.belief.rejection)
    assert plant.x[3] == pytest.approx(0.0, abs=1e-6) and set(rejections) == {''}
    controller.enable(True)
    for _ in range(8):
        t, x = plant.measure()
        x[0] = 0.1
        plant.obey(controller.update(t, x).command(math.inf))
        plant.advance(PERIOD)
        plant.begin_period(0.0)
        rejections.append(controller.belief.rejection)
    assert any('the cart has stood still' in rejection for rejection in rejections)


@pytest.mark.parametrize('drive', DRIVEN)
def test_disabled_it_brings_the_cart_to_rest(drive):
    values = {**STEPPER, 'drive': drive}
    controller, plant = controllers.controller(values), plants.plant(
        {**values, 'initial_state': [0.0, np.pi, np.pi, 0.8, 0.0, 0.0]})
    controller.enable(False)
    plans = []
    episode = simulate(plant, controller, 1.0, on_tick=lambda t, plan: plans.append(plan))
    assert {plan.stats.status for plan in plans} == {Status.DISABLED}
    assert abs(episode.X[-1, 3]) < 0.01
    assert np.abs(episode.U).max() <= 5.0 + 1e-9


def test_lengths_are_found_on_a_driven_cart_and_mass_of_it_is_not():
    told = {'drive': VELOCITY, 'acceleration_limit': 10.0}
    controller = controllers.controller({**told, 'link1_length': 0.9})
    episode = simulate(plants.plant({**told, 'rate': 50.0}), controller, 6.0)
    assert measure(episode).success
    found = controller.belief.estimate.physical
    assert found['link1_length'] == pytest.approx(1.0, rel=0.02)
    assert found['cart_mass'] == 1.0 and found['cart_friction'] == 0.0
    assert found['link1_mass'] + found['link2_mass'] == pytest.approx(1.0, rel=0.3)


def test_nothing_can_be_done_without_acceleration():
    with pytest.raises(ParameterError, match='acceleration_limit is 0'):
        controllers.controller({'drive': VELOCITY, 'acceleration_limit': 0.0})
    controllers.controller({'drive': VELOCITY, 'force_limit': 0.0})


def test_no_lasting_force_is_told_of_a_cart_that_comes_to_its_velocity():
    with pytest.raises(ParameterError, match="'force_bias' is 1.5 with the drive 'velocity'; "
                       'expected 0'):
        controllers.controller({**STEPPER, 'force_bias': 1.5})
    controllers.controller({'drive': ACCELERATION, 'force_bias': 1.5})
    controllers.controller({**STEPPER, 'force_bias': 0.0})


def test_a_gain_that_is_told_is_the_share_that_the_cart_makes_of_a_velocity():
    values = {**STEPPER, 'force_gain': 0.8}
    plant = plants.plant({**values, 'velocities': 'exact'})
    plant.place(np.array([0.0, np.pi, np.pi, 0.5, 0.0, 0.0]))
    controller = controllers.controller(values)
    sent = controller.update(0.0, plant.measure().x).command(math.inf)
    assert sent == pytest.approx(0.5 / 0.8)
    plant.obey(sent)
    plant.advance(0.5)
    assert plant.x[3] == pytest.approx(0.5, abs=1e-3)


def test_a_drive_that_there_is_none_of_is_refused():
    with pytest.raises(ParameterError, match='force, voltage, acceleration'):
        controllers.controller({'drive': 'stepper'})
