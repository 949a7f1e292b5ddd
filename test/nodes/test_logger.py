# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The logger as a process, against publishers here and in another process."""

from functools import partial
import os
from pathlib import Path
import re
import resource
import shutil
import signal
import subprocess
import sys
import time

from conftest import wait_until
import numpy as np
from peer import Peer
import pytest
from rclpy.qos import DurabilityPolicy, qos_profile_sensor_data, QoSProfile
from rosbags.highlevel import AnyReader
from std_msgs.msg import Float64, String
import yaml

from dp_swing_ros.bags import read_episode
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.nodes.connections import publish
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.urdf import urdf
from dp_swing_ros.topics import DISTURBANCE, FORCE_COMMAND, ROBOT_DESCRIPTION

NUMBERED = Path(__file__).parents[2] / 'benchmarks' / 'numbered.py'

LOGGER = ('import sys; from dp_swing_ros.nodes.logger import main; '
          'sys.exit(main(["logger", *sys.argv[1:]]))')

# Publishes numbered states and forces at a rate given first, and says how many at the end.
PUBLISHER = """
import sys

import numpy as np
from rclpy.duration import Duration
from std_msgs.msg import Float64, String

from dp_swing_ros.nodes.connections import publish
from dp_swing_ros.nodes.messages import to_joint_state
from dp_swing_ros.nodes.process import ProcessNode, run
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.urdf import urdf
from dp_swing_ros.topics import FORCE_COMMAND, JOINT_STATES, ROBOT_DESCRIPTION


class PublisherNode(ProcessNode):
    def __init__(self):
        super().__init__('publisher')
        self.states, self.forces = publish(self, JOINT_STATES), publish(self, FORCE_COMMAND)
        self.description = publish(self, ROBOT_DESCRIPTION)
        self.description.publish(String(data=urdf(PendulumParameters(), LimitParameters())))
        self.number = 0
        self.create_timer(1 / float(sys.argv[1]), self.tick)

    def tick(self):
        stamp = self.get_clock().now().to_msg()
        self.states.publish(to_joint_state(stamp, np.full(6, self.number), self.number - 1.0))
        self.forces.publish(Float64(data=float(self.number)))
        self.number += 1

    def close(self):
        self.forces.publish(Float64(data=-1.0))
        for topic in self.states, self.forces:   # what it keeps for others ends with it
            topic.wait_for_all_acked(Duration(seconds=10.0))
        print(self.number, flush=True)


kept = ['--ros-args']
for topic in ('joint_states', 'force_command'):
    for policy in ('durability:=transient_local', 'depth:=100000'):
        kept += ['-p', f'qos_overrides./{topic}.publisher.{policy}']
sys.exit(run(PublisherNode, ['publisher', *kept]))
"""


@pytest.fixture
def start(tmp_path):
    """Return a function that starts Python in the temporary folder."""
    processes = []

    def begin(*arguments, **options):
        processes.append(subprocess.Popen(
            [sys.executable, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            text=True, cwd=tmp_path, **options))
        return processes[-1]

    yield begin
    for process in processes:
        process.kill()
        process.communicate()


@pytest.fixture
def log(start_here, tmp_path):
    """Return a function that starts a logger in this process and waits until it is up."""
    return partial(up, start_here, tmp_path)


@pytest.fixture
def log_apart(start_node, tmp_path):
    """Return a function that starts a logger as its user does, to be stopped and killed."""
    return partial(up, start_node, tmp_path)


def up(start, folder, arguments=(), **parameters):
    """Start a logger with these parameters and wait until it is up."""
    logger = start('logger', {'output': str(folder / 'bag'), **parameters}, arguments)
    logger.wait_for('recording to')
    return logger


def wait_for_messages(logger):
    """Wait until a logger has told twice that it wrote many, more than what nodes run with."""
    assert wait_until(lambda: len(re.findall(r'\d\d+ messages written', logger.output())) > 1)


def recorded(bag):
    """Return the messages of a bag by topic, as rosbags reads them; it checks the type hashes."""
    messages = {}
    with AnyReader([bag]) as reader:
        for connection, _, data in reader.messages():
            messages.setdefault(connection.topic, []).append(
                reader.deserialize(data, connection.msgtype))
    return messages


def information(bag):
    """Return what metadata.yaml says."""
    return yaml.safe_load((bag / 'metadata.yaml').read_text())['rosbag2_bagfile_information']


def numbers(messages):
    return [message.data for message in messages]


def test_whole_run_is_in_the_bag(start, log_apart, tmp_path):
    publisher = start('-c', PUBLISHER, '20')
    time.sleep(0.3)  # the logger comes late, as its user does
    logger = log_apart(progress_period=0.5)
    wait_for_messages(logger)
    publisher.terminate()
    assert logger.stop(signal.SIGTERM) == 0
    count = int(publisher.communicate(timeout=20)[0])
    assert count > 5
    assert logger.output().splitlines()[-13:] == [
        f'{tmp_path}/bag: {2 * count + 3} messages', f'  /joint_states: {count} written, 0 lost',
        f'  /force_command: {count + 1} written, 0 lost',
        *(f'  /{name}: 0 written, nobody published it' for name in (
            'acceleration_command', 'velocity_command', 'force_command_stamped',
            'velocity_command_stamped')),
        '  /disturbance: 0 written, nobody published it',
        '  /mpc/plan: 0 written, nobody published it',
        '  /mpc/tries: 0 written, nobody published it',
        '  /diagnostics: 0 written, nobody published it',
        '  /robot_description: 1 written, 0 lost', '  /configuration: 1 written, 0 lost'], \
        logger.output()
    messages = recorded(tmp_path / 'bag')
    assert numbers(messages['/force_command']) == [*range(count), -1]
    episode = read_episode(tmp_path / 'bag')
    assert np.array_equal(episode.X[:, 0], np.arange(count))
    assert np.array_equal(episode.U, np.arange(count - 1))


def test_logger_that_stalls_loses_nothing(start, log_apart, peer, tmp_path):
    """A busy machine, or a debugger, stops it for hundreds of messages."""
    publisher = start('-c', PUBLISHER, '400')
    logger, forces = log_apart(progress_period=0.5), peer.record(FORCE_COMMAND)
    wait_for_messages(logger)
    logger.signal(signal.SIGSTOP)
    assert peer.until(lambda: forces)
    stalled = forces[-1].data
    assert peer.until(lambda: forces[-1].data > stalled + 400)
    logger.signal(signal.SIGCONT)
    publisher.terminate()
    count = int(publisher.communicate(timeout=120)[0])
    assert logger.stop() == 0   # while hundreds wait
    assert not re.search(r', [1-9]\d* lost', logger.output())
    assert len(recorded(tmp_path / 'bag')['/joint_states']) == count


def test_load_at_the_end_is_in_the_bag(start, log, tmp_path):
    start('-c', PUBLISHER, '500')
    logger = log(progress_period=0.5)
    wait_for_messages(logger)
    now = time.time_ns()
    assert logger.stop() == 0
    states = recorded(tmp_path / 'bag')['/joint_states']
    values = [state.position[0] for state in states]
    lost = int(re.search(r'/joint_states: \d+ written, (\d+) lost', logger.output())[1])
    assert lost == values[-1] - values[0] + 1 - len(values) == 0
    last = states[-1].header.stamp
    assert last.sec * 10 ** 9 + last.nanosec > now


def test_kill_costs_what_came_last(start, log_apart, tmp_path):
    """That is a tenth of a second; what it comes to on a machine is on the page of bags."""
    publisher = start(NUMBERED, 'times.npy', '--rate', '20')
    logger = log_apart(topics=['number_0', 'number_1'], progress_period=0.5)
    wait_for_messages(logger)
    time.sleep(3.0)   # of which no chunk is full
    logger.stop(signal.SIGKILL)
    killed = time.time_ns()
    publisher.terminate()
    assert publisher.wait(20) == 0
    times, entries = np.load(tmp_path / 'times.npy'), Bag(tmp_path / 'bag', partial=True).entries
    for n in range(2):
        numbered = [entry.sequence for entry in entries if entry.topic == f'/number_{n}']
        assert numbered == [*range(1, len(numbered) + 1)]
        assert times[len(numbered) - 1, n] > killed - 2e9   # while a busy machine stands still


def test_thousands_of_messages_a_second(start, log_apart, tmp_path):
    start(NUMBERED, 'times.npy', '--rate', '1000', '--topics', '5', '--duration', '2')
    names = [f'number_{n}' for n in range(5)]
    logger = log_apart(topics=names, progress_period=0.5)
    assert wait_until((tmp_path / 'times.npy').exists)
    assert logger.stop() == 0
    count = len(np.load(tmp_path / 'times.npy'))
    assert count > 500   # as many as a busy machine can
    custom = information(tmp_path / 'bag')['custom_data']
    for name in names:
        assert f'/{name}: {count} written, 0 lost' in logger.output()
        assert custom[f'lost:/{name}'] == '0'
    assert {topic: numbers(messages) for topic, messages in recorded(tmp_path / 'bag').items()} \
        == {f'/{name}': [*range(count)] for name in names}


def test_split_bag_is_read_as_one(start, log, tmp_path):
    start('-c', PUBLISHER, '100')
    logger = log(max_bagfile_duration=0.3, progress_period=0.5)
    assert wait_until((tmp_path / 'bag' / 'bag_3.mcap').exists)
    assert logger.stop() == 0
    files = information(tmp_path / 'bag')['files']
    assert len(files) > 2
    assert [file['path'] for file in files] == [f'bag_{n}.mcap' for n in range(len(files))]
    states = [state.position[0] for state in recorded(tmp_path / 'bag')['/joint_states']]
    assert states == [*range(len(states))]
    assert len(read_episode(tmp_path / 'bag').t) == len(states)


def test_full_disk_is_one_line(start, tmp_path):
    def small_disk():
        resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, 50_000))

    start('-c', PUBLISHER, '200')
    logger = start('-c', LOGGER, '--ros-args', '-p', 'output:=bag', '-p',
                   'progress_period:=0.0', preexec_fn=small_disk)
    assert logger.communicate(timeout=60)[1].splitlines()[1:] == [
        "logger: error: cannot write the bag 'bag': File too large; what it holds so far can "
        'be read, and `ros2 run dp_swing_ros recover bag` makes a whole bag of it']
    assert logger.returncode == 2
    episode = read_episode(tmp_path / 'bag')
    assert len(episode.t) > 20
    assert np.array_equal(episode.X[:, 0], np.arange(len(episode.t)))
    assert information(tmp_path / 'bag')['custom_data']['lost:/force_command'] == '0'


def test_folder_that_vanishes_is_one_line(log, tmp_path):
    logger = log()
    shutil.rmtree(tmp_path / 'bag')
    assert logger.wait() == 2
    assert logger.output().splitlines()[1:] == [
        f"logger: error: cannot write the bag '{tmp_path}/bag': it was removed"]


def test_existing_output_is_refused(start_here, tmp_path):
    (tmp_path / 'bag').mkdir()
    logger = start_here('logger', {'output': str(tmp_path / 'bag')})
    assert logger.wait() == 2
    assert logger.complaint() == (
        f"logger: error: '{tmp_path}/bag' exists and is not overwritten; "
        'choose another output or remove it\n')


def test_default_output_is_named_by_the_time(start_here, here, tmp_path):
    logger = start_here('logger')
    logger.wait_for('recording to')
    assert logger.stop() == 0
    bag, = tmp_path.glob('dp_swing_*')
    assert re.fullmatch(r'dp_swing_\d{4}(_\d\d){2}-\d\d(_\d\d){2}', bag.name)
    assert sorted(file.name for file in bag.iterdir()) == [f'{bag.name}_0.mcap', 'metadata.yaml']


def test_any_publisher_is_heard(log, peer, tmp_path):
    logger = log(topics=['best_effort', 'volatile'])
    publishers = [peer.node.create_publisher(Float64, 'best_effort', qos_profile_sensor_data),
                  peer.node.create_publisher(Float64, 'volatile', 10)]
    for publisher in publishers:
        assert peer.until(publisher.get_subscription_count)
        publisher.publish(Float64(data=7.0))
    time.sleep(0.2)
    assert logger.stop() == 0
    messages = recorded(tmp_path / 'bag')
    assert [numbers(messages[topic]) for topic in ('/best_effort', '/volatile')] == [[7], [7]]


def test_another_type_on_a_topic_changes_nothing(start, log_apart, peer, tmp_path):
    start('-c', 'import rclpy; from std_msgs.msg import Float32\n'
          'rclpy.init(); node = rclpy.create_node("stranger")\n'
          f'sends = node.create_publisher(Float32, {DISTURBANCE.name!r}, 10)\n'
          'node.create_timer(0.02, lambda: sends.publish(Float32(data=9.0)))\n'
          'rclpy.spin(node)')
    logger = log_apart()
    logger.wait_for('/disturbance: std_msgs/msg/Float32 is not recorded')
    usual = peer.node.create_publisher(Float64, DISTURBANCE.name, 10)
    assert peer.until(usual.get_subscription_count)
    time.sleep(0.5)   # discovery goes one way at a time
    for value in range(5):
        usual.publish(Float64(data=float(value)))
    time.sleep(0.2)
    assert logger.stop() == 0
    heard = numbers(recorded(tmp_path / 'bag')['/disturbance'])
    assert heard[-1] == 4.0 and set(heard) <= {0.0, 1.0, 2.0, 3.0, 4.0}


def test_publisher_that_keeps_nothing_joins_one_that_does(log, peer, tmp_path):
    first = peer.node.create_publisher(Float64, DISTURBANCE.name, QoSProfile(
        depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    first.publish(Float64(data=1.0))
    logger = log()
    assert peer.until(first.get_subscription_count)
    time.sleep(0.2)
    second = peer.node.create_publisher(
        Float64, DISTURBANCE.name, QoSProfile(depth=10, durability=DurabilityPolicy.VOLATILE))
    assert peer.until(second.get_subscription_count)
    assert peer.until(first.get_subscription_count)
    time.sleep(0.5)   # discovery goes one way at a time: the logger has still to find the second
    second.publish(Float64(data=2.0))
    first.publish(Float64(data=3.0))
    time.sleep(0.2)
    assert logger.stop() == 0
    assert '/disturbance: 3 written, 0 lost' in logger.output()
    assert sorted(numbers(recorded(tmp_path / 'bag')['/disturbance'])) == [1, 2, 3]


def test_what_a_publisher_sent_before_it_was_heard_is_said(log_apart, peer, tmp_path):
    first = peer.node.create_publisher(Float64, DISTURBANCE.name, 10)
    logger = log_apart()
    assert peer.until(first.get_subscription_count)
    first.publish(Float64(data=1.0))
    other = Peer('other')   # which has still to find the logger
    second = other.node.create_publisher(Float64, DISTURBANCE.name, 10)
    for _ in range(20):
        second.publish(Float64(data=-1.0))
    assert other.until(second.get_subscription_count)
    other.spin(1.0)
    second.publish(Float64(data=2.0))
    other.spin(0.2)
    other.close()
    assert logger.stop() == 0
    heard = numbers(recorded(tmp_path / 'bag')['/disturbance'])
    assert heard[0] == 1.0 and heard[-1] == 2.0 and len(heard) < 22
    assert f'/disturbance: {len(heard)} written, 0 lost, {22 - len(heard)} sent before ' \
        in logger.output()


def test_type_that_is_not_installed_is_left_out(start, peer):
    # The definitions are looked for in the installation, which this logger does not find.
    logger = start('-c', f'import sys; sys.prefix = "/nowhere"; {LOGGER}', '--ros-args',
                   '-p', 'output:=bag', '-p', 'topics:=[force_command]',
                   env={**os.environ, 'AMENT_PREFIX_PATH': '/nowhere'})
    publisher = publish(peer.node, FORCE_COMMAND)
    publisher.publish(Float64())
    assert 'recording to' in logger.stderr.readline()
    assert "no definition of 'std_msgs/msg/Float64'" in logger.stderr.readline()
    logger.send_signal(signal.SIGINT)
    assert '/force_command: could not be recorded' in logger.communicate(timeout=120)[0]
    assert logger.returncode == 0


def test_namespace(log, peer):
    description = peer.node.create_publisher(
        String, f'left/{ROBOT_DESCRIPTION.name}',
        QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    description.publish(String(data=urdf(PendulumParameters(), LimitParameters())))
    logger = log(['-r', '__ns:=/left'])
    assert peer.until(description.get_subscription_count)
    time.sleep(0.2)
    assert logger.stop() == 0
    assert '/left/robot_description: 1 written, 0 lost' in logger.output()


def test_topics_that_are_none_are_refused(start_here, tmp_path):
    logger = start_here('logger', {'output': str(tmp_path / 'bag'), 'topics': ['a b']})
    assert logger.wait() == 2
    assert logger.complaint().startswith(
        "logger: error: parameter 'topics' has 'a b', which is no ")
    assert not (tmp_path / 'bag').exists()
