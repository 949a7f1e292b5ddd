# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

from datetime import datetime, timezone

import pytest
from recorded_runs import START, told, write_bag
from synthetic import first, swing_up, without_ticks
import yaml

from dp_swing_ros.errors import BagError
from dp_swing_ros.pendulum.urdf import urdf
from dp_swing_ros.report.recording import named, recording


def lose(bag, told_of):
    """Add to the metadata of a bag what its logger tells."""
    content = yaml.safe_load((bag / 'metadata.yaml').read_text())
    content['rosbag2_bagfile_information']['custom_data'] = told_of
    (bag / 'metadata.yaml').write_text(yaml.safe_dump(content))


def test_recording_tells_all_there_is(tmp_path):
    run = swing_up(duration=2.0)
    mpc = told('mpc', {'horizon': 30})
    found = recording(write_bag(run, tmp_path / 'bag', [mpc]))
    assert found.configurations == {'mpc': mpc}
    assert found.description == urdf(run.physical, run.limits)
    assert found.began == datetime.fromtimestamp(START / 1e9, timezone.utc)
    assert found.took == pytest.approx(2.0)
    assert found.counts == {'/diagnostics': 40, 'configuration': 1, 'joint_states': 41,
                            'robot_description': 1}
    assert found.lost == {}


def test_older_bag_without_controller_is_read(tmp_path):
    found = recording(write_bag(without_ticks(swing_up(duration=2.0)), tmp_path / 'bag'))
    assert found.configurations == {}
    assert found.counts['joint_states'] == 41
    assert '/diagnostics' not in found.counts


def test_losses_are_those_that_the_logger_told(tmp_path):
    bag = write_bag(first(swing_up(), 9), tmp_path / 'bag')
    lose(bag, {'lost:/joint_states': '3', 'lost:/diagnostics': 0, 'other': 'words'})
    assert recording(bag).lost == {'/joint_states': 3, '/diagnostics': 0}
    assert recording(bag / 'bag_0.mcap').lost == {'/joint_states': 3, '/diagnostics': 0}


@pytest.mark.parametrize('text', [
    '[', 'word', 'rosbag2_bagfile_information: 3',
    'rosbag2_bagfile_information: {custom_data: {"lost:/a": some}}'])
def test_damaged_metadata_is_a_bag_error(text, tmp_path):
    bag = write_bag(first(swing_up(), 9), tmp_path / 'bag')
    (bag / 'metadata.yaml').write_text(text)
    with pytest.raises(BagError, match='metadata.yaml.*ros2 bag reindex'):
        recording(bag)


def test_runs_are_named_by_solver_and_where_that_is_not_enough_by_bag(tmp_path):
    solvers = {'a/bag': 'ilqr', 'b/bag': 'ilqr', 'c': 'ilqr', 'd': 'ddp', 'e': ''}
    runs = [recording(write_bag(first(swing_up(solver=solver), 9), tmp_path / place))
            for place, solver in solvers.items()]
    assert list(named(runs)) == ['ilqr a/bag', 'ilqr b/bag', 'ilqr c', 'ddp', 'no controller']
    assert list(named(runs).values()) == runs
    assert list(named(runs[:1])) == ['ilqr']


def test_bag_given_twice_is_refused(tmp_path, monkeypatch):
    write_bag(first(swing_up(), 9), tmp_path / 'bag')
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BagError, match='given twice'):
        named([recording(tmp_path / 'bag'), recording('bag')])
