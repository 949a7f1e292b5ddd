# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The plant as a process: what it publishes, obeys, refuses, and how it ends."""

import functools
import itertools
import math
import signal
import time
from xml.etree import ElementTree

from controllers import plant
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
from peer import Peer
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger

from dp_swing_ros.messages import fields
from dp_swing_ros.messages.fields import from_diagnostics, seconds
from dp_swing_ros.nodes.connections import request_for
from dp_swing_ros.nodes.messages import to_stamp
from dp_swing_ros.pendulum.state import hanging, joints
from dp_swing_ros.tools import verify
from dp_swing_ros.topics import DIAGNOSTICS, DISTURBANCE, FORCE_COMMAND, JOINT_STATES

to_state = functools.partial(fields.to_state, links=2)


def first_states(peer, start_node, count=5, **parameters):
    states = peer.record(JOINT_STATES)
    node = start_node('plant', parameters)
    node.wait_for('states a second')   # the first time it compiles before
    assert peer.until(lambda: len(states) >= count), node.output()
    return node, states


def test_two_plants_and_two_mpcs_name_each_other_and_are_the_cause(start_node, tmp_path, capsys):
    logger = start_node('logger', {'output': str(tmp_path / 'bag')})
    pairs = {kind: [start_node(kind, arguments=['-r', f'__node:={name}']) for name in (
        kind, f'second_{kind}')] for kind in ('mpc', 'plant')}
    for node in (*pairs['mpc'], *pairs['plant']):
        node.wait_for('/force_command has 2 publishers, /mpc, /second_mpc; expected one')
        node.wait_for('/joint_states has 2 publishers, /plant, /second_plant; expected one')
    logger.stop()
    bag = str(tmp_path / 'bag')
    assert verify.main([bag, '--node', '/mpc', '--node', '/plant']) != 0
    shown = ''.join(capsys.readouterr())
    for topic, kind in (('/force_command', 'mpc'), ('/joint_states', 'plant')):
        assert shown.count(f'{topic} has 2 publishers, /{kind}, /second_{kind}') == 1
    assert 'likely cause: ' in shown


def test_states_come_at_the_rate_with_names_and_stamps(peer, start_node):
    node, states = first_states(peer, start_node, 45)
    assert list(states[0].name) == ['cart', 'joint1', 'joint2']
    np.testing.assert_allclose(to_state(states[-1]), [0, math.pi, math.pi, 0, 0, 0], atol=1e-9)
    stamps = np.array([seconds(state.header.stamp) for state in states])
    assert np.median(np.diff(stamps)) == pytest.approx(0.05, abs=0.005)
    assert abs(stamps[-1] - peer.node.get_clock().now().nanoseconds / 1e9) < 1
    assert node.stop() == 0


@pytest.mark.parametrize('links', [1, 3])
def test_states_have_as_many_joints_as_there_are_links(peer, start_node, links):
    _, states = first_states(peer, start_node, links=links)
    assert list(states[0].name) == list(joints(links))
    np.testing.assert_array_equal(fields.to_state(states[0], links), hanging(links))
    assert len(states[0].effort) == links + 1


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
    forces = peer.publisher(FORCE_COMMAND)
    forces.publish(Float64(data=1.0))
    assert peer.until(lambda: states[-1].effort[0] == 1.0)
    assert peer.until(lambda: states[-1].effort[0] == 0.0)
    acting = sum(state.effort[0] for state in states) * 0.05
    assert acting == pytest.approx(0.3, rel=0.35)   # it acted for 0.3 s, not for whole periods
    peer.spin(0.7)

    def said():
        return node.output().count('the force is zero until the next')
    assert said() == 1
    forces.publish(Float64(data=1.0))
    assert peer.until(lambda: said() == 2)
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


def test_a_simulated_clock_that_jumps_ahead_is_told_of_and_nothing_else(peer, start_node):
    """Not followed for an hour of integration, nor for as long as since 1970."""
    states = peer.record(JOINT_STATES)
    node = start_node('plant', {'use_sim_time': True, 'start': 'down_up'})
    node.wait_for('as /clock goes')
    clock, now = peer.node.create_publisher(Clock, '/clock', 10), 1.0
    for jump in (0.0, 1e6, 1.7e9):
        now += jump
        before = len(states)
        for _ in range(200):
            now += 0.01
            clock.publish(Clock(clock=to_stamp(round(now * 1e9))))
            peer.spin(0.01)
        assert peer.until(lambda: len(states) > before + 5), node.output()
        assert seconds(states[-1].header.stamp) == pytest.approx(now, abs=1.0)
    node.wait_for('the clock jumped by +1e+06 s; the pendulum goes on from where it was')
    assert node.stop() == 0


def test_a_force_from_before_a_reset_is_not_obeyed_in_lockstep(peer, start_node):
    states = peer.record(JOINT_STATES)
    start_node('plant', {'lockstep': True}).wait_for('waiting for a controller')
    forces = peer.publisher(FORCE_COMMAND)
    assert peer.until(lambda: states)
    forces.publish(Float64(data=1.0))
    assert peer.until(lambda: len(states) == 2)
    assert peer.call(Trigger, 'plant/reset').success   # while the answer is underway
    assert peer.until(lambda: len(states) == 3)
    assert seconds(states[-1].header.stamp) == 0.0
    forces.publish(Float64(data=7.0))
    peer.spin(0.1)
    assert len(states) == 3
    forces.publish(Float64(data=2.0))
    assert peer.until(lambda: len(states) == 4)
    assert states[-1].effort[0] == 2.0


def test_a_state_whose_answer_was_overlooked_after_a_reset_is_sent_again(peer, start_node):
    states = peer.record(JOINT_STATES)
    start_node('plant', {'lockstep': True}).wait_for('waiting for a controller')
    forces = peer.publisher(FORCE_COMMAND)
    assert peer.until(lambda: states)
    assert peer.call(Trigger, 'plant/reset').success   # and the first state is never answered
    assert peer.until(lambda: len(states) == 2)
    forces.publish(Float64(data=3.0))
    assert peer.until(lambda: len(states) == 3)
    assert states[-1] == states[-2]
    forces.publish(Float64(data=4.0))
    assert peer.until(lambda: len(states) == 4)
    assert states[-1].effort[0] == 4.0


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


def test_the_status_says_whose_it_is(peer, start_node):
    reports = peer.record(DIAGNOSTICS)
    start_node('plant', arguments=['-r', '__ns:=/second'])
    assert peer.until(lambda: reports)
    assert (reports[0].status[0].name, reports[0].status[0].hardware_id) == (
        'second/plant', '/second/joint_states')


@pytest.mark.parametrize(('parameters', 'words'), [
    ({'link1_masss': 1.0}, ("unknown parameter 'link1_masss'", "did you mean 'link1_mass'")),
    ({'link1_mass': -1.0}, ('link1_mass', 'at least 0.001 kg')),
    ({'initial_state': [0.0, 1.0]}, ('initial_state', 'list of 6 numbers')),
    ({'link3_mass': 0.5}, ("'link3_mass'", '3 links', 'this one has 2')),
    ({'links': 1, 'link2_mass': 0.5}, ("'link2_mass'", '2 links', 'this one has 1')),
    ({'integrator': 'rk5'}, ('integrator', 'one of rk4, euler'))])
def test_impossible_parameters_end_it_with_one_line(start_node, parameters, words):
    node = start_node('plant', parameters)
    assert node.wait() == 2
    assert len(node.complaint().strip().splitlines()) == 1
    assert all(word in node.complaint() for word in words)


def late_states(peer):
    """Return a list that fills with the states as a reader asks for them that comes late."""
    states, name = [], '/joint_states'
    assert peer.until(lambda: peer.node.get_publishers_info_by_topic(name))
    profile = request_for([
        each.qos_profile for each in peer.node.get_publishers_info_by_topic(name)])
    peer.node.create_subscription(JointState, name, states.append, profile)
    return states


def test_who_comes_late_gets_a_fresh_state(peer, start_node):
    first_states(peer, start_node, 20)
    late = late_states(peer)
    assert peer.until(lambda: late)
    assert peer.node.get_clock().now().nanoseconds / 1e9 - seconds(late[0].header.stamp) < 0.3


def test_states_are_kept_for_who_asks_for_it(peer, start_node):
    node, states = first_states(peer, start_node, 20, **{
        'qos_overrides./joint_states.publisher.durability': 'transient_local',
        'qos_overrides./joint_states.publisher.depth': 1000})
    before = list(states)   # from the first on, if the plant found its reader in time
    late = late_states(peer)
    assert peer.until(lambda: before[-1] in late)
    first = late.index(before[0])
    assert late[first:first + len(before)] == before
    assert node.stop() == 0


@pytest.mark.parametrize(('name', 'value', 'words'), [
    ('/joint_states.publisher.durability', 'for ever', 'is impossible'),
    ('/joint_states.publisher.depth', 'deep', 'is impossible'),
    ('/joint_state.publisher.depth', 9, "did you mean 'qos_overrides./joint_states.publisher.")])
def test_impossible_overrides_end_it_with_one_line(start_node, name, value, words):
    node = start_node('plant', {f'qos_overrides.{name}': value})
    assert node.wait() == 2
    last = node.output().strip().splitlines()[-1]
    assert last.startswith('plant: error: ') and words in last, node.output()
    assert 'Traceback' not in node.output()


def test_the_first_state_waits_for_all_who_listen(peer, start_node):
    node = start_node('plant')
    node.wait_for('states a second')
    states = peer.record(JOINT_STATES)   # found later than the plant is ready
    other = peer.record(JOINT_STATES)
    assert peer.until(lambda: len(other) > 2)
    assert to_state(states[0]).tolist() == to_state(other[0]).tolist() == [
        0.0, math.pi, math.pi, 0.0, 0.0, 0.0]
    assert states[0].header.stamp == other[0].header.stamp


def topics_of(reports, node='plant'):
    """Return the reports of a node on its topics."""
    found = (from_diagnostics(report, f'{node}: topics') for report in reports)
    return [report for report in found if report is not None]


def test_who_cannot_hear_is_an_error_in_the_diagnostics(peer, start_node):
    reports = peer.record(DIAGNOSTICS)
    first_states(peer, start_node)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    deaf = peer.node.create_subscription(JointState, 'joint_states', print, latched)
    assert peer.until(lambda: topics_of(reports))
    report = topics_of(reports)[0]
    assert report.level == DiagnosticStatus.ERROR[0]
    assert '/joint_states from /plant to /peer: durability volatile is offered' in report.message
    peer.node.destroy_subscription(deaf)
    assert peer.until(lambda: topics_of(reports)[-1].level == DiagnosticStatus.OK[0])


def test_a_second_master_is_a_warning_in_the_diagnostics(peer, start_node):
    reports = peer.record(DIAGNOSTICS)
    first_states(peer, start_node)
    peer.publisher(FORCE_COMMAND)
    peer.spin(1.5)
    assert not topics_of(reports)
    peer.publisher(FORCE_COMMAND)
    assert peer.until(lambda: topics_of(reports))
    report = topics_of(reports)[0]
    assert report.level == DiagnosticStatus.WARN[0]
    assert '/force_command has 2 publishers, /peer, /peer; expected one' in report.message


@pytest.mark.parametrize('pushes', [[1e6], [-1e6], [math.nan], [60.0, 60.0, 60.0]], ids=str)
def test_a_push_beyond_all_bounds_is_refused(peer, start_node, pushes):
    reports = peer.record(DIAGNOSTICS)
    states = peer.record(JOINT_STATES)
    node = start_node('plant', {'lockstep': True})
    forces, disturbances = peer.publisher(FORCE_COMMAND), peer.publisher(DISTURBANCE)
    assert peer.until(lambda: states)
    for push in pushes:
        disturbances.publish(Float64(data=push))
    node.wait_for('refused a disturbance')
    peer.spin(0.3)
    for n in range(1, 45):
        forces.publish(Float64(data=0.0))
        assert peer.until(lambda: len(states) > n)
    accepted = 60.0 if len(pushes) > 1 else 0.0
    p = plant()
    p.begin_period(0.0)
    p.advance(0.05)
    p.begin_period(accepted)
    p.advance(0.05)
    np.testing.assert_array_equal(to_state(states[2]), p.x)
    found = [r for r in (from_diagnostics(r, 'plant') for r in reports) if r]
    then, *_, later = [each for each in found if each.values['refused_disturbances']]
    assert (then.level, later.level) == (DiagnosticStatus.WARN[0], DiagnosticStatus.OK[0])
    for report in (then, later):
        assert report.values['refused_disturbances'] == max(len(pushes) - 1, 1)
    assert {each.stamp: each.values['push'] for each in found if each.values['push']} == (
        {50_000_000: accepted} if accepted else {})


def test_a_state_that_is_not_finite_is_an_error_in_the_diagnostics(peer, start_node):
    reports = peer.record(DIAGNOSTICS)
    first_states(peer, start_node, force_limit=math.inf)
    peer.publisher(FORCE_COMMAND).publish(Float64(data=1e300))

    def last():
        return [r for r in (from_diagnostics(r, 'plant') for r in reports) if r][-1]
    assert peer.until(lambda: last().level == DiagnosticStatus.ERROR[0])
    assert last().message == 'the state is not finite; call plant/reset'


@pytest.mark.parametrize('factor', [0.5, 2.0])
def test_with_simulated_time_it_goes_as_the_clock_does(peer, start_node, factor):
    clock = peer.node.create_publisher(Clock, '/clock', 10)
    states = peer.record(JOINT_STATES)
    start_node('plant', {'use_sim_time': True, 'initial_state': [0.0, 0.1, 0.1, 0.0, 0.0, 0.0]})
    assert peer.until(lambda: clock.get_subscription_count())
    began, now = time.monotonic(), 0.0

    def spin(until):
        nonlocal now
        while len(states) < until and time.monotonic() < began + 30:
            now = 100.0 + (time.monotonic() - began) * factor
            clock.publish(Clock(clock=to_stamp(now)))
            peer.spin(0.005)
    spin(10)
    stamps = [seconds(state.header.stamp) for state in states]
    assert np.median(np.diff(stamps)) == pytest.approx(0.05, abs=0.02)
    assert 100.0 <= stamps[0] < 110.0
    p = plant(initial_state=(0.0, 0.1, 0.1, 0.0, 0.0, 0.0))
    p.advance(stamps[-1] - stamps[0])
    np.testing.assert_allclose(to_state(states[-1]), p.x, atol=1e-6)
    began = time.monotonic()   # the simulator begins anew: the clock jumps back
    spin(25)
    again = [seconds(state.header.stamp) for state in states[-10:]]
    assert np.median(np.diff(again)) == pytest.approx(0.05, abs=0.02)
    assert 100.0 <= again[-1] <= now + 1e-6
    for before, after, passed in zip(states[-10:], states[-9:], np.diff(again)):
        p = plant(initial_state=to_state(before))
        p.advance(passed)
        np.testing.assert_allclose(to_state(after), p.x, atol=1e-6)


def test_ticks_that_the_clock_leaves_out_are_counted(peer, start_node):
    clock = peer.node.create_publisher(Clock, '/clock', 10)
    states, reports = peer.record(JOINT_STATES), peer.record(DIAGNOSTICS)
    start_node('plant', {'use_sim_time': True})

    def stepped(now, count):
        clock.publish(Clock(clock=to_stamp(now)))
        return len(states) >= count
    for count, now in enumerate((100.0, 100.05, 100.15, 101.0), 1):
        assert peer.until(lambda: stepped(now, count))
    assert peer.until(lambda: len(reports) >= 2)
    assert [from_diagnostics(report, 'plant').values['skipped_ticks'] for report in reports] == [
        0, 1 + 16]


def test_in_lockstep_a_controller_that_joins_late_gets_the_unanswered_state(peer, start_node):
    states = peer.record(JOINT_STATES)
    start_node('plant', {'lockstep': True})
    peer.publisher(FORCE_COMMAND).publish(Float64(data=3.0))
    assert peer.until(lambda: states)
    peer.spin(1.0)
    before = len(states)
    other = Peer('second_controller')
    heard = other.record(JOINT_STATES)
    forces = other.publisher(FORCE_COMMAND)
    assert other.until(lambda: heard)
    other.spin(1.0)
    peer.spin(0.2)
    assert heard == [states[-1]] and len(states) == before + 1
    forces.publish(Float64(data=1.0))
    assert other.until(lambda: len(heard) == 2)
    assert seconds(heard[1].header.stamp) == pytest.approx(
        seconds(heard[0].header.stamp) + 0.05)
    other.close()


def test_what_has_not_arrived_yet_is_not_lost(peer, start_node):
    reports = peer.record(DIAGNOSTICS)
    node, states = first_states(peer, start_node, delay=0.6)
    assert peer.until(lambda: len(reports) >= 2), node.output()
    values = [from_diagnostics(report, 'plant').values for report in reports]
    assert all(value['lost_states'] == 0 for value in values)
    np.testing.assert_allclose(to_state(states[0]), [0, math.pi, math.pi, 0, 0, 0], atol=1e-9)
    assert node.stop() == 0
