# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The node `faults` between a bare plant and a bare controller, and between those of ours."""

import math
import signal
import time

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from faults import (
    COMMAND_CHANNEL, FAULTS_FORCE_COMMAND, FAULTS_JOINT_STATES, FaultsNode, STATE_CHANNEL)
import numpy as np
from one_process import Crew
import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from test_live import put

from dp_swing_ros.bags import read_episode
from dp_swing_ros.messages.configuration import from_text
from dp_swing_ros.messages.fields import from_diagnostics, seconds
from dp_swing_ros.nodes.connections import subscribe
from dp_swing_ros.nodes.logger import LoggerNode
from dp_swing_ros.nodes.messages import to_joint_state, to_stamp
from dp_swing_ros.nodes.mpc import MpcNode
from dp_swing_ros.nodes.plant import PlantNode
from dp_swing_ros.streams import stream
from dp_swing_ros.tools import verify
from dp_swing_ros.topics import CONFIGURATION, DIAGNOSTICS, FORCE_COMMAND, JOINT_STATES

PAUSE = 0.003   # [s] between two messages: a sensor's subscription is best effort
OF_MPC = [word for node in ('mpc', 'logger') for topic in ('joint_states', 'force_command')
          for word in ('-r', f'{node}:{topic}:=faults/{topic}')]


class Between:
    """Sends states as a plant and forces as a controller; keeps what comes out of the node."""

    def __init__(self, peer, start_here, parameters=(), arguments=(), prefix=''):
        self.peer = peer
        inputs, outputs = (
            [topic._replace(name=prefix + topic.name) for topic in topics]
            for topics in ((JOINT_STATES, FAULTS_FORCE_COMMAND),
                           (FAULTS_JOINT_STATES, FORCE_COMMAND)))
        self.states = []   # as bytes, and when they came [s]
        subscribe(peer.node, outputs[0], lambda data: self.states.append(
            (data, time.monotonic())), depth=1000, raw=True)
        self.forces, self.reports = peer.record(outputs[1]), peer.record(DIAGNOSTICS)
        self.node = start_here('faults.py', parameters, arguments)
        self.node.wait_for('ready')
        self.plant, self.controller = map(peer.publisher, inputs)
        assert peer.until(lambda: all(peer.node.count_publishers(each.name) for each in outputs))
        peer.meet(f'{prefix}faults')

    def send_states(self, count):
        """Publish states whose cart is at 0, 1, 2 ...; return their bytes."""
        sent = []
        for n in range(count):
            state = to_joint_state(to_stamp(n * 50_000_000), np.arange(n, n + 6.0), 1.5)
            sent.append(bytes(serialize_message(state)))
            self.plant.publish(sent[-1])
            self.peer.spin(PAUSE)
        return sent

    def send_forces(self, count):
        """Publish forces of 0, 1, 2 ... N."""
        for n in range(count):
            self.controller.publish(Float64(data=float(n)))
            self.peer.spin(PAUSE)

    def carts(self, count):
        """Return where the cart is in the states, once so many have come, and no more come."""
        assert self.peer.until(lambda: len(self.states) >= count), len(self.states)
        self.peer.spin(0.2)
        return [deserialize_message(data, JointState).position[0] for data, _ in self.states]

    def commands(self, count):
        """Return the forces, as `carts`."""
        assert self.peer.until(lambda: len(self.forces) >= count), len(self.forces)
        self.peer.spin(0.2)
        return [force.data for force in self.forces]

    def report(self):
        """Return the next report."""
        before = len(self.reports)
        assert self.peer.until(lambda: len(self.reports) > before)
        return from_diagnostics(self.reports[-1], 'faults')


def kept(purpose, count, loss, seed=0):
    """Return the numbers of the messages that are not lost."""
    return np.flatnonzero(stream(seed, purpose).random((count, 4))[:, 0] >= loss).tolist()


def test_without_faults_everything_passes_as_it_is(peer, start_here):
    between = Between(peer, start_here)
    sent = between.send_states(30)
    between.send_forces(30)
    assert between.carts(30) == between.commands(30) == list(range(30))
    assert [data for data, _ in between.states] == sent
    report = between.report()
    assert (report.level, report.message) == (DiagnosticStatus.OK[0], 'everything passes')
    assert {name: value for name, value in report.values.items() if value} == {
        'heard_states': 30, 'heard_commands': 30}
    assert between.node.stop() == 0


def test_losses_are_those_of_the_seed_in_each_direction(peer, start_here):
    between = Between(peer, start_here, {'state_loss': 0.3, 'command_loss': 0.1, 'seed': 5})
    states = kept(STATE_CHANNEL, 100, 0.3, 5)
    commands = kept(COMMAND_CHANNEL, 100, 0.1, 5)
    assert 15 < 100 - len(states) < 45 and 3 < 100 - len(commands) < 25
    between.send_states(100)
    between.send_forces(100)
    assert between.carts(len(states)) == states
    assert between.commands(len(commands)) == commands
    report = between.report()
    assert report.message == 'state_loss 0.3, command_loss 0.1'
    assert report.values['lost_states'] == 100 - len(states)
    assert report.values['lost_commands'] == 100 - len(commands)


def test_duplicates_and_swaps(peer, start_here):
    between = Between(peer, start_here, {'state_duplication': 1.0, 'command_reordering': 1.0})
    between.send_states(10)
    between.send_forces(10)
    assert between.carts(20) == sorted(2 * [*range(10)])
    assert between.commands(10) == [1, 0, 3, 2, 5, 4, 7, 6, 9, 8]
    values = between.report().values
    assert (values['duplicated_states'], values['reordered_commands']) == (10, 5)


def test_what_is_delayed_comes_late_and_in_order(peer, start_here):
    between = Between(peer, start_here, {
        'state_delay': 0.3, 'command_delay': 0.05, 'command_jitter': 0.2})
    before = time.monotonic()
    between.send_states(1)
    between.send_forces(50)
    assert between.carts(1) == [0]
    assert between.states[0][1] - before >= 0.3
    assert between.commands(50) == list(range(50))
    values = between.report().values
    assert (values['delayed_states'], values['delayed_commands']) == (1, 50)


def test_with_simulated_time_a_delay_goes_by_it(peer, start_here):
    between = Between(peer, start_here, {'use_sim_time': True, 'state_delay': 0.5})
    clock = peer.node.create_publisher(Clock, '/clock', 1)
    assert peer.until(lambda: clock.get_subscription_count())

    def set_clock(nanoseconds):
        clock.publish(Clock(clock=Time(sec=1, nanosec=nanoseconds)))
        peer.spin(0.3)
    # where the node has still to find the clock, one alone is lost
    assert peer.until(lambda: set_clock(0) or (
        between.reports and between.reports[-1].header.stamp.sec == 1))
    between.send_states(1)
    assert peer.until(lambda: between.report().values['delayed_states'] == 1)
    set_clock(400_000_000)
    peer.spin(0.5)
    assert not between.states
    set_clock(600_000_000)
    assert between.carts(1) == [0]


def test_nan_comes_and_goes_in_states_alone(peer, start_here):
    told = peer.record(CONFIGURATION)
    between = Between(peer, start_here)
    for n, share in enumerate((0.0, 1.0, 0.0)):
        if n:   # what was sent before has passed
            assert peer.until(lambda: len(between.states) >= 5 * n)
            assert put(peer, 'faults', state_nan=share) == ''
        between.send_states(5)
        between.send_forces(5)
    assert np.isnan(between.carts(15)).tolist() == 5 * [False] + 5 * [True] + 5 * [False]
    state = deserialize_message(between.states[6][0], JointState)
    assert np.isnan([*state.position, *state.velocity]).all() and len(state.velocity) == 3
    assert list(state.name) == ['cart', 'joint1', 'joint2']
    assert list(state.effort) == [1.5, 0.0, 0.0] and seconds(state.header.stamp) == 0.05
    assert between.commands(15) == 3 * [0, 1, 2, 3, 4]
    assert between.report().values['nan_states'] == 5
    assert peer.until(lambda: any('revision: 2' in each.data for each in told))
    assert from_text(told[-1].data).parameters['state_nan'] == 0.0


def test_changes_that_are_refused_say_why(peer, start_here):
    between = Between(peer, start_here)
    for wrong, words in (({'state_loss': 1.5}, "'state_loss' is 1.5; expected at least 0"),
                         ({'command_delay': math.nan}, 'a finite number'),
                         ({'command_nan': 0.1}, "unknown parameter 'command_nan'"),
                         ({'seed': 3}, 'read-only')):
        assert words in put(peer, 'faults', **{'command_loss': 1.0, **wrong})
    between.send_forces(5)
    assert between.commands(5) == [0, 1, 2, 3, 4]


@pytest.mark.parametrize('bad', [math.nan, math.inf])
def test_a_force_that_is_not_finite_does_not_pass(peer, start_here, bad):
    between = Between(peer, start_here)
    for force in (1.0, bad, 2.0):
        between.controller.publish(Float64(data=force))
    assert between.commands(2) == [1.0, 2.0]
    between.node.wait_for('expected a finite number')
    assert peer.until(lambda: any(
        report and report.level == DiagnosticStatus.WARN[0] and report.values['refused'] == 1
        for report in (from_diagnostics(each, 'faults') for each in between.reports)))


def test_a_stream_of_forces_ends_with_zero(peer, start_node):
    between = Between(peer, start_node, {'command_loss': 0.0})
    between.controller.publish(Float64(data=7.0))
    assert between.commands(1) == [7.0]
    assert put(peer, 'faults', command_loss=1.0) == ''
    assert between.node.stop(signal.SIGTERM) == 0
    assert between.commands(2) == [7.0, 0.0]
    assert 'Traceback' not in between.node.output()


def test_where_no_force_has_passed_there_is_none_at_the_end(peer, start_here):
    between = Between(peer, start_here, {'command_loss': 1.0})
    between.send_forces(3)
    assert between.node.stop() == 0
    peer.spin(0.3)
    assert not between.forces


@pytest.mark.parametrize(('parameters', 'words'), [
    ({'state_los': 0.1}, "unknown parameter 'state_los' of the node 'faults'; did you mean"),
    ({'state_loss': 2.0}, "parameter 'state_loss' is 2.0; expected at least 0, at most 1 "),
    ({'command_nan': 0.1}, "unknown parameter 'command_nan'"),
    ({'command_delay': -1.0}, 'at least 0 s, at most 1 s')])
def test_a_bad_parameter_is_one_line(start_here, parameters, words):
    node = start_here('faults.py', parameters)
    assert node.wait() == 2
    assert node.complaint().startswith('faults.py: error: ') and words in node.complaint()
    assert node.complaint().count('\n') == 1


def test_a_second_pendulum_has_faults_of_its_own(peer, start_here):
    between = Between(peer, start_here, arguments=['-r', '__ns:=/second'], prefix='/second/')
    between.send_states(3)
    assert between.carts(3) == [0, 1, 2]
    between.report()
    status = between.reports[-1].status[0]
    assert (status.name, status.hardware_id) == ('second/faults', '/second/joint_states')


def test_what_an_mpc_answers_through_faults_is_verified(tmp_path, capsys):
    """A tenth is lost both ways, and for 0.3 s each state is NaN."""
    with Crew(tmp_path / 'nodes.yaml', {
            'logger': {'output': str(tmp_path / 'bag'), 'progress_period': 0.0},
            'faults': {'state_loss': 0.1, 'command_loss': 0.1},
            'plant': {'start': 'up_up'}}, OF_MPC) as crew:
        other = crew.add(Node('other', context=crew.context))
        states, forces, reports = [], [], []
        for topic, heard in ((JOINT_STATES, states), (FORCE_COMMAND, forces),
                             (DIAGNOSTICS, reports)):
            subscribe(other, topic, heard.append, depth=1000)
        logger, faults, mpc, plant = map(
            crew.start, (LoggerNode, FaultsNode, MpcNode, PlantNode))
        assert crew.until(lambda: len(states) > 15)
        for nan, count in ((1.0, 6), (0.0, 15)):
            faults.set_parameters([Parameter('state_nan', value=nan)])
            assert crew.until(lambda count=count, before=len(states):
                              len(states) > before + count)
        crew.end(plant)
        crew.until(mpc.silence.is_canceled, 1.0)

        def told():
            """Return what faults has reported."""
            found = (from_diagnostics(each, 'faults') for each in reports)
            return [report for report in found if report]
        assert crew.until(lambda: any(
            report.values['heard_states'] >= len(states) for report in told()[-1:]))
        crew.end(mpc)
        crew.until(lambda: forces[-1].data == 0.0, 1.0)
        crew.end(faults)
        logger.close()
    assert np.abs([force.data for force in forces]).max() <= 20.0   # which no NaN is
    assert all(told()[-1].values[name] > 0 for name in (
        'lost_states', 'lost_commands', 'nan_states'))
    assert len(read_episode(tmp_path / 'bag').t) < len(states)
    assert verify.main([str(tmp_path / 'bag')]) == 0, capsys.readouterr().out
    assert 'every force is the recorded one' in capsys.readouterr().out
