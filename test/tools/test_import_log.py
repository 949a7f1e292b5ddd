# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Logs of other people, in their units and disorder, as bags that others read."""

import gzip
import math

from mcap_ros2.reader import read_ros2_messages
import numpy as np
import pandas
import pytest
from rclpy.serialization import deserialize_message
from recorded_runs import write_bag
from rosbags.highlevel import AnyReader
from rosbags.typesys import get_typestore, Stores
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from synthetic import swing_up

from dp_swing_ros.bags import read_episode
from dp_swing_ros.bags.logs import column_of, columns_of, read_log, write_log
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.errors import UserError
from dp_swing_ros.messages.cdr import to_floats, to_joint_states
from dp_swing_ros.pendulum.state import joints, wrapped
from dp_swing_ros.tools import export
from dp_swing_ros.tools.import_log import main

T = np.arange(40) * 0.005
TURN = np.column_stack([np.pi + 0.3 * np.sin(5 * T), 3.0 + 0.2 * np.cos(9 * T)])


def log(folder, text, name='log.csv'):
    """Write a log, and return its path."""
    path = folder / name
    path.write_text(text, encoding='utf-8')
    return path


def table(**columns):
    return pandas.DataFrame(columns).to_csv(index=False)


def states(bag):
    """Return the states of a bag as a foreign reader has them: stamps [s], positions, speeds."""
    found = [each.ros_msg for each in read_ros2_messages(next(bag.glob('*.mcap')),
                                                         ['/joint_states'])]
    return (np.array([each.header.stamp.sec + 1e-9 * each.header.stamp.nanosec for each in found]),
            np.array([each.position for each in found]),
            [list(each.velocity) for each in found], [list(each.name) for each in found])


@pytest.mark.parametrize('links', [1, 2, 3])
@pytest.mark.parametrize('speeds', [True, False])
@pytest.mark.parametrize('forces', [True, False])
def test_messages_are_those_that_ros_itself_reads(links, speeds, forces, rng):
    stamps = rng.integers(0, 2 ** 31 * 10 ** 9, 5)
    q, v = rng.normal(size=(2, 5, links + 1))
    rows = to_joint_states(stamps, q, v if speeds else None, q[:, 0] if forces else None,
                           joints(links))
    for n, row in enumerate(rows):
        message = JointState(name=list(joints(links)), position=q[n].tolist(),
                             velocity=v[n].tolist() if speeds else [],
                             effort=[q[n, 0], *[0.0] * links] if forces else [])
        message.header.stamp.sec, message.header.stamp.nanosec = map(int, divmod(
            stamps[n], 10 ** 9))
        assert deserialize_message(row.tobytes(), JointState) == message
    for value, row in zip(q[:, 0], to_floats(q[:, 0])):
        assert deserialize_message(row.tobytes(), Float64) == Float64(data=value)


def test_units_and_conventions_of_others_are_made_the_states_own(tmp_path, capsys):
    relative = np.degrees(np.column_stack([TURN[:, 0] - np.pi, TURN[:, 1] - TURN[:, 0]]))
    path = log(tmp_path, table(**{
        'time_ms': 1e3 * T, 'x [mm]': -50 + T, 'a_deg': -relative[:, 0],
        'b': relative[:, 1], 'speed': np.full(40, 60.0), 'u': np.where(T < 0.1, np.nan, 2.0)}))
    assert main([str(path), '-o', str(tmp_path / 'bag'), '--columns', 't=time_ms', 'cart=x [mm]',
                 'joint1=a_deg', 'joint2=b:deg', 'joint1_velocity=speed:rpm', 'force=u',
                 '--signs', '1', '-1', '1', '--relative-angles', '--hangs-at-zero']) == 0
    t, q, v, names = states(tmp_path / 'bag')
    assert names[0] == ['cart', 'joint1', 'joint2']
    np.testing.assert_allclose(t - t[0], T, atol=1e-9)
    np.testing.assert_allclose(q[:, 1:], TURN, atol=1e-12)
    np.testing.assert_allclose(q[:, 0], 1e-3 * (T - 50), atol=1e-12)
    np.testing.assert_allclose([each[1] for each in v], -2 * math.pi)
    sent = [each.ros_msg.data for each in read_ros2_messages(
        next((tmp_path / 'bag').glob('*.mcap')), ['/force_command'])]
    assert sent == [2.0] * 20
    shown = capsys.readouterr().out
    assert '40 rows; 40 states over 0.195 s, one every 5 ms (200 Hz)' in shown
    assert "cells without a number in 'u': 20" in shown
    assert '| joint1_velocity | speed   | rpm |' in shown


def test_a_foreign_reader_opens_it_by_its_metadata(tmp_path):
    path = log(tmp_path, table(t=T, theta=TURN[:, 0], force=T))
    assert main([str(path), '--columns', 't=t', 'joint1=theta', 'force=force']) == 0
    with AnyReader([tmp_path / 'log_bag'],
                   default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
        assert {each.topic: each.msgcount for each in reader.connections} == {
            '/robot_description': 1, '/joint_states': 40, '/force_command': 40}
        found = [reader.deserialize(raw, connection.msgtype).position[1]
                 for connection, _, raw in reader.messages(
                     [each for each in reader.connections if each.topic == '/joint_states'])]
    np.testing.assert_array_equal(found, TURN[:, 0])


@pytest.mark.parametrize('kind', ['csv', 'parquet'])
def test_what_was_exported_comes_back(kind, tmp_path):
    bag = write_bag(swing_up(duration=2.0), tmp_path / 'bag')
    path = tmp_path / f'run.{kind}'
    assert export.main([str(bag), '--whole-turns', '--output', str(path)]) == 0
    assert main([str(path), '-o', str(tmp_path / 'again'), '--columns', 't=t [s]', 'cart=x [m]',
                 'joint1=theta1 [rad]', 'joint2=theta2 [rad]', 'cart_velocity=x_dot [m/s]',
                 'joint1_velocity=theta1_dot [rad/s]', 'joint2_velocity=theta2_dot [rad/s]',
                 'force=force [N]']) == 0
    first, again = read_episode(bag), read_episode(tmp_path / 'again')
    np.testing.assert_array_equal(wrapped(again.X), wrapped(first.X))
    np.testing.assert_allclose(again.t, first.t, atol=1e-9)
    np.testing.assert_array_equal(again.U, first.U)


def test_disorder_is_put_in_order_and_said(tmp_path, capsys):
    t = T.copy()
    t[[5, 9]] = t[[9, 5]]      # two swapped, one doubled, a gap, one without a time
    t[20], t[30:] = t[19], t[30:] + 0.1
    text = table(t=np.where(np.arange(40) == 35, np.nan, t), theta=TURN[:, 0])
    path = log(tmp_path, text)
    assert main([str(path), '--columns', 't=t', 'joint1=theta']) == 0
    found, q, _, _ = states(tmp_path / 'log_bag')
    assert np.all(np.diff(found) > 0) and len(found) == 38
    np.testing.assert_array_equal(q[[5, 9], 1], TURN[[9, 5], 0])
    shown = capsys.readouterr().out
    for said in ('without a time: left out: 1', 'put in order: 2', 'the first was taken: 1',
                 'gaps of more than three times that: 1, 0.105 s in all'):
        assert said in shown


@pytest.mark.parametrize('text, columns', [
    ('t;theta\n0,0;3,1\n0,005;3,2\n0,01;3,3\n', ['t=t', 'joint1=theta']),
    ('0.0 3.1\n0.005 3.2\n0.01 3.3\n', ['t=#1', 'joint1=#2']),
    ('t\ttheta\n0.0\t3.1\n0.005\t3.2\n0.01\t3.3\n', ['t=t', 'joint1=theta']),
    ('t, theta\n0.0, 3.1\n0.005, 3.2\n0.01, 3.3\n', ['t=t', 'joint1=theta']),
    ('# made, by me\n# t,theta\n0,3.1\n0.005,3.2\n0.01,3.3\n', ['t=t', 'joint1=theta']),
    ('% by me\r\n\r\n"t","theta"\r\n0,3.1\r\n0.005,3.2\r\n0.01,3.3\r\n',
     ['t=t', 'joint1=theta'])],
    ids=['semicolons and commas', 'no names, blanks', 'tabs', 'blanks behind commas',
         'names in a comment', 'comment and quotes'])
def test_forms_of_csv_are_found_out(text, columns, tmp_path):
    path = log(tmp_path, text)
    assert main([str(path), '--columns', *columns]) == 0
    t, q, _, _ = states(tmp_path / 'log_bag')
    np.testing.assert_allclose(t - t[0], [0.0, 0.005, 0.01], atol=1e-9)
    np.testing.assert_array_equal(q, [[0.0, 3.1], [0.0, 3.2], [0.0, 3.3]])


def test_times_of_a_clock_stay_and_a_rate_stands_for_times(tmp_path):
    path = tmp_path / 'log.csv.gz'
    path.write_bytes(gzip.compress(table(t=1.7e9 + T, theta=TURN[:, 0]).encode()))
    assert main([str(path), '-o', str(tmp_path / 'one'), '--columns', 't=t', 'joint1=theta']) == 0
    np.testing.assert_allclose(states(tmp_path / 'one')[0], 1.7e9 + T, atol=1e-6)
    assert main([str(path), '-o', str(tmp_path / 'two'), '--columns', 'joint1=theta',
                 'cart=0.25', '--rate', '50']) == 0
    t, q, _, _ = states(tmp_path / 'two')
    np.testing.assert_allclose(np.diff(t), 0.02, atol=1e-9)
    assert set(q[:, 0]) == {0.25}


@pytest.mark.parametrize('arguments, words', [
    (['t=t', 'joint1=angle'], "has no column 'angle'; it has 't', 'theta', 'word'"),
    (['t=t', 'joint1=word'], "has 'up' in column 'word', row 3; expected a number"),
    (['t=t', 'joint1=theta:mm'], "joint1=theta:mm is in 'mm'; expected angle, in rad"),
    (['t=t', 'joint1=theta [grad]'], "joint1=theta [grad] is in 'grad'; expected angle"),
    (['t=t', 'joint1=nan'], 'joint1=nan is no value; expected a finite one, or a column'),
    (['t=1', 'joint1=2'], 'no column is read: a number stands for itself'),
    (['t=t', 'joint4=theta'], "a pendulum has no 'joint4'; expected of t, cart, joint1"),
    (['joint1=theta'], 'expected t (or --rate) and at least joint1'),
    (['t=t', 'joint2=theta'], 'expected a column for joint1'),
    (['t=t', 'joint1=theta', '--signs', '1'], 'there are 1 --signs; expected 2')], ids=str)
def test_what_cannot_be_imported_is_one_line(arguments, words, tmp_path, capsys):
    path = log(tmp_path, 't,theta,word\n0,1,\n1,2,3\n2,3,up\n')
    assert main([str(path), '--columns', *arguments]) == 2
    shown = capsys.readouterr().err
    assert words in shown and len(shown.splitlines()) == 1
    assert not (tmp_path / 'log_bag').exists()


@pytest.mark.parametrize('t, words', [
    (1.7e12 + 5.0 * np.arange(40), 'name their unit, as t=t:ms'),
    (np.append(0.0, 1.7e9 + T[1:]), 'leave out rows of another clock'),
    (np.ones(40), '1 different times in 40 rows')])
def test_times_that_are_none_leave_no_bag(t, words, tmp_path, capsys):
    assert main([str(log(tmp_path, table(t=t, theta=TURN[:, 0]))), '--columns', 't=t',
                 'joint1=theta']) == 2
    assert words in capsys.readouterr().err
    assert not (tmp_path / 'log_bag').exists()


def test_a_rate_stands_for_times_whatever_they_are(tmp_path, capsys):
    path = log(tmp_path, 'clock,theta\n12:00:01,1\n12:00:02,2\n12:00:03,3\n')
    columns = ['--columns', 't=clock', 'joint1=theta', '-o', str(tmp_path / 'bag')]
    assert main([str(path), *columns, '--rate', '50']) == 0
    assert states(tmp_path / 'bag')[0] == pytest.approx([1.0, 1.02, 1.04])
    assert 'clock' not in capsys.readouterr().out   # which was not read
    assert 't' not in columns_of({'t': 'clock', 'joint1': 'theta'}, 50.0)
    many = log(tmp_path, 'theta\n' + '1\n' * 2000, 'many.csv')
    assert main([str(many), '--columns', 'joint1=theta', '--rate', '0.005']) == 2
    assert 'give a rate in Hz, not 0.005' in capsys.readouterr().err


def test_of_parquet_an_index_is_a_column_and_dates_are_refused(tmp_path, capsys):
    pytest.importorskip('pyarrow')
    frame = pandas.DataFrame({'theta': TURN[:, 0]}, index=pandas.Index(T, name='time'))
    frame.to_parquet(tmp_path / 'log.parquet')
    columns = ['--columns', 't=time', 'joint1=theta']
    assert main([str(tmp_path / 'log.parquet'), *columns, '-o', str(tmp_path / 'bag')]) == 0
    assert len(states(tmp_path / 'bag')[0]) == len(T)
    dated = frame.assign(time=pandas.to_datetime(1.7e9 + T, unit='s')).reset_index(drop=True)
    dated.to_parquet(tmp_path / 'dated.parquet')
    assert main([str(tmp_path / 'dated.parquet'), *columns]) == 2
    assert "dates or durations in column 'time'" in capsys.readouterr().err


def test_a_damaged_archive_is_one_line(tmp_path, capsys):
    data = bytearray(gzip.compress(table(t=T, theta=TURN[:, 0]).encode()))
    data[20:60] = bytes(40)
    (tmp_path / 'log.csv.gz').write_bytes(data)
    assert main([str(tmp_path / 'log.csv.gz'), '--columns', 't=t', 'joint1=theta']) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_what_an_interrupt_leaves_says_how_much_there_was(tmp_path):
    def interrupted(stamps):
        yield from stamps[:10]
        raise KeyboardInterrupt
    read = read_log(log(tmp_path, table(t=T, theta=TURN[:, 0], u=TURN[:, 0])), {
        't': column_of('t', 't'), 'joint1': column_of('joint1', 'theta'),
        'force': column_of('force', 'u')})
    with pytest.raises(KeyboardInterrupt):
        write_log(read, tmp_path / 'bag', 'robot', interrupted)
    assert Bag(tmp_path / 'bag').incomplete == f'Incomplete: 21 of {1 + 2 * len(T)} messages'
    write_log(read, tmp_path / 'whole', 'robot')
    assert Bag(tmp_path / 'whole').incomplete == ''


def test_columns_of_one_name_are_refused(tmp_path, capsys):
    path = log(tmp_path, 't,a,a \n0,1,2\n1,2,3\n')
    assert main([str(path), '--columns', 't=t', 'joint1=a']) == 2
    assert "has several columns 'a'" in capsys.readouterr().err


def test_a_cell_that_is_none_is_named_with_decimal_commas_too(tmp_path, capsys):
    path = log(tmp_path, 't;a\n0,0;3,1\n0,1;-\n')
    assert main([str(path), '--columns', 't=t', 'joint1=a']) == 2
    assert "has '-' in column 'a', row 2" in capsys.readouterr().err


def test_what_is_no_text_is_refused(tmp_path, capsys):
    path = tmp_path / 'log.xlsx'
    path.write_bytes(b'PK\3\4\0\0')
    assert main([str(path), '--columns', 't=t', 'joint1=a']) == 2
    assert 'is no text; expected CSV or Parquet' in capsys.readouterr().err


@pytest.mark.parametrize('text', ['', 't,theta\n', 't,theta\n0,1\n'])
def test_too_few_rows_are_one_line(text, tmp_path, capsys):
    assert main([str(log(tmp_path, text)), '--columns', 't=t', 'joint1=theta']) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize('rows', ['1,2,3\n2,3,4', '1,2\n2,3\n3,4,5'])
def test_a_row_that_is_longer_than_the_names_shifts_nothing(rows, tmp_path, capsys):
    assert main([str(log(tmp_path, f't,theta\n{rows}\n')), '--columns', 't=t',
                 'joint1=theta']) == 2
    assert 'cannot read' in capsys.readouterr().err


def test_what_is_there_is_not_overwritten(tmp_path, capsys):
    path = log(tmp_path, table(t=T, theta=TURN[:, 0]))
    for code in (0, 2):
        assert main([str(path), '--columns', 't=t', 'joint1=theta']) == code
    assert 'exists and is not overwritten' in capsys.readouterr().err


@pytest.mark.parametrize('text, unit', [
    ('x_mm', 'mm'), ('x [cm]', 'cm'), ('x[mm]', 'mm'), ('x (m)', 'm'), ('position', ''),
    ('x_mm:m', 'm')])
def test_a_unit_is_that_at_the_end_of_a_name_or_said(text, unit):
    assert column_of('cart', text).unit == unit


def test_a_unit_of_something_else_is_refused():
    with pytest.raises(UserError, match='name its unit, as joint1=theta_m:rad'):
        column_of('joint1', 'theta_m')
