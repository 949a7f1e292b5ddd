# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

from diagnostic_msgs.msg import KeyValue
import numpy as np
import pandas
import pytest
from real_bags import rewritten
from recorded_bags import record
from recorded_runs import write_bag
from synthetic import swing_up

from dp_swing_ros.bags import read_episode
from dp_swing_ros.bags.tables import state_columns
from dp_swing_ros.pendulum.state import joints, wrapped
from dp_swing_ros.tools import export
from dp_swing_ros.tools.export import main
from dp_swing_ros.topics import DIAGNOSTICS

STATES, JOINTS = state_columns(2), joints(2)
READ = {'csv': pandas.read_csv, 'parquet': pandas.read_parquet}


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    return write_bag(swing_up(duration=2.5), tmp_path_factory.mktemp('export') / 'bag')


@pytest.mark.parametrize('kind', ['csv', 'parquet'])
def test_states_come_back_to_the_bit_with_units(bag, kind, tmp_path, capsys):
    path = tmp_path / 'new' / f'run.{kind}'
    assert main([str(bag), '--output', str(path)]) == 0
    assert f'{path}: 51 rows' in capsys.readouterr().out
    frame, episode = READ[kind](path), read_episode(bag)
    assert list(frame)[:8] == ['t [s]', 'stamp [ns]', *STATES]
    np.testing.assert_array_equal(frame[STATES], wrapped(episode.X))
    np.testing.assert_array_equal(frame['t [s]'], episode.t)
    np.testing.assert_array_equal(frame['force [N]'][:-1], episode.U)
    np.testing.assert_array_equal(frame['solve_time [s]'][:-1], episode.ticks.solve_time)
    assert set(frame['status'].dropna()) == {'CONVERGED'}
    assert frame[['theta1 [rad]', 'theta2 [rad]']].abs().to_numpy().max() <= np.pi
    assert len(READ[kind](path.with_stem('run_plans'))) == 0    # none was recorded


@pytest.mark.parametrize('options, angle', [([], 7.0 - 2 * np.pi), (['--whole-turns'], 7.0)])
def test_the_angles_of_an_estimate_are_as_those_of_the_state(options, angle, tmp_path):
    def estimated(message):
        message.status[0].values += [KeyValue(key=f'estimate_{joint}_position', value='7.0')
                                     for joint in JOINTS]
        return message

    bag = rewritten(record(tmp_path / 'whole').parent, tmp_path / 'bag', DIAGNOSTICS, estimated)
    assert main([str(bag), *options, '--output', str(tmp_path / 'run.csv')]) == 0
    row = pandas.read_csv(tmp_path / 'run.csv').iloc[0]
    for joint, expected in zip(JOINTS, (7.0, angle, angle)):
        unit = 'm' if joint == 'cart' else 'rad'
        assert row[f'estimate_{joint}_position [{unit}]'] == pytest.approx(expected)


def test_whole_turns_are_kept_when_asked(bag, tmp_path):
    assert main([str(bag), '--whole-turns', '--output', str(tmp_path / 'run.csv')]) == 0
    frame = pandas.read_csv(tmp_path / 'run.csv')
    np.testing.assert_array_equal(frame[STATES], read_episode(bag).X)


def test_the_file_lies_beside_the_bag(bag):
    assert main([str(bag)]) == 0
    assert main([str(bag), '--format', 'parquet']) == 0
    assert {path.name for path in bag.parent.iterdir()} == {
        'bag', 'bag_states.csv', 'bag_states_plans.csv', 'bag_states.parquet',
        'bag_states_plans.parquet'}


@pytest.mark.parametrize('arguments, text', [
    (['--output', 'run.xlsx'], 'does not end in .csv or .parquet'),
    (['--output', 'run.csv', '--format', 'parquet'], 'does not end in .parquet')])
def test_other_formats_are_one_line(bag, arguments, text, capsys):
    assert main([str(bag), *arguments]) == 2
    assert text in capsys.readouterr().err


def test_without_pyarrow_there_is_csv(bag, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(export, 'find_spec', lambda name: None)
    assert main([str(bag), '--output', str(tmp_path / 'run.parquet')]) == 2
    assert 'pip install pyarrow' in capsys.readouterr().err
    assert main([str(bag), '--output', str(tmp_path / 'run.csv')]) == 0
