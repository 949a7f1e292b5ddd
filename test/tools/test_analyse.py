# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import numpy as np
from PIL import Image
import pytest
import rclpy  # noqa: F401  the wheels start Python anew here, before anything else is read
from rclpy.serialization import serialize_message
from std_msgs.msg import String
from synthetic import swing_up

from dp_swing_ros import topics
from dp_swing_ros.bags import read_episode
from dp_swing_ros.bags.definitions import schema
from dp_swing_ros.bags.writer import BagWriter, Recorded
from dp_swing_ros.comparison import table
from dp_swing_ros.metrics import measure
from dp_swing_ros.nodes.messages import to_diagnostics, to_joint_state, to_stamp
from dp_swing_ros.tools.analyse import beside, main
from dp_swing_ros.urdf import urdf

START = 1_000_000_000_000  # [ns]
STILLS = {'hero.png', 'snapshots.png', 'squared_error.png', 'timeline.png'}


def write_bag(episode, folder):
    """Write an episode as the logger would."""
    writer = BagWriter(folder)
    for topic in (topics.ROBOT_DESCRIPTION, topics.JOINT_STATES, topics.DIAGNOSTICS):
        writer.add(Recorded(topic.name, topic.type, schema(topic.type), '', []))

    def write(topic, time, message):
        writer.write(topic.name, serialize_message(message), time, time)

    write(topics.ROBOT_DESCRIPTION, START, String(data=urdf(episode.bodies, episode.limits)))
    stamps = [START + round(1e9 * t) for t in episode.t]
    for stamp, x, u in zip(stamps, episode.X, [0.0, *episode.U]):
        write(topics.JOINT_STATES, stamp, to_joint_state(to_stamp(stamp), x, u))
    columns = zip(stamps, *episode.ticks[1:])
    for stamp, cost, iterations, solve_time, latency, late, status in columns:
        write(topics.DIAGNOSTICS, stamp, to_diagnostics(to_stamp(stamp), 'mpc', 0, '', {
            'solver': episode.solver, 'cost': cost, 'iterations': int(iterations),
            'solve_time': solve_time, 'latency': latency, 'late': int(late), 'status': status}))
    writer.close()


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    folder = tmp_path_factory.mktemp('analyse') / 'bag'
    write_bag(swing_up(duration=2.5), folder)
    return folder


def test_bag_gives_table_and_all_pictures(bag, tmp_path, capsys):
    assert main([str(bag), '--output', str(tmp_path / 'new' / 'pictures')]) == 0
    shown = capsys.readouterr().out
    made = {path.name for path in (tmp_path / 'new' / 'pictures').iterdir()}
    assert made == STILLS | {'animation.gif'}
    for name in made:
        assert str(tmp_path / 'new' / 'pictures' / name) in shown
        with Image.open(tmp_path / 'new' / 'pictures' / name) as image:
            image.verify()
    assert table({'ilqr': measure(read_episode(bag))}) in shown


def test_table_is_that_of_the_episode_before_it_was_recorded(bag):
    before, after = measure(swing_up(duration=2.5)), measure(read_episode(bag))
    np.testing.assert_allclose(
        [float(value) for value in vars(after).values()],
        [float(value) for value in vars(before).values()], rtol=1e-6, atol=1e-9)


def test_pictures_lie_beside_the_bag_by_default(bag, capsys):
    before = sorted(bag.iterdir())
    assert main([str(bag), '--no-animation']) == 0
    assert {path.name for path in beside(bag).iterdir()} == STILLS
    assert sorted(bag.iterdir()) == before


def test_place_beside_follows_the_name_of_the_bag(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert beside(tmp_path / 'runs.d') == tmp_path / 'runs.d_analysis'
    assert beside(tmp_path / 'bag' / 'bag_0.mcap') == tmp_path / 'bag' / 'bag_0_analysis'
    assert beside(tmp_path / '.') == tmp_path.with_name(f'{tmp_path.name}_analysis')


def one_line(capsys):
    error = capsys.readouterr().err
    assert error.count('\n') == 1
    assert error.startswith('analyse: error: ')
    return error


def test_missing_bag_is_one_line(tmp_path, capsys):
    assert main([str(tmp_path / 'none')]) == 2
    assert 'none' in one_line(capsys)


def test_file_that_is_no_bag_is_one_line(tmp_path, capsys):
    (tmp_path / 'text.mcap').write_text('text')
    assert main([str(tmp_path / 'text.mcap')]) == 2
    assert 'text.mcap' in one_line(capsys)


def test_folder_that_cannot_be_made_is_one_line(bag, tmp_path, capsys):
    (tmp_path / 'file').write_text('')
    assert main([str(bag), '--output', str(tmp_path / 'file')]) == 2
    assert 'file' in one_line(capsys)


def test_bag_without_an_end_is_read_when_asked(bag, tmp_path, capsys):
    whole = next(bag.glob('*.mcap')).read_bytes()
    cut = tmp_path / 'cut.mcap'
    cut.write_bytes(whole[:-200])
    assert main([str(cut), '--no-animation']) == 2
    one_line(capsys)
    assert main([str(cut), '--no-animation', '--partial']) == 0


@pytest.mark.parametrize('option', ['--help', '-h'])
def test_help_says_what_it_does(option, capsys):
    with pytest.raises(SystemExit) as end:
        main([option])
    assert end.value.code == 0
    assert 'BAG' in capsys.readouterr().out


def test_missing_argument_is_misuse(capsys):
    with pytest.raises(SystemExit) as end:
        main([])
    assert end.value.code == 2
