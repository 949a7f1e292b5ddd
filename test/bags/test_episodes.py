# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import math
import subprocess
import sys

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
import numpy as np
import pytest
from recorded_runs import serialised, told, write_bag
from rosbags.highlevel import AnyReader
from std_msgs.msg import Float64, String
from synthetic import swing_up

from dp_swing_ros.bags import read_episode
from dp_swing_ros.bags.episodes import completed, differenced, Sample
from dp_swing_ros.bags.metadata import Recorded
from dp_swing_ros.bags.writer import BagWriter
from dp_swing_ros.errors import BagError
from dp_swing_ros.evaluation.metrics import measure
from dp_swing_ros.messages.cdr import to_diagnostics
from dp_swing_ros.messages.definitions import schema
from dp_swing_ros.messages.fields import Report
from dp_swing_ros.nodes.messages import to_joint_state, to_stamp
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.urdf import urdf
from dp_swing_ros.topics import DIAGNOSTICS, FORCE_COMMAND, JOINT_STATES, ROBOT_DESCRIPTION, TOPICS

START = 1_795_225_249_000_000_000
PERIOD = 50_000_000
PHYSICAL = PendulumParameters(link2_length=0.7, joint1_friction=0.1)
LIMITS = LimitParameters(force_limit=math.inf)
X = np.random.default_rng(0).normal(size=(40, 6))
U = np.arange(39.0)
QOS = [{'history': 'keep_last', 'depth': 100, 'reliability': 'reliable',
        'durability': 'transient_local', 'deadline': {'sec': 9223372036, 'nsec': 854775807},
        'lifespan': {'sec': 9223372036, 'nsec': 854775807}, 'liveliness': 'automatic',
        'liveliness_lease_duration': {'sec': 9223372036, 'nsec': 854775807},
        'avoid_ros_namespace_conventions': False}]


def make_writer(folder, namespace=''):
    writer = BagWriter(folder)
    for topic in TOPICS:
        name = topic.name if topic.name.startswith('/') else f'{namespace}/{topic.name}'
        writer.add(Recorded(name, topic.type, schema(topic.type), '', QOS))
    return writer


def write_run(writer, namespace='', order=range(40)):
    """Write a run of 40 states and of as many ticks."""
    def write(topic, message, time):
        name = topic.name if topic.name.startswith('/') else f'{namespace}/{topic.name}'
        writer.write(name, serialised(message), time + 1000, time)

    write(ROBOT_DESCRIPTION, String(data=urdf(PHYSICAL, LIMITS)), START)
    for n in order:
        time = START + n * PERIOD
        write(JOINT_STATES, to_joint_state(to_stamp(time), X[n], U[n - 1] if n else 0.0), time)
        write(FORCE_COMMAND, Float64(data=float(n)), time)
        write(DIAGNOSTICS, to_diagnostics(to_stamp(time), 'plant', 0, '', {'force': 1.0}), time)
        write(DIAGNOSTICS, to_diagnostics(to_stamp(time), 'mpc', 0, '', {
            'solver': 'ddp', 'status': 'CONVERGED', 'cost': n / 3, 'iterations': n,
            'solve_time': 0.002, 'latency': 0.003, 'late': n == 7, 'force': 1.0}), time)


@pytest.fixture
def bag(tmp_path):
    """Return the folder of a finished bag."""
    writer = make_writer(tmp_path / 'bag')
    write_run(writer)
    writer.close()
    return tmp_path / 'bag'


def check(episode, count=40):
    """Check that an episode is the one written, or its beginning."""
    assert np.array_equal(episode.t, np.arange(count) * PERIOD / 1e9)
    assert np.array_equal(episode.X, X[:count])
    assert np.array_equal(episode.U, U[:count - 1])
    assert (episode.physical, episode.limits, episode.solver) == (PHYSICAL, LIMITS, 'ddp')


def test_episode_comes_back_to_the_bit(bag):
    for path in (bag, str(bag), bag / 'bag_0.mcap'):
        episode = read_episode(path)
        check(episode)
        assert np.array_equal(episode.ticks.t, episode.t)
        assert np.array_equal(episode.ticks.cost, np.arange(40) / 3)
        assert np.array_equal(episode.ticks.iterations, np.arange(40))
        assert episode.ticks.late.tolist() == [n == 7 for n in range(40)]
        assert episode.ticks.status == ['CONVERGED'] * 40
        assert (episode.ticks.solve_time == 0.002).all()
        assert (episode.ticks.latency == 0.003).all()


def test_ticks_after_the_last_state_are_none_of_the_run(tmp_path):
    writer = make_writer(tmp_path / 'bag')
    write_run(writer)
    for n in range(40, 44):   # the plant has ended, and the mpc carries on
        time = START + n * PERIOD
        writer.write(DIAGNOSTICS.name, serialised(to_diagnostics(to_stamp(time), 'mpc', 1, '', {
            'solver': 'ddp', 'status': 'LAST_POLICY', 'cost': 1.0, 'iterations': 0,
            'solve_time': 0.0, 'latency': 0.0, 'late': False, 'force': 1.0})), time + 1000, time)
    writer.close()
    metrics = measure(read_episode(tmp_path / 'bag'))
    assert (metrics.ticks, metrics.states, metrics.stand_ins) == (40, 40, 0)


def test_order_and_repetition_do_not_matter(tmp_path):
    writer = make_writer(tmp_path / 'bag')
    write_run(writer, order=[3, *reversed(range(40)), 3])
    writer.close()
    check(read_episode(tmp_path / 'bag'))


def test_namespace_is_found(tmp_path):
    writer = make_writer(tmp_path / 'bag', '/left')
    write_run(writer, '/left')
    writer.close()
    check(read_episode(tmp_path / 'bag'))


def test_reading_needs_no_ros_and_of_a_whole_bag_no_recovery(bag):
    code = ('import sys\nsys.modules.update(rclpy=None, sensor_msgs=None)\n'
            'from dp_swing_ros.bags import read_episode\n'
            f'print(len(read_episode({str(bag)!r}).t))\n'
            'sys.exit("dp_swing_ros.recovery" in sys.modules)')
    assert subprocess.check_output([sys.executable, '-c', code], text=True) == '40\n'


def test_other_readers_agree(bag):
    with AnyReader([bag]) as reader:
        assert reader.message_count == 1 + 4 * 40
        states = [reader.deserialize(data, connection.msgtype)
                  for connection, _, data in reader.messages()
                  if connection.topic == '/joint_states']
    assert np.array_equal([[*state.position, *state.velocity] for state in states], X)
    with (bag / 'bag_0.mcap').open('rb') as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        assert reader.get_header().profile == 'ros2'
        forces = [(message.publish_time, message.log_time, decoded.data)
                  for _, _, message, decoded in reader.iter_decoded_messages(['/force_command'])]
    assert forces == [(START + n * PERIOD, START + n * PERIOD + 1000, n) for n in range(40)]


def test_nothing_is_overwritten(bag):
    before = (bag / 'bag_0.mcap').read_bytes()
    with pytest.raises(BagError, match='exists and is not overwritten'):
        BagWriter(bag)
    assert (bag / 'bag_0.mcap').read_bytes() == before


def test_place_that_cannot_be_written(tmp_path):
    (tmp_path / 'file').write_text('')
    with pytest.raises(BagError, match='Not a directory'):
        BagWriter(tmp_path / 'file' / 'bag')


def test_removed_bag_is_noticed(tmp_path):
    writer = make_writer(tmp_path / 'bag')
    write_run(writer)
    (tmp_path / 'bag' / 'bag_0.mcap').unlink()
    with pytest.raises(BagError, match='it was removed'):
        writer.flush()
    writer.close()
    assert list((tmp_path / 'bag').iterdir()) == []


@pytest.mark.parametrize('cut', [1, 9, 40, 200, 2000])
def test_file_without_end_is_read_on_request(tmp_path, cut):
    writer = make_writer(tmp_path / 'bag')
    for n in range(40):
        write_run(writer, order=[n])
        writer.flush()
    writer.close()
    file = tmp_path / 'bag' / 'bag_0.mcap'
    file.write_bytes(file.read_bytes()[:-cut])
    with pytest.raises(BagError, match=r'messages but no end.*\(partial\)'):
        read_episode(file)
    check(read_episode(file, partial=True))


def test_file_cut_amid_its_messages(tmp_path):
    writer = make_writer(tmp_path / 'bag')
    for n in range(40):
        write_run(writer, order=[n])
        writer.flush()
    file = tmp_path / 'bag' / 'bag_0.mcap'
    content = file.read_bytes()
    for size in np.linspace(len(content) // 2, len(content) - 1, 25, dtype=int):
        file.write_bytes(content[:size])
        episode = read_episode(file, partial=True)
        assert 15 < len(episode.t) <= 40
        check(episode, len(episode.t))


def test_damage_is_told(bag):
    file = bag / 'bag_0.mcap'
    content = bytearray(file.read_bytes())
    content[400] ^= 0xff  # within the compressed messages
    file.write_bytes(content)
    for partial in (False, True):
        with pytest.raises(BagError, match='is damaged after 0 messages'):
            read_episode(bag, partial)


def test_places_without_a_bag(tmp_path):
    with pytest.raises(BagError, match='there is no bag'):
        read_episode(tmp_path / 'nowhere')
    with pytest.raises(BagError, match='it holds nothing'):
        read_episode(tmp_path)
    (tmp_path / 'bag_0.db3').write_text('SQLite')
    with pytest.raises(BagError, match='it holds bag_0.db3; .*`rosbags-convert --src .*`ros2 bag '
                       'convert -i .*storage_id: mcap'):
        read_episode(tmp_path)
    with pytest.raises(BagError, match='is no MCAP file'):
        read_episode(tmp_path / 'bag_0.db3')


def test_empty_and_foreign_bags(tmp_path):
    make_writer(tmp_path / 'empty').close()
    with pytest.raises(BagError, match='nothing on joint_states: it holds messages of no topic'):
        read_episode(tmp_path / 'empty')

    writer = make_writer(tmp_path / 'short')
    write_run(writer, order=[0])
    writer.close()
    with pytest.raises(BagError, match='has 1 states'):
        read_episode(tmp_path / 'short')

    writer = make_writer(tmp_path / 'arm')
    message = to_joint_state(to_stamp(START), X[0], 0.0)
    message.name = ['shoulder', 'elbow', 'wrist']
    writer.write('/joint_states', serialised(message), START, START)
    writer.close()
    with pytest.raises(BagError, match='not one of this pendulum.*has no cart, joint1; it names'):
        read_episode(tmp_path / 'arm')


def test_several_pendulums_are_refused(tmp_path):
    writer = make_writer(tmp_path / 'bag', '/left')
    for topic in (JOINT_STATES, ROBOT_DESCRIPTION, FORCE_COMMAND):
        writer.add(Recorded(f'/right/{topic.name}', topic.type, schema(topic.type), '', []))
    write_run(writer, '/left')
    write_run(writer, '/right')
    writer.close()
    with pytest.raises(BagError, match='several pendulums.*/left/joint_states.*/right/joint'):
        read_episode(tmp_path / 'bag')


def test_two_runs_in_one_are_refused(tmp_path):
    writer = make_writer(tmp_path / 'bag')
    for x in X[:2]:
        message = to_joint_state(to_stamp(0), x, 0.0)
        writer.write('/joint_states', serialised(message), START, START)
    writer.close()
    with pytest.raises(BagError, match='two states at 0 ns: the plant was reset in lockstep'):
        read_episode(tmp_path / 'bag')


def test_run_of_the_plant_alone(tmp_path):
    writer = make_writer(tmp_path / 'bag')
    description = String(data=urdf(PHYSICAL, LIMITS))
    writer.write('/robot_description', serialised(description), START, START)
    for n in range(3):
        message = to_joint_state(to_stamp(START + n), X[n], 0.0)
        writer.write('/joint_states', serialised(message), START, START)
    writer.close()
    episode = read_episode(tmp_path / 'bag')
    assert (episode.solver, len(episode.ticks.t), episode.ticks.status) == ('', 0, [])


@pytest.mark.parametrize('others, drive', [([], 'velocity'), ([told('plant', {})], 'force')])
def test_the_drive_of_a_rig_that_names_none_is_that_of_its_controller(others, drive, tmp_path):
    """A plant of ours names each but forces."""
    bag = write_bag(swing_up(), tmp_path / 'bag', [
        told('mpc', {'drive': 'velocity', 'links': 2}), *others])
    assert read_episode(bag).physical.drive == drive


def test_forces_that_nobody_gave_are_those_sent_or_changes_of_velocities_sent():
    samples = [Sample(START + n * PERIOD, np.zeros(6), math.nan) for n in range(4)]
    reports = [Report(START + n * PERIOD, 0, '', {'force': sent})
               for n, sent in enumerate((0.5, 0.6, 0.4))]
    nan = math.nan
    for of_velocities, expected in ((False, [nan, 0.5, 0.6, 0.4]), (True, [nan, nan, 2.0, -4.0])):
        found = [sample.force for sample in completed(samples, reports, of_velocities)]
        assert found == pytest.approx(expected, nan_ok=True)


def test_velocities_that_nobody_gave_are_differences():
    """As before the first tick of an mpc, and after its last; angles may wrap."""
    q = np.array([[0.0, 3.1, 0.1], [0.1, -3.1, 0.2], [0.3, -3.0, math.nan], [0.4, -2.9, 0.4]])
    v = np.full((4, 3), math.nan)
    v[1] = 7.0
    found = differenced([Sample(START + n * PERIOD, np.concatenate((q[n], v[n])), 0.0)
                         for n in range(4)])
    of_first = [2.0, (2 * math.pi - 6.2) / 0.05, 2.0]
    assert found[0].x[3:] == pytest.approx(of_first)
    assert found[1].x[3:].tolist() == [7.0] * 3
    assert np.isnan(found[2].x[3:]).all()   # no state at all
    assert found[3].x[3:5] == pytest.approx([2.0, 2.0])
    assert all(np.array_equal(each.x[:3], row, equal_nan=True) for each, row in zip(found, q))
