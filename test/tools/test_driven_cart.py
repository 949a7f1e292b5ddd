# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The tools over the bag of a cart that is sent velocities, and measures positions alone."""

import json

from one_process import record
import pandas as pd
import pytest

from dp_swing_ros import declarations
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.rerun.verification import verify
from dp_swing_ros.tools import analyse, compare, export, identify, train

BOTH = {'links': 1, 'drive': 'velocity', 'acceleration_limit': 10.0, 'motor_time_constant': 0.02}


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    return record(tmp_path_factory.mktemp('driven') / 'bags', '--lockstep', '--duration', '4',
                  plant=json.dumps({**BOTH, 'velocities': 'none', 'rate': 50.0}),
                  mpc=json.dumps(BOTH))


def test_it_is_verified_to_the_bit(bag):
    assert not verify(Bag(bag), iter).differences


def test_a_solver_takes_over_from_the_speeds_that_were_estimated(bag, tmp_path, capsys):
    assert compare.main([str(bag), '--at', '0.5', '--solvers', 'ilqr', '--output',
                         str(tmp_path)]) == 0
    recorded, again = (line.split('|')[2:] for line in capsys.readouterr().out.splitlines()
                       if 'ilqr' in line)
    assert float(recorded[0]) == pytest.approx(float(again[0]), rel=0.1)
    assert 'yes' in recorded[2] and 'yes' in again[2]


def test_figures_pictures_and_player_are_of_accelerations(bag, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(analyse, 'PICTURES', {'hero': analyse.PICTURES['hero']})
    assert analyse.main([str(bag), '--no-animation', '--output', str(tmp_path)]) == 0
    units = {line.split('|')[1].strip(): line.split('|')[2].strip()
             for line in capsys.readouterr().out.splitlines() if line.startswith('|')}
    assert units['largest acceleration u'] == 'm/s²'
    assert not {'N', 'N s', 'N² s', 'J'} & set(units.values())
    page = (tmp_path / 'report.html').read_text()
    assert '"unit": "m/s\\u00b2"' in page
    assert 'with the acceleration as an arrow' in page and '>N</td>' not in page


def test_a_model_keeps_the_lag_with_which_the_cart_follows(bag, tmp_path):
    model = tmp_path / 'model.json'
    assert train.main([str(bag), '-o', str(model)]) == 0
    found = json.loads(model.read_text())
    assert found['delay'] + found['time_constant'] == pytest.approx(0.02, abs=0.01)


def test_what_is_identified_is_of_the_same_drive(bag, tmp_path):
    file = tmp_path / 'rig.yaml'
    assert identify.main([str(bag), '-o', str(file)]) == 0
    values = declarations.read([file])
    assert values['mpc']['drive'] == values['plant']['drive'] == 'velocity'
    assert values['mpc']['acceleration_limit'] == 10.0


def test_columns_name_the_units_of_what_was_sent_and_of_what_acted(bag, tmp_path):
    assert export.main([str(bag), '--output', str(tmp_path / 'run.csv')]) == 0
    states = pd.read_csv(tmp_path / 'run.csv')
    sent, acted = states['force_sent [m/s]'], states['force [m/s^2]']
    assert sent.abs().max() > 0.3 and acted.abs().max() > 2.0
    assert 'force [m/s^2]' in pd.read_csv(tmp_path / 'run_plans.csv').columns
