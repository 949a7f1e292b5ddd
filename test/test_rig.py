# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page of the rigs: its aims, from rows that are made up; and one episode of each kind."""

import dataclasses
import math
from pathlib import Path
import re

from campaigns import METHODS
import pandas as pd
from PIL import Image
import published
import pytest
from results import row
import rig
import seeded

from dp_swing_ros import declarations
from dp_swing_ros.control import controllers
from dp_swing_ros.evaluation.campaign.contestants import Contestant, key, play, simulated
from dp_swing_ros.evaluation.metrics import measure
from dp_swing_ros.parameters.files import for_node, sections
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters, VELOCITY
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate

CLEAN, TWICE = 1.9, 3.8   # [s] settling times
CONFIG = Path(__file__).parents[1] / 'config'


@pytest.fixture
def rows():
    """Return two rows of every rig and contestant, all held at once and in the centre."""
    keys = [key(*episode) for episode in rig.episodes()]
    return {one: dataclasses.replace(row(settling_time=CLEAN, rest_offset=0.0), key=one)
            for one in keys if one.seed < 2}


@pytest.fixture
def found():
    """Return what was found of all that is sought: just the truth."""
    sought = dict.fromkeys((one.rig, name) for one in rig.SOUGHT for name in one.names)
    return [rig.Found(*of, seed, name, 0.5, 0.5) for of, name in sought for seed in range(2)]


def change(rows, contestant, scenario, level=None, **metrics):
    """Change the rows of a contestant and a rig."""
    for one in rows:
        if (one.contestant, one.scenario, one.level) == (contestant, scenario, level):
            rows[one] = dataclasses.replace(rows[one], metrics=dataclasses.replace(
                rows[one].metrics, **metrics))


def lines(page, heading, *words):
    """Return the cells of the lines of a section that begin with these words."""
    section = re.split('^## ', page, flags=re.M)[heading]
    return [line.strip('| ').split(' | ') for line in section.splitlines()
            if line.startswith(f'| {" | ".join(words)} |')]


def test_every_aim_is_met_where_all_is_held_at_once_and_found(rows, found):
    page = rig.page(list(rows.values()), found, [], 'Made today.\n')
    assert page.startswith('# Rigs of other make\n\nMade today.\n')
    assert '**missed**' not in page
    assert page.count(': met') == len(METHODS) * (
        sum(aim.held > 0 for aim in rig.AIMS.values()) + 3) + 6   # settling twice, and centred
    assert page.endswith('Everything was held.\n')


def test_an_aim_is_missed_by_the_figure_itself(rows, found):
    change(rows, 'ilqr', 'rig_delay', settling_time=2.4999999999999996)   # 2.5, in periods
    change(rows, 'ddp', 'rig_delay', settling_time=2.45)
    change(rows, 'ilqr', 'rig_all', settling_time=TWICE)
    change(rows, 'ddp', 'rig_all', settling_time=TWICE + 0.05)
    change(rows, 'mppi', 'rig_lag', 0.025, success=False)
    page = rig.page(list(rows.values()), found, [], 'Made today.\n')
    assert [lines(page, 0, '`rig_delay`', f'`{name}`')[0][-1] for name in ('ilqr', 'ddp')] == [
        'below 2.50: **missed**', 'below 2.50: met']
    assert [lines(page, 0, '`rig_all`', f'`{name}`')[0][-1] for name in ('ilqr', 'ddp')] == [
        'at most 3.80: met', 'at most 3.80: **missed**']
    of_lag, = lines(page, 0, '`rig_lag`, 0.025 s', '`mppi`')
    assert of_lag[2:] == ['0 of 2 (0.0-65.8 %)', 'at least 98 %: **missed**', '-', '-']
    assert page.count('**missed**') == 3
    assert '| rig_lag | `mppi` |' in page   # and why


def test_centred_is_what_is_held_with_the_cart_in_place(rows, found):
    change(rows, 'ilqr', 'rig_bias', 5.0, rest_offset=0.021)
    change(rows, 'ddp', 'rig_bias', 5.0, success=False)
    page = rig.page(list(rows.values()), found, [], 'Made today.\n')
    cells = [lines(page, 1, '`rig_bias`, 5 N', f'`{name}`')[0] for name in METHODS]
    assert [each[2].split(' (')[0] for each in cells] == ['0 of 2', '0 of 2', '2 of 2']
    assert ['missed' in each[3] for each in cells] == [True, True, False]
    assert cells[0][4] == '21.0 (21.0-21.0)'


def test_who_is_told_stands_beside_who_is_not_on_the_same_seeds(rows, found):
    change(rows, 'ilqr', 'rig_all', success=False)
    change(rows, 'ddp, told', 'rig_all', settling_time=CLEAN - 0.5)
    page = rig.page(list(rows.values()), found, [], 'Made today.\n')
    cells = {name: lines(page, 2, '`rig_all`', f'`{name}`', 'told')[0] for name in METHODS}
    assert [each[3:5] for each in cells.values()] == [
        ['2 of 2 (34.2-100.0 %)', '0 of 2 (0.0-65.8 %)'], *[['2 of 2 (34.2-100.0 %)'] * 2] * 2]
    assert cells['ilqr'][5:7] == ['2', '0']
    assert cells['ilqr'][-1] == '-'
    assert cells['ddp'][-1].startswith('-0.5 (-0.5 to -0.5)')


def test_errors_of_estimates_are_of_the_sum_and_without_their_sign(rows, found):
    off = {'actuation_delay': 0.02, 'motor_time_constant': -0.02, 'force_gain': -0.15}
    found = [one._replace(found=one.true + off.get(one.parameter, 0.0)) for one in found]
    page = rig.page(list(rows.values()), found, [], 'Made today.\n')
    delay, both = lines(page, 4, '`rig_delay`')
    gain, = lines(page, 4, '`rig_gain`')
    assert delay[1:] == ['`actuation_delay`', '2', '0.02 s (0.02 s to 0.02 s)',
                         'at most 0.005 s: **missed**']
    assert both[3:] == ['0 s (0 s to 0 s)', '-']
    assert gain[3:] == ['30.0 % (30.0 % to 30.0 %)', 'at most 20.0 %: **missed**']


def test_no_two_episodes_share_a_row():
    keys = [key(*episode) for episode in rig.episodes()]
    assert len(set(keys)) == len(keys)


def test_who_is_told_is_told_all_that_an_mpc_can_be_and_only_that():
    case, = rig.Rig('rig_all').cases(range(3, 4))
    told = rig.informed(case)
    assert set(case.plant) - set(told.mpc) == {
        'engine', 'initial_state', 'encoder_counts', 'velocities'}
    assert told.mpc == {**vars(LimitParameters()), **{
        name: value for name, value in case.plant.items() if name in told.mpc}}
    certain = rig.ORACLES['told and certain']
    assert certain['ekf.delay_error'] == certain['ekf.force_bias'] == 0.0


def test_a_plant_that_is_told_is_the_same_plant():
    """What is told of its bodies is not taken for other bodies that it is off by a share of."""
    case, = rig.Rig('rig_all').cases(range(3, 4))
    case = dataclasses.replace(case, duration=0.1)
    anybody = Contestant('anybody', 'ilqr', {}, {})
    untold, told = (simulated(anybody, each) for each in (case, rig.informed(case)))
    assert untold.physical == told.physical != PendulumParameters()
    assert told.physical.link1_length == case.plant['link1_length']


@pytest.mark.parametrize('kind', rig.ORACLES)
@pytest.mark.parametrize('scenario', ['rig_delay', 'rig_all'])
def test_who_is_told_holds_a_rig(scenario, kind):
    case, = rig.Rig(scenario).cases(range(1))
    found = play(Contestant(kind, 'ilqr', {}, rig.ORACLES[kind]), rig.informed(case))
    assert found.outcome == 'HELD', found.detail


def test_an_estimate_stands_beside_the_truth():
    case, = rig.Rig('rig_cart', 4.0).cases(range(1))
    dry, delay = rig.estimated(case, ['cart_dry_friction', 'actuation_delay'])
    assert dry[:5] == ('rig_cart', 4.0, 0, 'cart_dry_friction', 4.0)
    assert 2.0 < dry.found < 6.0
    assert (delay.true, delay.parameter) == (0.0, 'actuation_delay')
    assert 0.0 <= delay.found < 0.05


def test_the_estimator_says_how_sure_it_is_of_what_motion_tells():
    case, = rig.Rig('rig_all').cases(range(1))
    found = {one.parameter: one for one in rig.sure_of(case)}
    moment, plant = found['first moment about joint 2'], case.plant
    assert moment.true == pytest.approx(
        plant['link2_mass'] * plant['link2_length'] / 2 / plant['force_gain'])
    assert abs(moment.found - moment.true) < 2 * moment.half < 0.4 * moment.true
    assert all(0 < one.half < math.inf for one in found.values())


def test_the_page_is_written_with_its_tables_and_its_picture(rows, found, tmp_path, monkeypatch):
    monkeypatch.setattr(seeded, 'played', lambda page, folder: list(rows.values()))
    monkeypatch.setattr(rig, 'estimates', lambda: found)
    sure = [rig.Sure(rig.CLEAN, seed, 'lasting force', 0.0, 0.1 * seed, 0.15) for seed in range(3)]
    monkeypatch.setattr(rig, 'intervals', lambda: sure)
    for folder in ('results', 'figures'):
        (tmp_path / folder).mkdir()
    published.PARTS['rig'].write(tmp_path, tmp_path)
    text = (tmp_path / 'results' / 'rig.md').read_text()
    assert 'Made by `make results PAGES=rig` on ' in text
    assert re.search(r'mujoco [\d.]+\.\n', text)
    assert '| lasting force | 2 of 3 (' in text
    stored = pd.read_csv(tmp_path / 'results' / 'rig_estimates.csv.gz')
    assert len(stored) == len(found)
    assert (stored.true == stored.found).all()
    with Image.open(tmp_path / 'figures' / 'rig.png') as image:
        image.verify()


@pytest.fixture(scope='module')
def voltage():
    """Return what config/voltage.yaml has for plant and mpc."""
    found = sections(CONFIG / 'voltage.yaml')
    return [for_node(found, f'/{node}', declarations.DECLARATIONS[node].fields(2))
            for node in declarations.DECLARATIONS]


def test_the_voltage_drive_of_the_guide_is_that_of_its_motor(voltage):
    """By what a motor does: when it stands, where it turns freely, and what its rotor weighs."""
    R, K, N, r, J = 2.6, 0.00767, 3.71, 0.00635, 3.9e-7
    volts, cart, bearings = 24.0, 0.94, 5.4
    values = voltage[0]
    assert values['force_limit'] == volts
    standing = N * K * (volts / R) / r
    assert values['force_gain'] * volts == pytest.approx(standing, rel=1e-4)
    fastest = volts / K * r / N   # [m/s] where the back EMF is all of the voltage
    assert (values['cart_friction'] - bearings) * fastest == pytest.approx(standing, rel=1e-4)
    speed = 2.0                   # [m/s] at which rotor and cart have this energy
    assert values['cart_mass'] * speed ** 2 == pytest.approx(
        cart * speed ** 2 + J * (N * speed / r) ** 2, rel=1e-4)


@pytest.mark.parametrize('solver', METHODS)
@pytest.mark.parametrize('name, duration', [
    ('voltage', 3.0), ('stepper', 6.0), ('linear_motor', 4.0)])
def test_the_rigs_of_the_guide_are_held(name, duration, solver):
    pytest.importorskip('mujoco')
    found = declarations.read([CONFIG / f'{name}.yaml'])
    plant = plants.plant(found['plant'])
    controller = controllers.controller({**found['mpc'], 'solver': solver})
    episode = simulate(plant, controller, duration)
    assert measure(episode).success
    # what acted is a force [N], or an acceleration; the limit bounds the command
    limit = plant.limits.input_limit(plant.physical.drive) * plant.drive.force_gain
    assert max(abs(episode.U)) <= limit * (1 + 1e-9)
    if plant.physical.drive == VELOCITY:
        assert max(abs(episode.X[:, 3])) <= plant.limits.cart_speed_limit * 1.01


@pytest.mark.parametrize('solver', METHODS)
@pytest.mark.parametrize('rate', [50.0, 200.0])
def test_a_rig_of_laboratory_size_is_held_with_nothing_told_but_what_it_is(solver, rate):
    path = CONFIG / 'lab_rig.yaml'
    of_plant, of_mpc = (declarations.read([path])[node] for node in ('plant', 'mpc'))
    assert not set(of_mpc) & {'step', 'horizon', 'track_margin', 'state_weights'}
    episode = simulate(plants.plant({**of_plant, 'rate': rate}),
                       controllers.controller({**of_mpc, 'solver': solver}), 3.5)
    assert measure(episode).success
