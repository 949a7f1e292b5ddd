# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Bags whose times or numbers are those of no motion are one line, for all that read motion."""

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message
from real_bags import again
from recorded_bags import record, START
from recorded_runs import told
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String

from dp_swing_ros.errors import UserError
from dp_swing_ros.identification.segments import period_of
from dp_swing_ros.tools import analyse, identify, train


def received(time):
    return lambda entry, n: entry._replace(received=time, sent=time)


def of_states(change):
    """Return what changes the states of a bag."""
    def changed(entry, n):
        if entry.topic != '/joint_states':
            return entry
        message = deserialize_message(entry.stored, JointState)
        change(message, n)
        return entry._replace(stored=serialize_message(message))
    return changed


def stamped(at):
    def change(message, n):
        message.header.stamp.sec, message.header.stamp.nanosec = at(n)
    return of_states(change)


def forced(force):
    return lambda entry, n: entry._replace(stored=serialize_message(Float64(data=force))) \
        if entry.topic == '/force_command' else entry


def moved(factor):
    def change(message, n):
        message.position = [factor * each for each in message.position]
        message.velocity = [factor * each for each in message.velocity]
    return of_states(change)


LOCKSTEP = ('/configuration', serialize_message(String(
    data=told('plant', {'links': 2, 'lockstep': True}).to_text())), START, START)
CHANGES = {
    'received at 2^63': received(2 ** 63), 'received at 2^64': received(2 ** 64 - 1),
    'received at 0': received(0), 'stamps of no order': stamped(lambda n: (-2 ** 31 + n % 7, n)),
    'stamps of 0 and 2^31': stamped(lambda n: ((n // 60) * (2 ** 31 - 1), n)),
    'stamps of years': stamped(lambda n: (n * 10 ** 6, 0)),
    'states of 1e200': moved(1e200), 'states of 1e308': moved(1e307),
    'states of infinity': moved(np.inf), 'states of NaN': moved(np.nan),
    'forces of 1e308': forced(1e308), 'forces of NaN': forced(np.nan)}


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    return record(tmp_path_factory.mktemp('bag') / 'bag', duration=6.0).parent


@pytest.mark.parametrize('tool', [identify, train])
@pytest.mark.parametrize('change', CHANGES)
def test_what_is_no_motion_is_one_line(change, tool, bag, tmp_path, capfd):
    counts = {}

    def changed(entry):
        counts[entry.topic] = counts.get(entry.topic, 0) + 1
        return [CHANGES[change](entry, counts[entry.topic])]
    # elsewhere than in lockstep, times of sending stand in for stamps that tell nothing
    strange = again(bag, tmp_path / 'strange', changed,
                    [LOCKSTEP] if change.startswith('stamps') else [])
    assert tool.main([str(strange)]) == 2
    shown, error = capfd.readouterr()
    assert error.count('\n') == 1 and 'error: ' in error and not shown, error + shown


def test_what_cannot_be_drawn_is_one_line(bag, tmp_path, capsys):
    change = CHANGES['states of 1e308']
    strange = again(bag, tmp_path / 'strange', lambda entry: [change(entry, 0)])
    assert analyse.main([str(strange), '--no-animation']) == 2
    assert 'expected a run of at most' in capsys.readouterr().err


@pytest.mark.parametrize('t', [
    [0, 0, 0], [0, 1e-9, 2e-9], [0, 10, 20], [0, 2 ** 31], [0, np.nan], [0, np.inf], [3, 2, 3.1]])
def test_times_of_no_motion_have_no_period(t):
    with pytest.raises(UserError, match='check their stamps'):
        period_of(np.array(t, dtype=float))
    assert period_of(np.array([0, 0.05, 0.1, 3.0])) == pytest.approx(0.05)
