# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The logger as a process, against publishers here and in another process."""

from functools import partial
import re
import resource
import shutil
import signal
import subprocess
import sys
import time

from conftest import PATIENCE
from numbered import KEPT
import numpy as np
from peer import Peer
import pytest
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, qos_profile_sensor_data, QoSProfile
from rosbags.highlevel import AnyReader
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String
import yaml

from dp_swing_ros.bags import read_episode
from dp_swing_ros.nodes.connections import publish
from dp_swing_ros.nodes.messages import to_joint_state
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.urdf import urdf
from dp_swing_ros.topics import DISTURBANCE, FORCE_COMMAND, JOINT_STATES, ROBOT_DESCRIPTION

DESCRIPTION = urdf(PendulumParameters(), LimitParameters())

LOGGER = ('import sys; from dp_swing_ros.nodes.logger import main; '
          'sys.exit(main(["logger", *sys.argv[1:]]))')


class Publisher:
    """Publishes numbered states and forces at a rate [1/s], while its peer spins."""

    def __init__(self, peer, rate):
        self.number, self.clock = 0, peer.node.get_clock()
        self.states = peer.node.create_publisher(JointState, JOINT_STATES.name, KEPT)
        self.forces = peer.node.create_publisher(Float64, FORCE_COMMAND.name, KEPT)
        publish(peer.node, ROBOT_DESCRIPTION).publish(String(data=DESCRIPTION))
        peer.node.create_timer(1 / rate, self.tick)

    def tick(self):
        stamp = self.clock.now().to_msg()
        self.states.publish(to_joint_state(stamp, np.full(6, self.number), self.number - 1.0))
        self.forces.publish(Float64(data=float(self.number)))
        self.number += 1

    def end(self):
        """Send a last force, and wait until all is heard; return how many there were before."""
        self.forces.publish(Float64(data=-1.0))
        for topic in self.states, self.forces:
            assert topic.wait_for_all_acked(Duration(seconds=PATIENCE))
        return self.number


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


def told_of_many(logger):
    """Return whether a logger has told twice that it wrote many, more than what nodes run with."""
    return len(re.findall(r'\d\d+ messages written', logger.output())) > 1


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


def test_whole_run_is_in_the_bag_though_the_logger_stalls(log_apart, peer, tmp_path):
    """A busy machine, or a debugger, stops it for hundreds of messages."""
    publisher = Publisher(peer, 400)
    peer.spin(0.3)  # the logger comes late, as its user does
    logger, forces = log_apart(progress_period=0.5), peer.record(FORCE_COMMAND)
    assert peer.until(lambda: told_of_many(logger))
    logger.signal(signal.SIGSTOP)
    assert peer.until(lambda: forces)
    stalled = forces[-1].data
    assert peer.until(lambda: forces[-1].data > stalled + 400)
    logger.signal(signal.SIGCONT)
    count = publisher.end()
    assert logger.stop(signal.SIGTERM) == 0   # while hundreds wait
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
    assert len(messages['/joint_states']) == count
    assert numbers(messages['/force_command']) == [*range(count), -1]
    episode = read_episode(tmp_path / 'bag')
    assert np.array_equal(episode.X[:, 0], np.arange(count))
    assert np.array_equal(episode.U, np.arange(count - 1))


def test_a_split_bag_is_read_as_one_and_has_what_comes_at_its_end(log, peer, tmp_path):
    publisher = Publisher(peer, 500)
    logger = log(max_bagfile_duration=0.3, progress_period=0.5)
    assert peer.until(lambda: told_of_many(logger) and (tmp_path / 'bag' / 'bag_3.mcap').exists())
    now = time.time_ns()
    for _ in range(100):   # some of which wait
        publisher.tick()
    logger.ask_to_end()
    assert logger.wait() == 0
    files = information(tmp_path / 'bag')['files']
    assert [file['path'] for file in files] == [f'bag_{n}.mcap' for n in range(len(files))]
    states = recorded(tmp_path / 'bag')['/joint_states']
    assert [state.position[0] for state in states] == [*range(publisher.number)]
    assert f'/joint_states: {len(states)} written, 0 lost' in logger.output()
    last = states[-1].header.stamp
    assert last.sec * 10 ** 9 + last.nanosec > now
    assert len(read_episode(tmp_path / 'bag').t) == len(states)


def test_full_disk_is_one_line(start, peer, tmp_path):
    def small_disk():
        resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, 50_000))

    Publisher(peer, 200)
    logger = start('-c', LOGGER, '--ros-args', '-p', 'output:=bag', '-p',
                   'progress_period:=0.0', preexec_fn=small_disk)
    assert peer.until(lambda: logger.poll() is not None)
    assert logger.communicate()[1].splitlines()[1:] == [
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


def test_another_type_on_a_topic_changes_nothing(start, log, peer, tmp_path):
    start('-c', 'import rclpy; from std_msgs.msg import Float32\n'
          'rclpy.init(); node = rclpy.create_node("stranger")\n'
          f'sends = node.create_publisher(Float32, {DISTURBANCE.name!r}, 10)\n'
          'node.create_timer(0.02, lambda: sends.publish(Float32(data=9.0)))\n'
          'rclpy.spin(node)')
    logger = log()
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
    assert first.wait_for_all_acked(Duration(seconds=PATIENCE))
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
    assert first.wait_for_all_acked(Duration(seconds=PATIENCE))
    logger.signal(signal.SIGSTOP)   # so that another has still to find it
    other = Peer('other')
    second = other.node.create_publisher(Float64, DISTURBANCE.name, 10)
    for _ in range(20):
        second.publish(Float64(data=-1.0))
    logger.signal(signal.SIGCONT)
    assert other.until(second.get_subscription_count)
    other.spin(1.0)
    second.publish(Float64(data=2.0))
    assert second.wait_for_all_acked(Duration(seconds=PATIENCE))
    other.close()
    assert logger.stop() == 0
    heard = numbers(recorded(tmp_path / 'bag')['/disturbance'])
    assert heard[0] == 1.0 and heard[-1] == 2.0 and len(heard) < 22
    assert f'/disturbance: {len(heard)} written, 0 lost, {22 - len(heard)} sent before ' \
        in logger.output()


def test_type_that_is_not_installed_is_left_out(log, peer, monkeypatch):
    # The definitions are looked for in the installation, which this logger does not find.
    monkeypatch.setattr(sys, 'prefix', '/nowhere')
    monkeypatch.setenv('AMENT_PREFIX_PATH', '/nowhere')
    logger = log(topics=['force_command'])
    publish(peer.node, FORCE_COMMAND).publish(Float64())
    logger.wait_for("no definition of 'std_msgs/msg/Float64'")
    assert logger.stop() == 0
    assert '/force_command: could not be recorded' in logger.output()


def test_namespace(log, peer):
    description = peer.node.create_publisher(
        String, f'left/{ROBOT_DESCRIPTION.name}',
        QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    description.publish(String(data=DESCRIPTION))
    logger = log(['-r', '__ns:=/left'])
    assert peer.until(description.get_subscription_count)
    assert description.wait_for_all_acked(Duration(seconds=PATIENCE))
    assert logger.stop() == 0
    assert '/left/robot_description: 1 written, 0 lost' in logger.output()


def test_topics_that_are_none_are_refused(start_here, tmp_path):
    logger = start_here('logger', {'output': str(tmp_path / 'bag'), 'topics': ['a b']})
    assert logger.wait() == 2
    assert logger.complaint().startswith(
        "logger: error: parameter 'topics' has 'a b', which is no ")
    assert not (tmp_path / 'bag').exists()
