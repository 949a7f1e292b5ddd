# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rigs whose model is wrong: each is what is said of it, and the table counts what is asked."""

from dataclasses import replace
import math

import numpy as np
import pytest
from rig import CENTRED
import unmodelled
import wrong_models

from dp_swing_ros.evaluation.campaign.rows import Key, read, Row, UNKNOWN
from dp_swing_ros.evaluation.scenarios import sized
from dp_swing_ros.pendulum.equations import mass_matrix, Pendulum, scale_of
from dp_swing_ros.pendulum.state import to_joints, upright
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.engines import ENGINES, Motor

X = np.array([0.203, 1.0, -2.0, 0.5, 2.0, -1.0])
H = 1e-6   # [s] of a step that is nearly none


def plant(engine, size=1.0, **parameters):
    """Return a plant with links so long [m] that an engine moves."""
    pytest.importorskip('mujoco')
    with unmodelled.engines():
        return plants.plant({'engine': engine, **wrong_models.bodies(size), **parameters})


def acceleration(engine, x):
    """Return what an engine makes of a state (2n + 2,) without a force; (n + 1,)."""
    moved = x.copy()
    engine.advance(moved, Motor(1.0, 0.0, 20.0, 1.0, False), 0.0, 0.0, 0.0, H, 1)
    return (moved - x)[3:] / H


def added(name, size, x, **parameters):
    """Return what it and parameters add to the forces of cart and joints; (n + 1,)."""
    one, usual = plant(name, size, **parameters), plant('mujoco', size)
    D = mass_matrix(Pendulum.of(usual.physical), np.sin(x[1:3]), np.cos(x[1:3]))
    force, *torques = np.array(D) @ (acceleration(one.engine, x) - acceleration(usual.engine, x))
    return np.array([force, sum(torques), torques[1]])   # a torque at a joint acts on both links


@pytest.mark.parametrize('size', wrong_models.SIZES)
def test_springs_and_cogging_add_their_forces(size):
    scale = scale_of(wrong_models.pendulum(size))
    stiffness, cable, cogging, pitch = (scale.sized(*each) for each in (
        (0.3, 'N m/rad'), (5.0, 'N/m'), (1.0, 'N'), (0.02, 'm')))
    close = {'rtol': 1e-3, 'atol': 1e-5}
    joint1, joint2 = to_joints(X[:3])[1:]
    nominal = wrong_models.pendulum(size)
    case = sized(wrong_models.episode('springs', size, 'ilqr', 'default', 0)[1], nominal,
                 1 / wrong_models.SIZES[size])
    springs = {name: value for name, value in case.plant.items() if name.startswith('joint')}
    np.testing.assert_allclose(added('mujoco', size, X, **springs), [
        0.0, -stiffness * (joint1 - math.pi), -stiffness * joint2], **close)
    np.testing.assert_allclose(added('cable', size, X), [-cable * X[0], 0.0, 0.0], **close)
    np.testing.assert_allclose(added('cogging', size, X), [
        cogging * math.sin(2 * math.pi * X[0] / pitch), 0.0, 0.0], **close)


@pytest.mark.parametrize('size', wrong_models.SIZES)
def test_links_have_their_mass_beside_or_along(size):
    """And such engines are none of the product."""
    centres = {f'link{i}_centre': 0.65 * size for i in (1, 2)}
    inertias = {f'link{i}_inertia': 0.5 * size ** 2 / 12 for i in (1, 2)}   # as of the rods
    along = plant('along', size)
    even = plant('mujoco', size, **centres, **inertias)
    np.testing.assert_allclose(acceleration(along.engine, X), acceleration(even.engine, X),
                               rtol=1e-6)
    stands, beside = upright(2), scale_of(wrong_models.pendulum(size)).sized(0.03, 'm')
    stands[1:3] = -np.arctan(beside / (np.array([1.5, 0.5]) * size))   # their mass is above joints
    assert np.abs(torques('beside', size, stands)).max() < 1e-6
    assert np.abs(torques('beside', size, upright(2))).min() > 0.01
    assert not ENGINES.keys() & unmodelled.ADDED.keys()


def torques(name, size, x):
    """Return what moves the links from rest, in the torque of all their weight at level."""
    one = plant(name, size)
    pendulum = Pendulum.of(one.physical)
    D = np.array(mass_matrix(pendulum, np.sin(x[1:3]), np.cos(x[1:3])))
    return (D @ acceleration(one.engine, x))[1:] / (pendulum.a[0] * pendulum.g)


def test_a_tilted_rail_leaves_links_upright_and_pulls_the_cart():
    tilted = plant('tilted')
    mass = sum(tilted.physical.masses)
    D = np.array(mass_matrix(Pendulum.of(tilted.physical), np.zeros(2), np.ones(2)))
    force, *of_links = D @ acceleration(tilted.engine, upright(2))
    assert force == pytest.approx(-mass * 9.81 * math.sin(math.radians(1.0)), rel=1e-3)
    assert np.abs(of_links).max() < 0.01 * abs(force)


@pytest.mark.parametrize('size', wrong_models.SIZES)
def test_a_bearing_sticks_at_low_speed(size):
    scale = scale_of(wrong_models.pendulum(size))
    dry = scale.sized(0.05, 'N m')
    engine = plant('sticking', size, joint1_dry_friction=dry).engine
    for speed, times in ((0.0, 2.0), (0.1, 1 + math.exp(-1)), (1.0, 1.0)):
        x = upright(2)
        x[4:] = scale.sized(speed, 'rad/s')
        acceleration(engine, x)
        np.testing.assert_allclose(engine.model.dof_frictionloss, [0.0, times * dry, 0.0])


@pytest.mark.parametrize('size', wrong_models.SIZES)
def test_a_link_is_changed_once_in_the_middle_of_a_run(size):
    scale, rate = scale_of(wrong_models.pendulum(size)), wrong_models.SIZES[size]
    changing = plant('changed', size, rate=rate)
    model, change = changing.engine.model, scale.sized(5.0, 's')
    before = model.body_mass.copy(), model.body_ipos.copy()
    for _ in range(math.ceil(change * rate - 1e-6)):
        assert changing.t < change and np.array_equal(model.body_mass, before[0])
        changing.advance(1 / rate)
    for _ in range(2):
        changing.advance(1 / rate)
    # of a rod with half its mass at its end: 2/3 along it, and about the joint m l^2 (1/3 + 1/2)
    assert model.body_mass[-1] == pytest.approx(1.5 * before[0][-1])
    assert model.body_ipos[-1, 2] == pytest.approx(size * 2 / 3)
    about_joint = model.body_inertia[-1, 0] + model.body_mass[-1] * model.body_ipos[-1, 2] ** 2
    assert about_joint == pytest.approx(0.5 * size ** 2 * (1 / 3 + 1 / 2))
    np.testing.assert_array_equal(model.body_mass[:-1], before[0][:-1])


@pytest.mark.parametrize('size', wrong_models.SIZES)
def test_who_changes_a_link_knocks_the_cart(size):
    nominal, period = wrong_models.pendulum(size), 1 / wrong_models.SIZES[size]
    scale, impulses = scale_of(nominal), []
    for seed in range(wrong_models.SEEDS):
        _, case = wrong_models.episode('knocked', size, 'ilqr', 'default', seed)
        pushes = np.array(sized(case, nominal, period).pushes)
        middle = (period * (np.arange(len(pushes)) + 0.5)) @ pushes / pushes.sum()
        assert middle == pytest.approx(scale.sized(5.05, 's'), rel=1e-3)
        impulses.append(pushes.sum() * period / scale.sized(1.0, 'N s'))
    assert len(set(impulses)) == wrong_models.SEEDS   # as many runs as seeds
    assert min(impulses) < -1.5 and max(impulses) > 1.5
    assert np.all((1.45 < np.abs(impulses)) & (np.abs(impulses) < 2.55))


def test_encoders_are_off_by_two_degrees_each():
    found = {tuple(np.round(np.degrees(to_joints((unmodelled.off_zero(seed)(X) - X)[:3])), 9))
             for seed in range(20)}
    assert found == {(0.0, one, other) for one in (-2.0, 2.0) for other in (-2.0, 2.0)}


def test_an_encoder_stays_behind_in_its_play():
    encoders, half = unmodelled.WithPlay(0), math.radians(0.5)
    for angle, said in ((0.0, 0.0), (0.5, 0.0), (1.0, 0.5), (0.6, 0.5), (-1.0, -0.5)):
        x = X.copy()
        x[1:3] += 2 * half * angle
        np.testing.assert_allclose((encoders(x) - X)[[0, 1, 3, 4, 5]], [
            0.0, 2 * half * said, 0.0, 0.0, 0.0], atol=1e-12)
        assert to_joints(encoders(x)[:3])[2] == pytest.approx(to_joints(x[:3])[2])


@pytest.mark.parametrize('size', wrong_models.SIZES)
def test_what_is_told_is_wrong_by_the_same_factors_at_any_size(size):
    nominal = wrong_models.pendulum(size)
    for seed in range(10):
        contestant, case = wrong_models.episode('bodies', size, 'ilqr', 'default', seed)
        scale = scale_of(nominal)
        factors = [case.mpc[name] / getattr(nominal, name)
                   for name in ('cart_mass', 'link1_mass', 'link2_mass')]
        factors += [case.mpc['force_gain'], case.mpc['cart_dry_friction'] / scale.sized(2.0, 'N'),
                    case.mpc['joint1_dry_friction'] / scale.sized(0.02, 'N m')]
        assert set(np.round(factors, 6)) <= {0.5, 2.0}
        assert 0.8 <= case.mpc['link1_length'] / size <= 1.2
        assert case.told['force_limit'] == 20.0   # and not that of the bodies that are told


def row(name, contestant, seed, **metrics):
    """Return a row of an episode."""
    return Row(Key(contestant, name, 'size', 1.0, seed), 'HELD', '',
               replace(UNKNOWN, **metrics), np.zeros(0))


def test_the_table_counts_what_is_asked():
    well = {'success': True, 'settling_time': 3.0, 'rest_offset': 0.01}
    rows = [row('zeros', 'ilqr, default', 0, **well),
            row('zeros', 'ilqr, default', 1, **{**well, 'rest_offset': 2 * CENTRED}),
            row('zeros', 'ilqr, state_alone', 0, **well),
            row('zeros', 'ilqr, state_alone', 1, settling_time=math.nan),
            row('changed', 'ilqr, default', 0, **{**well, 'settling_time': 7.9}),
            row('changed', 'ilqr, default', 1, **{**well, 'settling_time': 8.1})]
    first, second, third = list(wrong_models.lines(rows))
    assert [cell[:6] for cell in first[4:6]] == ['2 of 2', '1 of 2']
    assert [cell[:6] for cell in second[4:6]] == ['1 of 2', '1 of 2'] and second[7:9] == ('0', '1')
    assert [cell[:6] for cell in third[4:6]] == ['2 of 2', '1 of 2'] and third[7:] == ('',) * 3


def test_single_cells_are_played(capsys):
    pytest.importorskip('mujoco')
    wrong_models.main(['--rigs', 'along', '--size', '1', '--solvers', 'ilqr', '--seeds', '1',
                       '--contestants', 'default'])
    assert '| `along` | 1 | `ilqr` | `default` | 1 of 1' in capsys.readouterr().out


def test_the_page_is_of_its_cells(tmp_path, monkeypatch):
    pytest.importorskip('mujoco')
    cells = [cell for cell in wrong_models.CELLS if cell[:2] == (1.0, 'ilqr')][:2]
    monkeypatch.setattr(wrong_models, 'CELLS', cells)
    wrong_models.main(['--rigs', 'along', '--seeds', '1', '--docs', str(tmp_path)])
    rows = read(tmp_path / 'results' / 'wrong_models.csv.gz')
    assert [row.key.contestant for row in rows] == ['ilqr, default', 'ilqr, no_adaptation']
    text = (tmp_path / 'results' / 'wrong_models.md').read_text()
    assert wrong_models.table(rows) in text
    assert (tmp_path / 'figures' / 'wrong_models.png').exists()


def test_others_than_the_default_are_on_the_page_once():
    assert len(wrong_models.CELLS) == len(set(wrong_models.CELLS)) == 10
    assert {cell[:2] for cell in wrong_models.CELLS if cell[2] != 'default'} == {(1.0, 'ilqr')}


def test_the_picture_is_of_one_solver_at_one_size():
    well = {'success': True, 'settling_time': 3.0}
    rows = [row('zeros', 'ilqr, default', 0, **well), row('zeros', 'ddp, default', 0, **well),
            row('zeros', 'ilqr, state_alone', 0, settling_time=math.nan),
            row('cable', 'ilqr, default', 0, **well)]
    figure = wrong_models.picture(rows)
    held, settled = figure.axes
    assert [label.get_text() for label in held.get_yticklabels()] == ['zeros', 'cable']
    assert [list(line.get_xdata())[1] for line in held.lines] == [1.0, 0.0, 1.0]
    np.testing.assert_array_equal([line.get_xdata()[1] for line in settled.lines],
                                  [3.0, math.nan, 3.0])
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ['default',
                                                                           'state_alone']
