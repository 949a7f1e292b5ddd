# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Replay as a process: to subscribers here, to a logger, and to an mpc that answers anew."""

import re

from made_bags import encoded, LATCHED, START, write_bag
from mcap.records import Channel, Schema
import numpy as np
from one_process import Crew
import pytest
from rclpy.duration import Duration
from rclpy.qos import (
    DurabilityPolicy, LivelinessPolicy, qos_profile_sensor_data, QoSProfile, ReliabilityPolicy)
from real_bags import again
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from std_srvs.srv import Trigger
from virtual import record

from dp_swing_ros.bags import read_episode
from dp_swing_ros.bags.episodes import reports_of, samples_of
from dp_swing_ros.bags.mcap_reader import ChannelInfo
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.errors import BagError
from dp_swing_ros.evaluation.comparison import table
from dp_swing_ros.evaluation.metrics import measure
from dp_swing_ros.messages.fields import nanoseconds
from dp_swing_ros.nodes.logger import LoggerNode
from dp_swing_ros.nodes.mpc import MpcNode
from dp_swing_ros.nodes.replay import publish_again, ReplayNode, stopped
from dp_swing_ros.topics import FORCE_COMMAND

MESSAGES = [(0.0, '/a', 0), (0.05, '/b', 1), (0.3, '/a', 2), (0.3, '/b', 3), (0.7, '/a', 4)]


@pytest.fixture
def replay(start_here):
    """Return a function that starts a replay of a bag."""
    def start(bag, **parameters):
        # it begins once all are found, however long that takes on a busy machine
        return start_here('replay', {'bag': str(bag), 'wait': 60.0, **parameters})
    return start


def hear(peer, topic, qos=1000):
    """Return a list that fills with the numbers of a topic and when they were sent [ns]."""
    heard = []
    peer.node.create_subscription(
        Float64, topic, lambda message, info: heard.append((message.data,
                                                            info['source_timestamp'])), qos)
    return heard


def numbers(heard):
    return [number for number, _ in heard]


def lateness(node):
    """Return how late [s] a message of a replay was at most, as it says."""
    return float(re.search(r'the latest by ([\d.]+) ms', node.output())[1]) / 1e3


def call(peer, name):
    """Call a service of the node; return its success and message."""
    answer = peer.call(Trigger, f'replay/{name}')
    return answer.success, answer.message


def test_messages_come_as_they_were_recorded(peer, start_node, tmp_path):
    heard = hear(peer, '/a'), hear(peer, '/b')
    node = start_node('replay', {'bag': str(write_bag(tmp_path / 'bag', MESSAGES)), 'wait': 60.0})
    assert peer.until(lambda: node.popen.poll() is not None and sum(map(len, heard)) > 4)
    assert node.wait() == 0, node.output()
    assert [numbers(each) for each in heard] == [[0, 2, 4], [1, 3]]
    last = node.output().splitlines()[-3:]
    assert re.fullmatch(rf'{tmp_path}/bag: 5 messages in [\d.]+ s, \d later than 5 ms, '
                        r'the latest by [\d.]+ ms', last[0])
    assert last[1:] == ['  /a: 3', '  /b: 2']
    sent = {number: time / 1e9 for each in heard for number, time in each}
    assert sorted(sent, key=sent.get) == [0, 1, 2, 3, 4]
    # to the ms by Playback's own tests
    assert sent[4] - sent[0] == pytest.approx(0.7, abs=0.3 + lateness(node))


def test_part_of_a_bag_at_another_rate(peer, replay, tmp_path):
    heard = hear(peer, '/a'), hear(peer, '/b')
    node = replay(write_bag(tmp_path / 'bag', MESSAGES), topics=['/a'], start_offset=0.1,
                  playback_duration=0.65, rate=0.5, delay=0.5)
    assert peer.until(lambda: node.ended() and len(heard[0]) > 1)
    assert [numbers(each) for each in heard] == [[2, 4], []]
    (_, first), (_, last) = heard[0]
    assert node.wait() == 0
    # as it was recorded, 0.4
    assert (last - first) / 1e9 == pytest.approx(0.8, abs=0.3 + lateness(node))


@pytest.mark.parametrize('parameters, says', [
    ({'bag': ''}, "parameter 'bag' is empty; expected the folder of a bag to play"),
    ({'bag': 'nowhere'}, "there is no bag 'nowhere'"),
    ({'topics': ['/c']}, 'has nothing on /c; it holds messages of /a, /b'),
    ({'rate': 0.0}, "parameter 'rate' is 0.0; expected at least 0.001"),
    ({'message_order': 'any'}, "parameter 'message_order' is 'any'; expected one of sent, rec"),
    ({'start_offset': 9.0}, 'lasts 0.700 s and has nothing to play from 9 s on'),
    ({'loop': True, 'playback_duration': 0.01}, 'messages of one moment alone to play; a loop'),
    ({'speed': 2.0}, "unknown parameter 'speed' of the node 'replay'")])
def test_what_it_cannot_play_is_one_line(replay, tmp_path, parameters, says):
    write_bag(tmp_path / 'bag', MESSAGES)
    node = replay(**{'bag': tmp_path / 'bag', **parameters})
    assert node.wait() == 2
    assert node.complaint().startswith('replay: error: ') and says in node.complaint()
    assert node.complaint().count('\n') == 1


def test_bag_without_an_end_is_played_if_asked_for(replay, tmp_path):
    file, = write_bag(tmp_path / 'bag', MESSAGES).glob('*.mcap')
    whole = file.read_bytes()
    file.write_bytes(whole[:-20])
    node = replay(tmp_path / 'bag')
    assert node.wait() == 2 and 'but no end' in node.output()
    node = replay(tmp_path / 'bag', partial=True, wait=0.0)
    assert node.wait() == 0 and '5 messages in' in node.output()


def test_services_pause_step_and_resume(peer, replay, tmp_path):
    heard = hear(peer, '/a'), hear(peer, '/b')
    node = replay(write_bag(tmp_path / 'bag', MESSAGES), start_paused=True)
    assert call(peer, 'is_paused') == (True, 'paused')
    assert peer.until(lambda: peer.node.count_publishers('/b'))
    peer.spin(0.5)
    assert heard == ([], [])
    assert call(peer, 'play_next') == (True, '/a')
    assert call(peer, 'play_next') == (True, '/b')
    assert peer.until(lambda: heard[1])
    assert [numbers(each) for each in heard] == [[0], [1]]
    assert call(peer, 'toggle_paused') == (True, 'playing')
    assert call(peer, 'play_next') == (False, 'not paused; call replay/pause first')
    assert call(peer, 'is_paused') == (False, 'playing')
    assert peer.until(lambda: node.ended() and sum(map(len, heard)) > 4)
    assert node.wait() == 0
    assert [numbers(each) for each in heard] == [[0, 2, 4], [1, 3]]


def test_a_pause_holds_everything(peer, replay, tmp_path):
    heard = hear(peer, '/a')
    # long enough for calls on a busy machine
    node = replay(write_bag(tmp_path / 'bag', [(n / 20, '/a', n) for n in range(6000)]))
    assert peer.until(lambda: len(heard) > 3)
    assert call(peer, 'pause') == (True, 'paused')

    def is_quiet(count):   # what was sent before has come
        peer.spin(0.2)
        return len(heard) == count
    assert peer.until(lambda: is_quiet(len(heard)))
    count = len(heard)
    peer.spin(0.5)
    assert len(heard) == count
    assert call(peer, 'resume') == (True, 'playing')
    assert peer.until(lambda: len(heard) > count + 20)
    assert node.stop() == 0
    assert numbers(heard) == list(range(len(heard)))


def test_a_loop_ends_with_a_signal(peer, replay, tmp_path):
    heard = hear(peer, '/a')
    node = replay(write_bag(tmp_path / 'bag', MESSAGES), topics=['/a'], loop=True, rate=10.0)
    assert peer.until(lambda: len(heard) > 7)
    assert node.stop() == 0
    assert numbers(heard)[:7] == [0, 2, 4, 0, 2, 4, 0]
    assert 'Traceback' not in node.output()


def test_clock_tells_the_time_of_every_message(peer, replay, tmp_path):
    times = []
    peer.node.create_subscription(
        Clock, '/clock', lambda message: times.append(nanoseconds(message.clock)), 100)
    hear(peer, '/a')
    node = replay(write_bag(tmp_path / 'bag', MESSAGES), clock=50.0, rate=0.05)
    assert peer.until(lambda: node.ended() and times[-1] == START + 700_000_000)
    assert node.wait() == 0
    assert times == sorted(times)
    assert {START + round(time * 1e9) for time, *_ in MESSAGES} <= set(times)
    assert len(set(times)) > 20


def test_the_clock_of_a_bag_gives_way_to_that_of_replay(peer, replay, tmp_path):
    times = []
    peer.node.create_subscription(
        Clock, '/clock', lambda message: times.append(nanoseconds(message.clock)), 100)
    hear(peer, '/a')
    node = replay(write_bag(tmp_path / 'bag', [*MESSAGES, *(
        (n / 10, '/clock', n) for n in range(7))]), clock=50.0)
    assert node.wait() == 0
    assert peer.until(lambda: times)
    peer.spin(0.2)
    assert times == sorted(times) and times[0] >= START
    assert '/clock of the bag is left out' in node.output()


def test_late_subscriber_gets_what_was_latched(peer, replay, tmp_path):
    messages = [(0.0, '/latched', 5), (0.1, '/latched', 6), (30.0, '/latched', 7)]
    node = replay(write_bag(tmp_path / 'bag', messages, LATCHED), wait=0.0)
    node.wait_for('3 messages over 30.000 s')
    peer.spin(0.5)
    heard = hear(peer, '/latched', QoSProfile(
        depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    assert peer.until(lambda: len(heard) == 2)
    assert numbers(heard) == [5, 6]
    assert node.stop() == 0


@pytest.mark.parametrize('ends, expected', [([3.0, -2.0], [3.0, -2.0, 0.0]), ([3.0, 0.0], None)])
def test_a_stream_of_commands_ends_with_zero(peer, replay, tmp_path, ends, expected):
    heard = hear(peer, '/force_command', 10)
    messages = [(n / 10, '/force_command', force) for n, force in enumerate(ends)]
    node = replay(write_bag(tmp_path / 'bag', [*messages, (30.0, '/force_command', 1.0)]))
    assert peer.until(lambda: len(heard) == 2)
    assert node.stop() == 0
    peer.spin(0.3)
    assert peer.until(lambda: numbers(heard) == (expected or ends))


@pytest.mark.parametrize('last', [Float64(data=2.0), JointState(
    name=['cart'], effort=[4.0]), JointState(name=['cart'], velocity=[-0.5])])
def test_a_command_is_followed_by_the_same_that_is_zero(last):
    end = stopped(last)
    assert type(end) is type(last) and stopped(end) is None
    if isinstance(last, JointState):
        assert (end.name, len(end.effort), len(end.velocity)) == (
            last.name, len(last.effort), len(last.velocity))


QOS = """
- {reliability: best_effort, durability: volatile, depth: 3, liveliness: manual_by_topic,
   deadline: {sec: 2, nsec: 0}}
- {reliability: 1, durability: 1, depth: 2000, liveliness: automatic,
   deadline: {sec: 0, nsec: 500000000}}
"""


def channel(kind, encoding, qos):
    """Return a channel as a bag has it."""
    return ChannelInfo(Channel(1, '/a', encoding, {'offered_qos_profiles': qos}, 1),
                       Schema(1, b'', 'ros2msg', kind))


def test_each_old_subscriber_is_satisfied(peer):
    offered = publish_again(peer.node, '/a', channel('std_msgs/msg/Float64', 'cdr', QOS))
    heard = [hear(peer, '/a', profile) for profile in (
        qos_profile_sensor_data, QoSProfile(
            depth=1, reliability=ReliabilityPolicy.RELIABLE, deadline=Duration(seconds=1),
            durability=DurabilityPolicy.TRANSIENT_LOCAL,
            liveliness=LivelinessPolicy.MANUAL_BY_TOPIC))]
    assert peer.until(lambda: offered.get_subscription_count() == 2)
    offered.publish(encoded(4.0))
    assert peer.until(lambda: all(heard))
    assert [numbers(each) for each in heard] == [[4.0], [4.0]]
    assert offered.qos_profile.depth == 2000


@pytest.mark.parametrize('what, reason', [
    (channel('std_msgs/msg/Float64', 'json', ''), "it is encoded as 'json'"),
    (channel('nobody_msgs/msg/Thing', 'cdr', ''), "No module named 'nobody_msgs'"),
    (channel('std_msgs/msg/Thing', 'cdr', ''), "no attribute 'Thing'"),
    (channel('', 'cdr', ''), 'cannot be published'),
    (channel('std_msgs/msg/Float64', 'cdr', '['), "its quality of service is '\\['"),
    (channel('std_msgs/msg/Float64', 'cdr', '[{reliability: some}]'), 'SOME')])
def test_what_cannot_be_published_is_told(peer, what, reason):
    with pytest.raises(BagError, match=reason):
        publish_again(peer.node, '/a', what)


def answered(bag, folder, mpc=(), **parameters):
    """Let an mpc answer what is replayed of a bag, and return the bag that a logger recorded."""
    folder.mkdir()
    with Crew(folder / 'nodes.yaml', {
            'logger': {'output': str(folder / 'bag'), 'progress_period': 0.0}, 'mpc': dict(mpc),
            'replay': {'bag': str(bag), 'topics': ['/joint_states'], **parameters}}) as crew:
        logger, mpc, replay = map(crew.start, (LoggerNode, MpcNode, ReplayNode))
        assert crew.until(lambda: replay.began is not None)
        while replay.paused and not replay.done:   # so that a state waits for its answer
            before = mpc.core.forces
            replay.play_next()
            assert crew.until(lambda: mpc.core.forces > before)
        assert crew.until(lambda: replay.done)
        crew.end(replay)
        crew.until(mpc.silence.is_canceled, 1.0)
        crew.end(mpc)
        logger.close()
    return Bag(folder / 'bag')


def forces(bag):
    return [message.data for message in bag.of(FORCE_COMMAND)]


def test_mpc_gives_the_recorded_forces_to_the_bit(lockstep_bag, tmp_path):
    states = set()

    def once(entry):   # for a plant in lockstep says it again to who subscribes anew
        is_new = entry.topic != '/joint_states' or entry.stored not in states
        states.add(entry.stored)
        return [entry] * is_new

    original = Bag(again(lockstep_bag, tmp_path / 'bag', once))
    anew = answered(original.path, tmp_path / 'anew', {'clock': 'lockstep'}, start_paused=True)
    assert len(samples_of(anew)) == len(samples_of(original))
    assert forces(anew) == forces(original)
    assert [report.values['cost'] for report in reports_of(anew)] == [
        report.values['cost'] for report in reports_of(original)]


def test_analysis_of_a_bag_recorded_again_is_the_same(lockstep_bag, tmp_path):
    with Crew(tmp_path / 'nodes.yaml', {
            'logger': {'output': str(tmp_path / 'again'), 'progress_period': 0.0},
            'replay': {'bag': str(lockstep_bag), 'rate': 5.0}}) as crew:
        logger, replay = map(crew.start, (LoggerNode, ReplayNode))
        assert crew.until(lambda: replay.done)
        crew.end(replay)
        crew.until(lambda: False, 0.5)   # until all is heard
        logger.close()
    first, second = (table({'': measure(read_episode(bag))})
                     for bag in (lockstep_bag, tmp_path / 'again'))
    assert first == second


def test_mpc_by_the_clock_of_a_bag_treats_it_as_live(tmp_path, rng):
    bag = record(tmp_path / 'live', 2.0, rng, initial_state=[0.1, 0.0, 0.0, 0.0, 0.0, 0.0])
    # it drives nothing here, so what it would learn of the drive is not of its own forces
    known = {f'ekf.{name}': 0.0 for name in ('force_bias', 'gain_error', 'delay_error',
                                             'lag_error')}
    # slowly, so that a busy machine answers many
    anew = answered(bag, tmp_path / 'anew', {'use_sim_time': True, **known}, clock=100.0,
                    rate=0.1)
    live, new = ({report.stamp: report.values for report in reports_of(each)
                  if report.values['carried'] == 0} for each in (Bag(bag), anew))
    assert all(values['real_time'] == 1 for values in new.values())
    assert 0 < np.median([values['delay'] for values in new.values()]) < 60.0
    common = sorted(live.keys() & new.keys())
    assert len(common) > 10
    # how near its forces are to the live ones is a matter of the delays, and so of the machine
    assert 0 < max(abs(new[stamp]['force']) for stamp in common) <= 20.0


def test_a_signal_before_the_first_message_ends_it(replay, lockstep_bag):
    node = replay(lockstep_bag)
    node.wait_for('messages over')
    assert node.stop() == 0
    assert 'Traceback' not in node.output()
