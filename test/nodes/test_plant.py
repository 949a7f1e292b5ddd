# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The plant as a process: what it publishes, obeys, refuses, and how it ends."""

import itertools
import math
import signal
from xml.etree import ElementTree

from controllers import plant
import numpy as np
from peer import Peer
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger

from dp_swing_ros.nodes.messages import from_diagnostics, seconds, to_state
from dp_swing_ros.topics import DIAGNOSTICS, DISTURBANCE, FORCE_COMMAND, JOINT_STATES


@pytest.fixture
def peer():
    peer = Peer()
    yield peer
    peer.close()


def first_states(peer, start_node, count=5, **parameters):
    states = peer.record(JOINT_STATES)
    node = start_node('plant', parameters)
    assert peer.until(lambda: len(states) >= count), node.output()
    return node, states


def test_states_come_at_the_rate_with_names_and_stamps(peer, start_node):
    node, states = first_states(peer, start_node, 45)
    assert list(states[0].name) == ['cart', 'joint1', 'joint2']
    np.testing.assert_allclose(to_state(states[-1]), [0, math.pi, math.pi, 0, 0, 0], atol=1e-9)
    stamps = np.array([seconds(state.header.stamp) for state in states])
    assert np.median(np.diff(stamps)) == pytest.approx(0.05, abs=0.005)
    assert abs(stamps[-1] - peer.node.get_clock().now().nanoseconds / 1e9) < 1
    assert node.stop() == 0


def test_a_force_moves_the_cart_and_is_reported(peer, start_node):
    node, states = first_states(peer, start_node)
    forces = peer.publisher(FORCE_COMMAND)
    for _ in range(10):
        forces.publish(Float64(data=50.0))
        peer.spin(0.05)
    assert max(state.effort[0] for state in states) == 20.0
    assert states[-1].position[0] > 0.05
    assert node.stop() == 0


def test_without_commands_the_force_becomes_zero_and_it_says_so_once(peer, start_node):
    node, states = first_states(peer, start_node, command_timeout=0.3)
    peer.publisher(FORCE_COMMAND).publish(Float64(data=1.0))
    assert peer.until(lambda: states[-1].effort[0] == 1.0)
    assert peer.until(lambda: states[-1].effort[0] == 0.0)
    acting = sum(state.effort[0] for state in states) * 0.05
    assert acting == pytest.approx(0.3, rel=0.35)   # it acted for 0.3 s, not for whole periods
    peer.spin(0.7)
    assert node.output().count('the force is zero until the next') == 1
    assert node.stop() == 0


@pytest.mark.parametrize('bad', [math.nan, math.inf])
def test_a_force_that_is_not_finite_is_refused(peer, start_node, bad):
    node, states = first_states(peer, start_node)
    peer.publisher(FORCE_COMMAND).publish(Float64(data=bad))
    node.wait_for('expected a finite number')
    peer.spin(0.2)
    assert np.all(np.isfinite(to_state(states[-1])))
    assert states[-1].effort[0] == 0.0


def test_a_push_lasts_one_period(peer, start_node):
    node, states = first_states(peer, start_node)
    peer.publisher(DISTURBANCE).publish(Float64(data=10.0))
    assert peer.until(lambda: abs(states[-1].velocity[0]) > 0.05)
    after = len(states)
    assert peer.until(lambda: len(states) >= after + 3)
    assert all(state.effort[0] == 0.0 for state in states)
    assert states[-1].velocity[0] < 2 * states[after].velocity[0]


def test_a_reset_goes_back_to_the_start(peer, start_node):
    node, states = first_states(peer, start_node, initial_state=[0.5, 1.0, 0.0, 0.0, 0.0, 0.0])
    assert peer.until(lambda: len(states) >= 20)
    moved = to_state(states[-1])
    assert np.abs(moved - [0.5, 1.0, 0, 0, 0, 0]).max() > 0.1
    before = len(states)
    assert peer.call(Trigger, 'plant/reset').success
    assert peer.until(lambda: len(states) > before + 1)
    returned = [to_state(state) for state in states[before:]]
    assert min(np.abs(x - [0.5, 1.0, 0, 0, 0, 0]).max() for x in returned) < 1e-9


def test_it_ends_itself_after_its_duration(peer, start_node):
    states = peer.record(JOINT_STATES)
    node = start_node('plant', {'duration': 1.0})
    assert peer.until(lambda: node.popen.poll() is not None)
    assert node.wait() == 0
    peer.spin(0.2)
    assert seconds(states[-1].header.stamp) - seconds(states[0].header.stamp) < 1.2


def test_lockstep_waits_for_every_force(peer, start_node):
    states = peer.record(JOINT_STATES)
    node = start_node('plant', {'lockstep': True, 'rate': 50.0})
    node.wait_for('waiting for a controller')
    peer.spin(0.5)
    assert not states
    forces = peer.publisher(FORCE_COMMAND)
    assert peer.until(lambda: states)
    for n in range(1, 30):
        forces.publish(Float64(data=float(n % 5)))
        assert peer.until(lambda: len(states) > n)
        assert states[n].effort[0] == n % 5
    peer.spin(0.3)
    assert len(states) == 30
    stamps = [seconds(state.header.stamp) for state in states]
    np.testing.assert_allclose(stamps, np.arange(30) * 0.02, atol=1e-9)
    assert node.stop() == 0


FAULTS = {'state_loss': 0.4, 'command_loss': 0.4, 'command_jitter': 0.08,
          'actuator_response': 0.3}
SEED = next(seed for seed in itertools.count() if plant(seed, state_loss=0.4).measure() is None)


def expected_states(count, **faults):
    """Return the measurements and mean forces of a plant whose n-th state is answered with n."""
    p, states = plant(SEED, **faults), []
    while len(states) < count:
        measured = p.measure()
        if measured is not None:
            states.append((*measured, p.mean_force))
        p.begin_period(0.0)
        if measured is not None:
            p.obey(float(len(states)))
        p.advance(0.05)
    return states


@pytest.mark.parametrize('names', [['state_loss'], ['command_loss'], list(FAULTS)], ids=str)
def test_lockstep_goes_on_through_losses(peer, start_node, names):
    faults = {name: FAULTS[name] for name in names}
    states = peer.record(JOINT_STATES)
    node = start_node('plant', {'lockstep': True, 'seed': SEED, **faults})
    forces = peer.publisher(FORCE_COMMAND)
    for n in range(30):
        assert peer.until(lambda: len(states) > n), node.output()
        forces.publish(Float64(data=n + 1.0))
    for state, (t, x, force) in zip(states, expected_states(30, **faults)):
        assert seconds(state.header.stamp) == pytest.approx(t, abs=1e-9)
        np.testing.assert_array_equal(to_state(state), x)
        assert state.effort[0] == force
    assert node.stop() == 0


def test_lockstep_without_any_state_can_be_ended(peer, start_node):
    states, reports = peer.record(JOINT_STATES), peer.record(DIAGNOSTICS)
    node = start_node('plant', {'lockstep': True, 'state_loss': 1.0})
    peer.publisher(FORCE_COMMAND)
    assert peer.until(lambda: len(reports) > 3), node.output()
    report = from_diagnostics(reports[-1], 'plant')
    assert report.values['lost_states'] == pytest.approx(report.values['time'] * 20 + 1)
    assert not states
    assert node.stop() == 0


def test_lockstep_without_any_state_ends_after_its_duration(peer, start_node):
    states = peer.record(JOINT_STATES)
    node = start_node('plant', {'lockstep': True, 'state_loss': 1.0, 'duration': 5.0})
    peer.publisher(FORCE_COMMAND)
    assert node.wait() == 0
    assert not states


def test_a_push_in_lockstep_lasts_one_period(peer, start_node):
    states = peer.record(JOINT_STATES)
    start_node('plant', {'lockstep': True})
    forces, pushes = peer.publisher(FORCE_COMMAND), peer.publisher(DISTURBANCE)
    assert peer.until(lambda: states)
    pushes.publish(Float64(data=10.0))
    peer.spin(0.5)   # topics keep no order between them
    for n in range(1, 5):
        forces.publish(Float64(data=0.0))
        assert peer.until(lambda: len(states) > n)
    p = plant()
    for state, push in zip(states, (0.0, 10.0, 0.0, 0.0, 0.0)):
        np.testing.assert_array_equal(to_state(state), p.x)
        p.begin_period(push)
        p.advance(0.05)
    assert states[2].velocity[0] > 0.1


def test_faults_in_real_time(peer, start_node):
    reports = peer.record(DIAGNOSTICS)
    slow = {**FAULTS, 'actuator_response': 0.02}   # a quarter of a second: some states see it
    node, states = first_states(peer, start_node, **slow, command_timeout=0.5)
    forces = peer.publisher(FORCE_COMMAND)
    for _ in range(40):
        forces.publish(Float64(data=4.0))
        peer.spin(0.05)
    assert max(state.effort[0] for state in states) == pytest.approx(4.0, abs=0.1)
    assert any(0.1 < state.effort[0] < 3.5 for state in states)   # it got there by and by
    assert peer.until(lambda: abs(states[-1].effort[0]) < 0.1)
    steps = np.diff([seconds(state.header.stamp) for state in states])
    assert np.mean(steps > 0.08) > 0.15
    assert peer.until(lambda: from_diagnostics(reports[-1], 'plant').values['commands'] == 40)
    values = from_diagnostics(reports[-1], 'plant').values
    assert 5 < values['lost_commands'] < 30
    assert values['lost_states'] > 5
    assert node.stop() == 0


def test_the_robot_description_waits_for_whoever_joins_late(peer, start_node):
    first_states(peer, start_node, link2_length=0.7)
    texts = []
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    peer.node.create_subscription(String, 'robot_description', texts.append, latched)
    assert peer.until(lambda: texts)
    cylinders = ElementTree.fromstring(texts[0].data).findall('link//cylinder')
    assert '0.7' in [cylinder.get('length') for cylinder in cylinders]


def test_diagnostics_count_what_arrives(peer, start_node):
    reports = peer.record(DIAGNOSTICS)
    node, _ = first_states(peer, start_node)
    forces = peer.publisher(FORCE_COMMAND)
    for force in (1.0, math.nan, 1.0):
        forces.publish(Float64(data=force))
        peer.spin(0.1)

    def last():
        return [report for report in (from_diagnostics(r, 'plant') for r in reports) if report]
    assert peer.until(lambda: last() and last()[-1].values['commands'] == 2), node.output()
    assert last()[-1].values['refused'] == 1


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_with_exit_code_0(peer, start_node, number):
    node, _ = first_states(peer, start_node)
    assert node.stop(number) == 0
    assert 'Traceback' not in node.output()


def test_a_namespace_gives_a_second_pendulum(peer, start_node):
    states = peer.record(JOINT_STATES._replace(name='/second/joint_states'))
    start_node('plant', arguments=['-r', '__ns:=/second'])
    assert peer.until(lambda: len(states) > 3)


@pytest.mark.parametrize(('parameters', 'words'), [
    ({'link1_masss': 1.0}, ("unknown parameter 'link1_masss'", "did you mean 'link1_mass'")),
    ({'link1_mass': -1.0}, ('link1_mass', 'at least 0.001 kg')),
    ({'initial_state': [0.0, 1.0]}, ('initial_state', 'list of 6 numbers')),
    ({'integrator': 'rk5'}, ('integrator', 'one of rk4, euler'))])
def test_impossible_parameters_end_it_with_one_line(start_node, parameters, words):
    node = start_node('plant', parameters)
    assert node.wait() == 2
    assert len(node.output().strip().splitlines()) == 1
    assert all(word in node.output() for word in words)
