# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The controller as a node: one force for every state, whatever the state."""

import math
import signal

from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
from one_process import Crew
from peer import Member
import pytest
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger

from dp_swing_ros.control import controllers
from dp_swing_ros.messages.configuration import Configuration
from dp_swing_ros.messages.fields import from_diagnostics, from_trajectory, seconds
from dp_swing_ros.nodes.messages import to_joint_state, to_stamp
from dp_swing_ros.nodes.mpc import MpcNode
from dp_swing_ros.nodes.plant import PlantNode
from dp_swing_ros.pendulum.model import rollout
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import hanging
from dp_swing_ros.topics import (
    CONFIGURATION, DIAGNOSTICS, FORCE_COMMAND, FORCE_COMMAND_STAMPED, JOINT_STATES, PLAN, TRIES)

LEANING = np.array([0.1, 0.02, -0.01, 0.0, 0.05, 0.0])


class Conversation:
    """Sends states to an mpc in simulated time, and hears what it answers."""

    def __init__(self, peer, start, parameters=(), arguments=()):
        self.peer = peer
        self.forces, self.plans = peer.record(FORCE_COMMAND), peer.record(PLAN)
        self.reports = peer.record(DIAGNOSTICS)
        given = {'clock': 'lockstep', **dict(parameters)}
        self.node = start('mpc', given, arguments)
        self.node.wait_for('ready')
        self.states = peer.publisher(JOINT_STATES)
        counted = peer.node.count_publishers
        assert peer.until(lambda: counted('force_command') and counted('mpc/plan'))
        if given['clock'] == 'lockstep':   # until it does not, a state may be lost
            assert peer.until(lambda: peer.reliability() == ['RELIABLE'])
        peer.meet('mpc')
        self.n = 0

    def send(self, x, stamp=None):
        """Send a state and return the force that answers it."""
        before = len(self.forces)
        stamp = to_stamp(self.n * 50_000_000) if stamp is None else stamp
        self.states.publish(to_joint_state(stamp, np.asarray(x, float), 0.0))
        self.n += 1
        assert self.peer.until(lambda: len(self.forces) > before), self.node.output()
        return self.forces[-1].data

    def report(self):
        """Return the report on the last tick."""
        assert self.peer.until(lambda: len(self.reports) >= self.n)
        return from_diagnostics(self.reports[-1], 'mpc')


def test_every_state_gets_one_force_a_plan_and_a_report(peer, start_node):
    """As a process, which a signal ends."""
    talk = Conversation(peer, start_node)
    assert not talk.forces   # never before the first state
    for n in range(5):
        assert abs(talk.send(LEANING * (1 + 1e-3 * n))) <= 20.0
    report = talk.report()
    assert peer.until(lambda: len(talk.forces) == len(talk.plans) == len(talk.reports) == 5)
    assert talk.forces[-1].data == report.values['force']
    assert seconds(talk.plans[-1].header.stamp) == pytest.approx(0.2)
    plan, model = from_trajectory(talk.plans[0]), controllers.problem({}).model
    assert plan.U[0] == talk.forces[0].data   # before anything is known of the drive
    np.testing.assert_allclose(rollout(model, plan.X[0], plan.U), plan.X, atol=1e-12)
    np.testing.assert_allclose(plan.t, np.arange(31) * 0.05, atol=1e-9)
    assert peer.call(Trigger, 'mpc/reset').success
    talk.send(np.full(6, math.nan))
    talk.node.wait_for('expected 6 finite numbers')
    talk.send(hanging())
    talk.node.signal(signal.SIGTERM)   # it ends the stream of commands with zero
    assert peer.until(lambda: len(talk.forces) == 8)
    assert talk.forces[-2].data != 0.0 == talk.forces[-1].data
    assert talk.node.wait() == 0
    assert 'Traceback' not in talk.node.output()


def test_without_a_state_it_says_nothing_even_at_the_end(peer, start_here, tmp_path):
    file = tmp_path / 'rig.yaml'
    file.write_text('/**:\n  ros__parameters: {track_limt: 0.4, physics_step: 0.001}\n')
    talk = Conversation(peer, start_here, arguments=['--params-file', str(file)])
    # what no node has is told, and what the plant has is not
    assert "line 1: no node has 'track_limt'; did you mean 'track_limit'" in talk.node.output()
    assert 'physics_step' not in talk.node.output()
    talk.node.stop()
    peer.spin(0.3)
    assert not talk.forces


def test_where_states_stop_the_force_is_zero_until_they_come_back(peer, start_here):
    talk = Conversation(peer, start_here, {'clock': 'stamps'})
    for n in range(8):
        talk.send(LEANING * (1 + 1e-3 * n), peer.node.get_clock().now().to_msg())
        peer.spin(0.05)
    assert peer.until(lambda: talk.forces[-1].data == 0.0)
    peer.spin(0.5)
    assert peer.until(lambda: len(talk.reports) == len(talk.forces))
    carried = int(from_diagnostics(talk.reports[-1], 'mpc').values['carried'])
    assert 1 <= carried <= 6
    before = len(talk.reports)
    assert talk.send(LEANING, peer.node.get_clock().now().to_msg()) != 0.0
    assert peer.until(lambda: len(talk.reports) > before)
    assert from_diagnostics(talk.reports[before], 'mpc').values['carried'] == 0


def test_a_simulated_clock_is_waited_for_and_told_of_where_it_jumps(peer, start_here):
    clock = peer.node.create_publisher(Clock, '/clock', 10)
    talk = Conversation(peer, start_here, {'use_sim_time': True, 'clock': 'arrival'})
    talk.states.publish(to_joint_state(to_stamp(100_000_000_000), LEANING, 0.0))
    peer.spin(0.5)
    assert not talk.forces
    assert peer.until(clock.get_subscription_count)
    clock.publish(Clock(clock=to_stamp(100_001_000_000)))
    assert peer.until(lambda: talk.reports)
    values = from_diagnostics(talk.reports[-1], 'mpc').values
    assert values['time'] == pytest.approx(100.0, abs=0.01)

    def is_told():   # which on a busy machine may come when the jumps are long ago
        before = len(talk.reports)
        for n in range(8):
            clock.publish(Clock(clock=to_stamp(10 ** 9 * (120 + n - 10 * (n % 2)))))
            peer.spin(0.1)
        talk.send(LEANING * 1.1)
        return any('the clock jumped back' in status.message
                   for each in talk.reports[before:] for status in each.status)
    assert peer.until(is_told)
    talk.node.wait_for('expected a single publisher of /clock')


@pytest.mark.parametrize(('parameters', 'words'), [
    ({'ekf.gates': 5.0}, ("unknown parameter 'ekf.gates'", "did you mean 'ekf.gate'")),
    ({'solver': 'lqr'}, ('solver', "'lqr'", 'one of ddp, ilqr, mppi')),
    ({'reference': [0.0, 0.5, 0.0, 0.0, 0.0, 3.0]}, ('reference', 'expected an equilibrium')),
    ({'state_weights': [0.0] * 6}, ('reference', 'state_weights', 'no regulator'))])
def test_impossible_parameters_end_it_with_one_line(start_here, parameters, words):
    node = start_here('mpc', parameters)
    assert node.wait() == 2
    assert 'Traceback' not in node.output()
    last = node.output().strip().splitlines()[-1]
    assert last.startswith('mpc: error: ') and all(word in last for word in words), node.output()


def test_a_second_master_is_a_warning_in_the_diagnostics(peer, start_here):
    talk = Conversation(peer, start_here)
    peer.publisher(JOINT_STATES)
    peer.node.create_publisher(Float64, 'force_command', 10)

    def last():
        found = [from_diagnostics(each, 'mpc: topics') for each in talk.reports]
        return found[-1] if found else None
    rival = '/force_command has 2 publishers, /mpc, /peer; expected one'
    # at first the name of a node may not be known
    assert peer.until(lambda: last() and last().values['rivals'] == 2 and rival in last().message)
    assert last().level == DiagnosticStatus.WARN[0]
    assert '/joint_states has 2 publishers' in last().message
    assert talk.node.output().count(rival) == 1
    talk.send(hanging() * math.nan)
    talk.node.wait_for('going on without this state')   # which is not the fault of the sensors
    assert f'{rival}; ' in talk.node.output().splitlines()[-1]


def test_the_first_force_answers_the_first_state(tmp_path, capfd):
    """A start is over when each hears the other."""
    given = {'rate': 2.0, 'command_timeout': 60.0}
    with Crew(tmp_path / 'nodes.yaml', {'plant': given}) as crew:
        peer = Member(crew)
        states, forces = peer.record(JOINT_STATES), peer.record(FORCE_COMMAND_STAMPED)
        crew.start(MpcNode)
        crew.start(PlantNode)
        assert peer.until(lambda: len(states) >= 4 and len(forces) >= 4)
        assert forces[0].header.stamp == states[0].header.stamp
    assert 'no force' not in capfd.readouterr().err


def points_of(cloud):
    """Return the points of a cloud by the names of its fields; each (height, width)."""
    kind = np.dtype([(field.name, np.float32) for field in cloud.fields])
    assert kind.itemsize == cloud.point_step and cloud.row_step == kind.itemsize * cloud.width
    return np.frombuffer(bytes(cloud.data), kind).reshape(cloud.height, cloud.width)


@pytest.mark.parametrize('offered', ['RELIABLE', 'BEST_EFFORT'])
def test_in_lockstep_no_state_is_lost(tmp_path, offered):
    offers = {'qos_overrides./joint_states.publisher.reliability': offered.lower()}
    with Crew(tmp_path / 'nodes.yaml', {
            'plant': {'lockstep': True, 'pace': 1.0, **offers}}) as crew:
        peer = Member(crew)
        forces = peer.record(FORCE_COMMAND)
        crew.start(MpcNode)
        crew.start(PlantNode)
        assert peer.until(lambda: peer.reliability() == [offered])
        before = len(forces)
        assert peer.until(lambda: len(forces) > before + 5)


def test_states_that_are_found_after_their_plant_are_heard(peer, start_here):
    """A plant is discovered topic by topic, and one before it may have gone but in part."""
    start_here('mpc').wait_for('ready')
    told = peer.publisher(CONFIGURATION)
    told.publish(String(data=Configuration(
        '/elsewhere/plant', {'lockstep': True, 'rate': 20.0}, '', '', '', '', {}).to_text()))
    for reliability in (ReliabilityPolicy.RELIABLE, ReliabilityPolicy.BEST_EFFORT):
        peer.spin(0.5)
        states = peer.node.create_publisher(
            JointState, 'joint_states', QoSProfile(depth=1, reliability=reliability))
        assert peer.until(lambda: [each.qos_profile.reliability for each in
                                   peer.node.get_subscriptions_info_by_topic('/joint_states')
                                   ] == [reliability])
        assert peer.until(states.get_subscription_count)
        peer.node.destroy_publisher(states)


def test_tries_are_shown_where_they_are_asked_for(peer, start_here):
    clouds = peer.record(TRIES)
    talk = Conversation(peer, start_here, {'solver': 'mppi', 'shown_tries': 6})
    talk.send(hanging())
    assert peer.until(lambda: clouds and talk.plans)
    cloud, points = clouds[-1], points_of(clouds[-1])
    assert cloud.header.frame_id == 'track'
    assert cloud.header.stamp == talk.plans[-1].header.stamp
    assert 1 < cloud.height <= 7
    assert cloud.width == len(from_trajectory(talk.plans[-1]).U) + 1
    assert points['weight'].max() == 1.0 and not points['y'].any()
    np.testing.assert_allclose(points['z'][:, 0], points['z'][0, 0])
    assert points['z'][0, 0] == pytest.approx(-sum(PendulumParameters().lengths), rel=0.05)
