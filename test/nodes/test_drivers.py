# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The mpc beside drivers of all kinds: bare rclpy publishers and subscriptions."""

from contextlib import contextmanager
from pathlib import Path
import re
import shlex
import signal
import subprocess
import sys
import time

from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
from one_process import Crew
from peer import Member, Peer
import pytest
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from std_srvs.srv import SetBool

from dp_swing_ros.bags import read_episode
from dp_swing_ros.messages.fields import from_diagnostics, nanoseconds, to_state
from dp_swing_ros.nodes.logger import LoggerNode
from dp_swing_ros.nodes.messages import to_joint_state, to_stamp
from dp_swing_ros.nodes.mpc import MpcNode
from dp_swing_ros.nodes.plant import PlantNode
from dp_swing_ros.pendulum.state import is_upright, to_turn_of
from dp_swing_ros.simulation import plants
from dp_swing_ros.tools import analyse, verify
from dp_swing_ros.tools.demo import keeping
from dp_swing_ros.topics import (
    DIAGNOSTICS, FORCE_COMMAND, FORCE_COMMAND_STAMPED, JOINT_STATES)

LEANING = np.array([0.1, 0.02, -0.01, 0.0, 0.05, 0.0])
PERIOD = 0.05   # [s] of the driver's states
ANSWER = 60.0   # [s] at most, in lockstep

# in a process of its own: where one has a topic twice, by two types, FastDDS may crash at its end
OTHER = """
import rclpy
from rclpy.node import Node
from std_msgs.msg import Float32
rclpy.init()
node = Node('other')
node.create_subscription(Float32, 'force_command', lambda message: None, 10)
rclpy.spin(node)
"""


class Driver:
    """Publishes states by a clock of its own, and hears forces; shares no profile with the mpc."""

    def __init__(self, peer, states=10, forces=10):
        self.peer, self.node = peer, peer.node
        self.states = self.node.create_publisher(JointState, 'joint_states', states)
        self.forces, self.stamped, self.reports = [], [], peer.record(DIAGNOSTICS)
        self.node.create_subscription(Float64, 'force_command', self.forces.append, forces)
        self.node.create_subscription(
            JointState, 'force_command_stamped', self.stamped.append, forces)
        self.n = 0

    def meet(self, lockstep=False):
        """Wait until the mpc hears the states, all of them in lockstep, and is heard."""
        counted = self.node.count_publishers
        assert self.peer.until(lambda: self.states.get_subscription_count() and counted(
            'force_command') and counted('force_command_stamped'))
        if lockstep:
            assert self.peer.until(lambda: self.peer.reliability() == ['RELIABLE'])
        self.peer.meet('mpc')

    def send(self, stamp):
        """Publish a state that differs from the one before."""
        self.n += 1
        self.states.publish(to_joint_state(to_stamp(stamp), LEANING * (1 + 1e-3 * self.n), 0.0))

    def stream(self, count, stamp):
        """Publish states at a steady pace; stamp(now) returns that of each, times in [ns]."""
        for _ in range(count):
            self.send(stamp(time.time_ns()))
            self.peer.spin(PERIOD)

    def ticks(self):
        """Return the mpc's reports on states."""
        found = [from_diagnostics(each, 'mpc') for each in self.reports]
        return [each for each in found if each is not None and not each.values['carried']]

    def topics(self):
        """Return the last report on the mpc's topics, if there is one."""
        found = [from_diagnostics(each, 'mpc: topics') for each in self.reports]
        return next((each for each in reversed(found) if each is not None), None)


class Rig(Driver):
    """A pendulum with names, signs, zeros and relative angles of its own, and no velocities."""

    SIGNS, OFFSETS = np.array([1.0, -1.0, 1.0]), np.array([-0.2, 2.5, 0.7])
    PARAMETERS = {'joint_names': ['slide', 'hip', 'knee'], 'joint_signs': SIGNS.tolist(),
                  'joint_offsets': OFFSETS.tolist(), 'relative_angles': True}

    def measure(self, stamp, x):
        """Publish what its encoders measure of a state, as they wrap."""
        slide, hip, knee = self.OFFSETS + self.SIGNS * (x[0], x[1], x[2] - x[1])
        joints = {'lift': 9.0, 'knee': knee % (2 * np.pi), 'slide': slide,
                  'joint3': 7.0, 'hip': hip % (2 * np.pi)}
        message = JointState(name=list(joints), position=list(joints.values()))
        message.header.stamp = to_stamp(stamp)
        self.states.publish(message)
        self.n += 1

    def swing(self, plant, count, now=time.time_ns, paced=True):
        """Let a plant obey the forces, in real time if it is paced; return its states."""
        states, began = [], time.monotonic()
        for n in range(count):
            before = len(self.forces)
            self.measure(now(), plant.x)
            states.append(plant.x.copy())
            self.peer.until(lambda: len(self.forces) > before, PERIOD if paced else ANSWER)
            plant.begin_period(0.0)
            if self.forces:
                plant.obey(self.forces[-1].data)
            plant.advance(PERIOD)
            if paced:
                self.peer.spin(began + (n + 1) * PERIOD - time.monotonic())
        return np.array(states)


@contextmanager
def recorded(bag, parameters):
    """Yield a peer beside an mpc, which a logger records, and the mpc."""
    with Crew(bag.with_name('nodes.yaml'), {
            'logger': {'output': str(bag), 'progress_period': 0.0},
            'mpc': {**parameters, **keeping(FORCE_COMMAND, DIAGNOSTICS)}}) as crew:
        logger, mpc = map(crew.start, (LoggerNode, MpcNode))
        peer = Member(crew)
        yield peer, mpc
        crew.end(mpc)
        peer.spin(0.5)   # until all is heard
        logger.close()


def best_effort(depth=10):
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)


@pytest.mark.parametrize('first, reliability, durability', [
    ('mpc', 'BEST_EFFORT', 'TRANSIENT_LOCAL'), ('driver', 'RELIABLE', 'VOLATILE')])
def test_every_kind_of_publisher_is_heard(peer, start_here, first, reliability, durability):
    if first == 'mpc':
        start_here('mpc').wait_for('ready')
    driver = Driver(peer, QoSProfile(depth=1, reliability=ReliabilityPolicy[reliability],
                                     durability=DurabilityPolicy[durability]), best_effort())
    if first == 'driver':
        peer.spin(0.5)
        start_here('mpc').wait_for('ready')
    driver.meet()
    driver.send(0)
    assert peer.until(lambda: driver.forces and driver.stamped)
    assert driver.topics() is None


def test_the_stamped_command_has_the_stamp_of_the_state_that_it_answers(peer, start_here):
    node = start_here('mpc', {'clock': 'lockstep'})
    node.wait_for('ready')
    driver = Driver(peer)
    driver.meet(lockstep=True)   # with the default quality of service
    for stamp in (7, 1_000_000_007, 2_050_000_003):
        driver.send(stamp)
        assert peer.until(lambda: len(driver.stamped) == driver.n)
        last = driver.stamped[-1]
        assert (nanoseconds(last.header.stamp), last.name) == (stamp, ['cart'])
        assert not last.position and not last.velocity
        assert peer.until(lambda: len(driver.forces) == driver.n)
        assert list(last.effort) == [driver.forces[-1].data]
    assert driver.forces[-1].data != 0.0
    node.stop()
    assert peer.until(lambda: len(driver.stamped) == len(driver.forces) == driver.n + 1)
    assert driver.stamped[-1].effort[0] == driver.forces[-1].data == 0.0
    assert nanoseconds(driver.stamped[-1].header.stamp) == stamp


@contextmanager
def subscribed(profile):
    """Let another node subscribe to the forces meanwhile."""
    other = Peer('other')
    other.node.create_subscription(Float64, 'force_command', print, profile)
    yield
    other.close()


@contextmanager
def subscribed_by_another_type():
    with subprocess.Popen([sys.executable, '-c', OTHER], stderr=subprocess.DEVNULL) as process:
        try:
            yield
        finally:
            process.send_signal(signal.SIGINT)


def test_a_partner_that_hears_nothing_is_an_error_in_log_and_diagnostics(peer, start_here):
    node = start_here('mpc')
    node.wait_for('ready')
    driver = Driver(peer)
    for partner, words in (
            (subscribed(QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)),
             'durability volatile is offered, transient_local is asked for; change that of '
             '/other, or set qos_overrides./force_command.publisher.durability of /mpc'),
            (subscribed(QoSProfile(depth=1, deadline=Duration(seconds=0.1))),
             'deadline 0.25 s is offered, 0.1 s is asked for; change that of /other, or set '
             'qos_overrides./force_command.publisher.deadline of /mpc'),
            (subscribed_by_another_type(), 'std_msgs/msg/Float64 is sent, std_msgs/msg/Float32 '
             'expected; change that of /other')):
        text = f'/force_command from /mpc to /other: {words}'
        with partner:
            assert peer.until(lambda: driver.topics() and text in driver.topics().message)
            assert driver.topics().level == DiagnosticStatus.ERROR[0]
            peer.spin(2.5)   # some looks more
            assert node.output().count(text) == 1
        assert peer.until(lambda: driver.topics().level == DiagnosticStatus.OK[0])


def test_who_cannot_hear_the_states_does_not_keep_a_lockstep_waiting_and_is_named(
        tmp_path, capfd):
    """It hears none of them, whenever it comes."""
    with Crew(tmp_path / 'nodes.yaml', {'plant': {'lockstep': True}}) as crew:
        peer = Member(crew)
        peer.node.create_subscription(
            JointState, 'joint_states', lambda message: None,
            QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
        forces, stamped = peer.record(FORCE_COMMAND), peer.record(FORCE_COMMAND_STAMPED)
        crew.start(MpcNode)
        crew.start(PlantNode)
        said = []
        assert peer.until(lambda: said.append(capfd.readouterr().err) or (
            'set qos_overrides./joint_states.publisher.durability of /plant' in ''.join(said)))
        assert peer.until(lambda: len(forces) == len(stamped) >= 20)


@pytest.mark.parametrize(('zero', 'now'), [('hanging', time.time_ns), ('given', lambda: 0)])
def test_the_bag_of_a_foreign_rig_is_read_as_the_mpc_read_it(
        tmp_path, capsys, monkeypatch, zero, now):
    monkeypatch.setattr(analyse, 'PICTURES', {})
    parameters = {**Rig.PARAMETERS, 'zero': zero}
    if zero == 'hanging':
        parameters['joint_offsets'] = [*Rig.PARAMETERS['joint_offsets'][:1], 0.0, 0.0]
    with recorded(tmp_path / 'bag', parameters) as (peer, _):
        rig, plant = Rig(peer), plants.plant({})
        rig.meet()
        states = [*rig.swing(plant, 28, now)]
        # on a busy machine it takes longer to see that it hangs still
        assert peer.until(lambda: rig.forces or states.extend(rig.swing(plant, 4, now)))
        states += [*rig.swing(plant, 12, now)]
    assert verify.main([str(tmp_path / 'bag')]) == 0, ''.join(capsys.readouterr())
    episode = read_episode(tmp_path / 'bag')
    states = np.array(states)
    np.testing.assert_allclose(to_turn_of(episode.X, states)[:, :3], states[:, :3], atol=1e-9)
    assert np.isfinite(episode.X[-10:]).all()   # velocities are estimates
    assert set(episode.U[-10:]) <= {force.data for force in rig.forces}
    assert analyse.main([str(tmp_path / 'bag'), '--no-animation']) == 0


def test_a_gripper_on_the_same_topic_changes_nothing(peer, start_here):
    node = start_here('mpc', {'clock': 'stamps'})
    node.wait_for('ready')
    driver, other = Driver(peer), Peer('gripper')
    gripper, fingers = other.publisher(JOINT_STATES), JointState(
        name=['left_finger', 'right_finger'], position=[0.0, 0.0])
    driver.meet()
    other.meet('mpc')
    stamps = []
    for _ in range(30):
        gripper.publish(fingers)
        stamps.append(time.time_ns())
        driver.send(stamps[-1])
        peer.spin(PERIOD)
    assert peer.until(lambda: driver.ticks() and driver.ticks()[-1].stamp == stamps[-1])
    ticks = driver.ticks()
    assert len({each.stamp for each in ticks}) == len(ticks)
    assert len(ticks) + ticks[-1].values['missed_total'] <= 30
    assert not any('joint' in each.message for each in ticks)
    assert node.output().count('names none of [cart, joint1, joint2]') == 1
    # a look at the topics may come before it is heard
    assert peer.until(
        lambda: driver.topics() is None or driver.topics().level == DiagnosticStatus.OK[0])
    other.close()


def test_a_second_publisher_of_our_joints_is_named_and_the_first_is_obeyed(
        peer, start_here, monkeypatch):
    """As joint_state_publisher, whose joints are all zero."""
    monkeypatch.setattr('dp_swing_ros.messages.states.SILENCE', 60.0)   # of a busy machine
    node = start_here('mpc', {'clock': 'stamps'})
    node.wait_for('ready')
    driver, other = Driver(peer), Peer('joint_state_publisher')
    driver.meet()
    stamps = []
    driver.stream(5, lambda now: stamps.append(now) or now)
    zeros = other.publisher(JOINT_STATES)
    other.meet('mpc')
    assert peer.until(lambda: peer.node.count_publishers('joint_states') == 2)
    for _ in range(30):
        stamps.append(time.time_ns())
        driver.send(stamps[-1])
        zeros.publish(to_joint_state(to_stamp(time.time_ns()), np.zeros(6), 0.0))
        peer.spin(PERIOD)
    # whose name may be discovered after its states: the topics name both
    words = ' publishes states, too; /peer was heard first, and is obeyed'
    node.wait_for(words)
    assert node.output().count(words) == 1
    assert re.search(f'(/joint_state_publisher|a publisher){words}', node.output())
    node.wait_for('/joint_states has 2 publishers, /joint_state_publisher, /peer; expected one')
    assert peer.until(lambda: driver.topics() and driver.topics().message == (
        '/joint_states has 2 publishers, /joint_state_publisher, /peer; expected one; /peer, '
        'heard first, is obeyed'))
    assert driver.topics().level == DiagnosticStatus.WARN[0]
    assert {each.stamp for each in driver.ticks()} <= {*stamps}
    other.close()


def test_bytes_that_are_no_state_end_nothing(peer, start_here):
    node = start_here('mpc', {'clock': 'lockstep'})
    node.wait_for('ready')
    driver = Driver(peer)
    driver.meet()
    for data in (b'', b'\x00\x01\x00\x00', b'\x00\x01\x00\x00' + b'\xff' * 40):
        driver.states.publish(data)
    # the mpc hears with best effort: one alone may be lost
    assert peer.until(lambda: driver.stream(1, lambda now: 0) or driver.forces)
    assert not node.ended()


def test_the_guide_leads_from_a_bare_machine_to_a_held_pendulum(
        peer, start_node, here, monkeypatch):
    """The commands of docs/rig.md, but faster, and enabled by a call."""
    monkeypatch.setattr(analyse, 'PICTURES', {})
    top = Path(__file__).parents[2]
    guide = (top / 'docs' / 'rig.md').read_text().split('\n## ')[2]
    assert guide.startswith('From a bare machine')
    commands = {words[0]: words[1:] for words in map(shlex.split, re.findall(
        r'^ +ros2 run dp_swing_ros (.*)$', guide, re.M))}
    assert list(commands) == ['plant', 'mpc', 'logger', 'analyse']
    assert 'ros2 service call /mpc/enable std_srvs/srv/SetBool "{data: true}"' in guide
    states = peer.record(JOINT_STATES)

    def start(name, *arguments):
        given = [word.replace('config/', f'{top}/config/') for word in commands[name]]
        return start_node(name, arguments=[*given, *arguments])
    start('plant', '-p', 'pace:=10.0')
    start('mpc').wait_for('ready')
    logger = start('logger')
    logger.wait_for('recording to')
    assert peer.call(SetBool, 'mpc/enable', data=True).success
    assert peer.until(lambda: len(states) > 60 and all(
        is_upright(to_state(each, 2)) for each in states[-60:]))   # 3 s
    assert logger.stop() == 0
    assert analyse.main([*commands['analyse'], '--no-animation']) == 0
    run = read_episode(commands['analyse'][0])
    assert all(is_upright(run.errors[-20:]))
