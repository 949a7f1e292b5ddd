# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Engines: that of our own against MuJoCo, and both against formulas."""

import math
import sys

from controllers import LIMITS
import numpy as np
import pytest
from similar import sized, SMALLER

from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.parameters import DriveParameters, LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import hanging, LINKS, SIZES
from dp_swing_ros.pendulum.units import SAME, STATES
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.engines import ENGINES, from_joints, to_joints
from dp_swing_ros.simulation.plant import Plant, PlantParameters

UNEVEN = {'cart_mass': 1.3, 'link1_mass': 0.4, 'link1_length': 0.8, 'link1_inertia_factor': 1.25,
          'link1_centre': 0.5, 'link2_inertia': 0.05,
          'cart_friction': 0.3, 'joint1_friction': 0.05, 'joint2_friction': 0.02,
          'joint1_stiffness': 0.4, 'joint1_preload': 0.6, 'joint2_stiffness': 0.2}
WHOLE = {'link2_mass': 0.5, 'link2_length': 1.0}
DRY = {'cart_dry_friction': 1.0, 'joint1_dry_friction': 0.05, 'joint2_dry_friction': 0.02}
# what hangs on the cart weighs next to nothing
MASS = 10.0
BARE = {'cart_mass': MASS, 'link1_mass': 1e-3, 'link2_mass': 1e-3, 'link3_mass': 1e-3}
DRIVE = {'actuation_delay': 0.0235, 'motor_time_constant': 0.03, 'force_gain': 0.8,
         'force_bias': 1.5}

of_links = pytest.mark.parametrize('links', LINKS)
of_engines = pytest.mark.parametrize('engine', sorted(ENGINES))


def plant(engine, links=2, physical=None, drive=None, limits=LIMITS, **parameters):
    parameters = {'initial_state': tuple(hanging(links).tolist()), **parameters}
    return Plant(PendulumParameters(links=links, **(physical or {})), limits,
                 PlantParameters(engine=engine, **parameters), DriveParameters(**(drive or {})))


def swung(engine, links, **parameters):
    """Return the states over half a second of forces, from a start that swings."""
    x = (0.2, 2.0, -1.0, 1.5)[:links + 1] + (0.5, 2.0, -3.0, 1.0)[:links + 1]
    p, X = plant(engine, links, UNEVEN, initial_state=x, **parameters), []
    for n in range(10):
        p.obey(15.0 * math.sin(n))
        p.begin_period(2.0 if n == 4 else 0.0)
        p.advance(0.05)
        X.append(p.x.copy())
    return np.array(X)


@of_links
def test_mujoco_is_our_own_the_more_the_shorter_its_steps(links):
    ours = swung('own', links, physics_step=1e-3)
    far, near = (np.abs(swung('mujoco', links, physics_step=step) - ours).max()
                 for step in (1e-3, 1e-4))
    assert near < 0.05         # in speeds of 10 rad/s
    assert near < far / 7      # its integrator is of the first order


@of_engines
def test_a_smaller_pendulum_moves_as_the_same_in_its_own_units(engine):
    """With all frictions, and against the end of the track."""
    def moved(scale):
        values = sized({**WHOLE, **UNEVEN, **DRY, **DRIVE, 'track_limit': 0.4}, scale)
        factors, X = scale.factors(STATES, 6), []
        p = plants.plant({**values, 'engine': engine, 'initial_state': tuple(
            np.multiply((0.2, 2.0, -1.0, 0.5, 2.0, -3.0), factors).tolist())})
        for n in range(10):
            p.obey(15.0 * math.sin(n) * scale.factor('N'))
            p.begin_period(0.0)
            p.advance(0.05 * scale.time)
            X.append(p.x / factors)
        return np.array(X)
    usual = moved(SAME)
    assert np.abs(usual[:, 0]).max() > 0.39
    np.testing.assert_allclose(moved(SMALLER), usual, rtol=1e-4, atol=1e-4)


@of_links
@of_engines
def test_a_drive_moves_a_cart_as_the_formulas_say(engine, links):
    """The cart alone: M v = g u (T - τ (1 - exp(-T / τ))) + b t, T = t - d."""
    p = plant(engine, links, BARE, DRIVE)
    d, tau, g, b = DRIVE.values()
    p.obey(10.0)
    p.advance(0.02)
    assert p.x[links + 1] == pytest.approx(b * 0.02 / MASS, rel=1e-3)   # only the bias yet
    assert p.force == 0.0
    p.advance(0.18)
    acted = 0.2 - d
    late = tau * (1 - math.exp(-acted / tau))
    v = (g * 10.0 * (acted - late) + b * 0.2) / MASS
    x = (g * 10.0 * (acted ** 2 / 2 - tau * (acted - late)) + b * 0.2 ** 2 / 2) / MASS
    assert p.force == pytest.approx(10.0 * (1 - math.exp(-acted / tau)), rel=1e-9)
    assert p.mean_force == pytest.approx(g * 10.0 * (acted - late) / 0.2, rel=1e-9)
    assert p.x[links + 1] == pytest.approx(v, rel=1e-3)
    assert p.x[0] == pytest.approx(x, rel=0.02 if engine == 'mujoco' else 2e-3)


@of_engines
def test_each_of_a_drive_s_faults_is_its_own(engine):
    def v(**drive):
        p = plant(engine, 1, BARE, drive)
        p.obey(10.0)
        p.advance(0.1)
        return MASS * p.x[2]
    assert v() == pytest.approx(1.0, rel=1e-3)
    assert v(force_gain=0.7) == pytest.approx(0.7, rel=1e-3)
    assert v(force_bias=-3.0) == pytest.approx(0.7, rel=1e-3)
    assert v(actuation_delay=0.04) == pytest.approx(0.6, rel=1e-3)
    assert v(motor_time_constant=0.04) == pytest.approx(
        1.0 - 10 * 0.04 * (1 - math.exp(-0.1 / 0.04)), rel=1e-3)


@of_engines
def test_a_command_saturates_before_the_gain(engine):
    p = plant(engine, 1, BARE, {'force_gain': 1.5})
    p.obey(50.0)
    p.advance(0.05)
    assert p.mean_force == pytest.approx(1.5 * LIMITS.force_limit, rel=1e-12)
    assert MASS * p.x[2] == pytest.approx(1.5 * LIMITS.force_limit * 0.05, rel=1e-3)


@of_engines
def test_a_cart_that_slides_loses_its_dry_friction(engine):
    """M v̇ = -F_c, until it stands."""
    p = plant(engine, 1, {**BARE, 'cart_dry_friction': 15.0},
              initial_state=(0.0, math.pi, 1.0, 0.0))
    p.advance(0.4)
    assert p.x[2] == pytest.approx(1.0 - 15.0 / MASS * 0.4, rel=0.01)
    assert p.x[0] == pytest.approx(0.4 - 15.0 / MASS * 0.4 ** 2 / 2, rel=0.01)
    p.advance(0.6)
    assert p.x[0] == pytest.approx(MASS / 15.0 / 2, rel=0.02)
    assert abs(p.x[2]) < 0.01


@of_links
@pytest.mark.parametrize('speed', [0.04, 0.3, 2.0])
def test_what_slides_is_braked_by_all_of_its_dry_friction_however_slow(links, speed):
    dry = {'cart_dry_friction': 2.0,
           **{f'joint{i}_dry_friction': 0.05 for i in range(1, links + 1)}}
    q = (0.0, 0.5, 1.2, 2.0)[:links + 1]
    v = (speed, -speed, speed, -speed)[:links + 1]
    step, (ours, theirs) = 1e-5, (
        plant(engine, links, dry, initial_state=q + v, physics_step=1e-5) for engine in (
            'own', 'mujoco'))
    for p in (ours, theirs):
        p.obey(5.0)
        p.advance(step)
    accelerations = [(p.x[links + 1:] - v) / step for p in (ours, theirs)]
    np.testing.assert_allclose(*accelerations, rtol=1e-3, atol=1e-3)


@pytest.mark.parametrize('links', [1, 2])
def test_dry_friction_holds_what_stands_under_mujoco(links):
    p = plant('mujoco', links, {'cart_dry_friction': 3.0})
    p.obey(2.7)
    p.advance(1.0)
    assert abs(p.x[0]) < 1e-3
    p.obey(6.0)
    p.advance(0.2)
    assert p.x[0] > 0.01


def test_dry_friction_holds_a_link_that_leans_under_mujoco():
    """Gravity's torque is m g l / 2 sin θ = 0.12 N m, at two joints."""
    start = (0.0, math.pi + 0.1, math.pi + 0.1, 0.0, 0.0, 0.0)
    held = {'joint1_dry_friction': 1.0, 'joint2_dry_friction': 1.0, 'cart_dry_friction': 5.0}
    p = plant('mujoco', 2, held, initial_state=start)
    p.advance(1.0)
    np.testing.assert_allclose(p.x[:3], start[:3], atol=2e-3)
    p = plant('mujoco', 2, initial_state=start)
    p.advance(1.0)
    assert np.abs(p.x[:3] - start[:3]).max() > 0.05


@of_engines
@pytest.mark.parametrize('side', [-1, 1])
def test_the_end_stop_holds_the_cart(engine, side):
    p = plant(engine, 2, initial_state=(side * 2.3, math.pi, math.pi, side * 3.0, 0.0, 0.0))
    p.obey(side * 20.0)
    for _ in range(40):
        p.advance(0.05)
        assert side * p.x[0] < LIMITS.track_limit + 0.03   # MuJoCo's is a spring
    assert side * p.x[0] == pytest.approx(LIMITS.track_limit, abs=0.01)
    p.obey(-side * 20.0)
    p.advance(0.3)
    assert side * p.x[0] < LIMITS.track_limit - 0.1


@of_engines
def test_without_a_limit_there_is_no_end_stop(engine):
    p = plant(engine, limits=LimitParameters(track_limit=math.inf, force_limit=math.inf))
    p.obey(100.0)
    p.advance(2.0)
    assert p.x[0] > 3.0


@of_engines
def test_after_a_reset_all_is_the_same_to_the_bit(engine):
    p = plant(engine, 2, {'cart_dry_friction': 1.0, 'joint1_dry_friction': 0.02}, DRIVE,
              position_noise=1e-3, force_noise=1.0)

    def run():
        X = []
        for n in range(20):
            p.obey(18.0 * math.cos(n))
            p.begin_period(0.0)
            p.advance(0.05)
            X.append(p.measure().x)
        return np.array(X)
    first = run()
    p.reset()
    np.testing.assert_array_equal(run(), first)


@of_links
def test_joints_and_links_are_told_from_each_other(links, rng):
    x = rng.normal(size=SIZES[links] // 2)
    np.testing.assert_allclose(from_joints(to_joints(x)), x, rtol=1e-14)
    relative = to_joints(x)
    assert relative[0] == x[0]
    assert relative[1] == x[1]
    assert all(relative[i] == x[i] - x[i - 1] for i in range(2, links + 1))


def test_an_engine_that_is_not_installed_is_told(monkeypatch):
    monkeypatch.setitem(sys.modules, 'mujoco', None)
    with pytest.raises(ParameterError, match="engine is 'mujoco', which is not installed"):
        plant('mujoco')
    plant('own')


def test_impossible_plants_are_refused():
    with pytest.raises(ParameterError, match="'engine' is"):
        PlantParameters(engine='bullet')
    with pytest.raises(ParameterError, match='both make the force lag'):
        plant('own', actuator_response=0.5, drive={'motor_time_constant': 0.01})
