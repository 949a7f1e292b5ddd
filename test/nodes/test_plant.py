# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The plant as a node: its topics, services and parameters, whom it meets, and how it ends.

What it does with what comes is tested in virtual time: test/runtime/test_plant.py.
"""

from contextlib import ExitStack
import functools
import math
import time
from xml.etree import ElementTree

from conftest import PATIENCE
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
from one_process import Crew
from peer import Peer
import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String
from std_srvs.srv import SetBool, Trigger
from test_live import put

from dp_swing_ros.messages import fields
from dp_swing_ros.messages.configuration import from_text
from dp_swing_ros.messages.fields import from_diagnostics, seconds
from dp_swing_ros.nodes.connections import request_for
from dp_swing_ros.nodes.logger import LoggerNode
from dp_swing_ros.nodes.messages import to_stamp
from dp_swing_ros.nodes.mpc import MpcNode
from dp_swing_ros.nodes.plant import PlantNode
from dp_swing_ros.pendulum.state import hanging, joints
from dp_swing_ros.tools import verify
from dp_swing_ros.topics import (
    CONFIGURATION, DIAGNOSTICS, DISTURBANCE, FORCE_COMMAND, JOINT_STATES)

to_state = functools.partial(fields.to_state, links=2)


def first_states(peer, start_here, count=5, **parameters):
    states = peer.record(JOINT_STATES)
    node = start_here('plant', parameters)
    node.wait_for('states a second')   # the first time it compiles before
    assert peer.until(lambda: len(states) >= count), node.output()
    return node, states


def gap(states):
    """Return the median time [s] between the last ten states."""
    return np.median(np.diff([seconds(state.header.stamp) for state in states[-11:]]))


def last(reports):
    """Return the last report of the plant on itself."""
    return [each for each in (from_diagnostics(report, 'plant') for report in reports) if each][-1]


def services(peer):
    """Return functions that pause the plant and let it step, which return what it answers."""
    def answered(kind, name, **request):
        answer = peer.call(kind, name, **request)
        return answer.success, answer.message
    return (lambda paused: answered(SetBool, 'plant/pause', data=paused),
            lambda: answered(Trigger, 'plant/step'))


def test_in_real_time_it_obeys_what_comes_and_says_what_it_refuses(peer, start_here):
    reports, told = peer.record(DIAGNOSTICS), peer.record(CONFIGURATION)

    def now():
        return peer.node.get_clock().now().nanoseconds / 1e9
    began = now()
    node, states = first_states(peer, start_here, 20, link2_length=0.7)
    assert list(states[0].name) == ['cart', 'joint1', 'joint2']
    assert peer.until(lambda: gap(states) == pytest.approx(0.05, abs=0.01))
    stamp = seconds(states[-1].header.stamp)
    assert began < stamp < now()
    forces, pushes = peer.publisher(FORCE_COMMAND), peer.publisher(DISTURBANCE)

    def forced():
        forces.publish(Float64(data=50.0))
        return max(state.effort[0] for state in states) == 20.0 and states[-1].position[0] > 0.05
    assert peer.until(forced)
    forces.publish(Float64(data=math.nan))
    node.wait_for('refused a force of nan; expected a finite number')
    pushes.publish(Float64(data=1e6))
    node.wait_for('refused a disturbance of 1e+06 N')
    node.wait_for('no force for 0.2 s; the force is zero until the next')
    assert peer.until(lambda: states[-1].effort[0] == 0.0)
    assert peer.until(lambda: last(reports).values['refused_disturbances'] == 1)
    assert last(reports).values['refused'] == 1 and last(reports).level == DiagnosticStatus.WARN[0]
    pushes.publish(Float64(data=5.0))
    assert peer.until(lambda: last(reports).values['push'] == 5.0)
    pause, step = services(peer)
    for success, message in (pause(True), step()):
        assert not success and 'lockstep:=true' in message
    assert 'lockstep:=true' in put(peer, 'plant', pace=0.5)
    assert put(peer, 'plant', rate=100.0, start='up_down', link2_length=0.8) == ''
    assert peer.until(lambda: gap(states) < 0.02)
    before = len(states)
    assert peer.call(Trigger, 'plant/reset').success
    assert peer.until(lambda: any(to_state(state).tolist() == [0.0, 0.0, math.pi, 0.0, 0.0, 0.0]
                                  for state in states[before:]))

    def announced():
        return [(each.revision, each.resets) for each in (from_text(text.data) for text in told)
                if each.node == '/plant']
    assert peer.until(lambda: announced()[-2:] == [(1, 0), (1, 1)])
    texts = []   # for whoever joins late
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    peer.node.create_subscription(String, 'robot_description', texts.append, latched)
    assert peer.until(lambda: texts)
    cylinders = ElementTree.fromstring(texts[0].data).findall('link//cylinder')
    assert '0.8' in [cylinder.get('length') for cylinder in cylinders]
    assert node.stop() == 0
    assert 'Traceback' not in node.output()


def test_lockstep_waits_for_a_bare_publisher_and_is_stopped_and_slowed_down(peer, start_here):
    states, reports = peer.record(JOINT_STATES), peer.record(DIAGNOSTICS)
    node = start_here('plant', {'lockstep': True, 'links': 3, 'duration': 1.0})
    node.wait_for('waiting for a controller')
    peer.spin(0.5)
    assert not states
    forces = peer.publisher(FORCE_COMMAND)
    assert peer.until(lambda: states)
    assert list(states[0].name) == list(joints(3)) and len(states[0].effort) == 4
    np.testing.assert_array_equal(fields.to_state(states[0], 3), hanging(3))

    def answer(force):
        """Return how many states there are with the one that answers."""
        count = len(states)
        forces.publish(Float64(data=force))
        assert peer.until(lambda: len(states) > count)
        assert states[-1].effort[0] == force
        return len(states)
    for n in range(1, 6):
        assert answer(float(n)) == n + 1
    pause, step = services(peer)
    assert step() == (False, 'not paused; call plant/pause first')
    assert pause(True) == (True, 'paused')
    assert peer.until(lambda: last(reports).message == 'paused')
    forces.publish(Float64(data=7.0))
    peer.spin(0.3)
    assert len(states) == 6
    assert step() == (True, 'a period has passed')
    assert peer.until(lambda: len(states) == 7)
    assert pause(False) == (True, 'going on')
    assert put(peer, 'plant', pace=0.001) == ''
    answer(8.0)
    forces.publish(Float64(data=9.0))   # for 50 s
    peer.spin(0.3)
    assert len(states) == 8
    assert put(peer, 'plant', pace=0.0) == ''
    assert peer.until(lambda: len(states) == 9)
    assert [seconds(state.header.stamp) for state in states] == pytest.approx(
        np.arange(9) * 0.05)
    assert put(peer, 'plant', pace=10.0) == ''   # each after a wait
    assert peer.call(Trigger, 'plant/reset').success
    assert peer.until(lambda: len(states) == 10)
    assert seconds(states[-1].header.stamp) == 0.0
    forces.publish(Float64(data=7.0))   # to the state before
    for _ in range(20):
        answer(1.0)
    assert node.wait() == 0
    assert seconds(states[-1].header.stamp) == 1.0


def test_with_simulated_time_it_goes_as_the_clock_does(peer, start_here):
    clock = peer.node.create_publisher(Clock, '/clock', 10)
    states, reports = peer.record(JOINT_STATES), peer.record(DIAGNOSTICS)
    node = start_here('plant', {'use_sim_time': True})

    def stepped(now, count):
        clock.publish(Clock(clock=to_stamp(now)))
        return len(states) >= count
    for count, now in enumerate((100.0, 100.05, 100.15, 101.0), 1):
        assert peer.until(lambda: stepped(now, count))
        assert seconds(states[-1].header.stamp) == pytest.approx(now)
    assert peer.until(lambda: len(reports) >= 2)
    assert [from_diagnostics(report, 'plant').values['skipped_ticks'] for report in reports] == [
        0, 1 + 16]
    node.wait_for('as /clock goes')
    # not followed for days of integration; later it begins anew
    for now in (1e6 + 101.0, 1e6 + 101.05, 50.0, 50.05, 50.1, 50.15):
        peer.until(lambda: stepped(now, 1000), timeout=0.5)
        assert len(states) < 12
    assert peer.until(lambda: stepped(now, 1)
                      and seconds(states[-1].header.stamp) == pytest.approx(50.15))
    assert 'the clock jumped by +1e+06 s; the pendulum goes on from where it was' in node.output()
    np.testing.assert_allclose(to_state(states[-1]), [0, math.pi, math.pi, 0, 0, 0], atol=1e-9)
    assert node.stop() == 0


def test_in_lockstep_a_controller_that_joins_late_gets_the_unanswered_state(peer, start_here):
    states = peer.record(JOINT_STATES)
    start_here('plant', {'lockstep': True})
    peer.publisher(FORCE_COMMAND).publish(Float64(data=3.0))
    assert peer.until(lambda: states)
    peer.spin(1.0)
    before = len(states)
    other = Peer('second_controller')
    heard = other.record(JOINT_STATES)
    forces = other.publisher(FORCE_COMMAND)
    assert other.until(lambda: heard)
    other.spin(1.0)
    assert peer.until(lambda: len(states) > before)
    peer.spin(0.2)
    assert heard == [states[-1]] and len(states) == before + 1
    forces.publish(Float64(data=1.0))
    assert other.until(lambda: len(heard) == 2)
    assert seconds(heard[1].header.stamp) == pytest.approx(
        seconds(heard[0].header.stamp) + 0.05)
    other.close()


def test_two_plants_and_two_mpcs_name_each_other_and_are_the_cause(tmp_path, capfd):
    bag, said = str(tmp_path / 'bag'), []

    def has_said(name, topic, kind):
        return any(f'[{name}]: ' in line and f'{topic} has 2 publishers, /{kind}, '
                   f'/second_{kind}; expected one' in line for line in said)
    with ExitStack() as stack:
        kinds = {'mpc': MpcNode, 'plant': PlantNode}
        crews = [stack.enter_context(Crew(
            tmp_path / f'{name}.yaml', {'logger': {'output': bag, 'progress_period': 0.0}},
            [] if name == 'both' else ['-r', f'__node:={name}'])) for name in (
                'both', 'second_mpc', 'second_plant')]
        logger, *_ = (crews[0].start(kind) for kind in (LoggerNode, *kinds.values()))
        for crew, kind in zip(crews[1:], kinds.values()):
            crew.start(kind)
        end = time.monotonic() + PATIENCE
        while not all(has_said(name, topic, kind) for each in kinds
                      for name in (each, f'second_{each}') for topic, kind in (
                          ('/force_command', 'mpc'), ('/joint_states', 'plant'))):
            assert time.monotonic() < end, said
            for crew in crews:
                crew.executor.spin_once(0.01)
            said += capfd.readouterr().err.splitlines()
        logger.close()
    assert verify.main([bag, '--node', '/mpc', '--node', '/plant']) != 0
    shown = ''.join(capfd.readouterr())
    for topic, kind in (('/force_command', 'mpc'), ('/joint_states', 'plant')):
        assert shown.count(f'{topic} has 2 publishers, /{kind}, /second_{kind}') == 1
    assert 'likely cause: ' in shown


def late_states(peer, name='/joint_states'):
    """Return a list that fills with the states as a reader asks for them that comes late."""
    states = []
    assert peer.until(lambda: peer.node.get_publishers_info_by_topic(name))
    profile = request_for([
        each.qos_profile for each in peer.node.get_publishers_info_by_topic(name)])
    peer.node.create_subscription(JointState, name, states.append, profile)
    return states


def test_states_are_kept_for_who_asks_for_it(peer, start_here):
    node, states = first_states(peer, start_here, 20, **{
        'qos_overrides./joint_states.publisher.durability': 'transient_local',
        'qos_overrides./joint_states.publisher.depth': 1000})
    before = list(states)   # from the first on, if the plant found its reader in time
    late = late_states(peer)
    assert peer.until(lambda: before[-1] in late)
    first = late.index(before[0])
    assert late[first:first + len(before)] == before
    assert node.stop() == 0


@pytest.mark.parametrize(('name', 'value', 'words'), [
    ('link1_masss', 1.0, "did you mean 'link1_mass'"),
    ('qos_overrides./joint_states.publisher.durability', 'for ever', 'is impossible'),
    ('qos_overrides./joint_state.publisher.depth', 9,
     "did you mean 'qos_overrides./joint_states.publisher.")])
def test_what_is_impossible_ends_it_with_one_line(start_here, name, value, words):
    node = start_here('plant', {name: value})
    assert node.wait() == 2
    last = node.output().strip().splitlines()[-1]
    assert last.startswith('plant: error: ') and words in last, node.output()
    assert 'Traceback' not in node.output()


def topics_of(reports):
    """Return the reports of the plant on its topics."""
    found = (from_diagnostics(report, 'plant: topics') for report in reports)
    return [report for report in found if report is not None]


def test_all_who_listen_hear_it_and_who_cannot_is_named(peer, start_here, monkeypatch):
    """From the same first state on; whoever comes later hears what is new."""
    # so that on a busy machine, too, it begins once both are found
    monkeypatch.setattr('dp_swing_ros.nodes.plant.PATIENCE', 60.0)
    monkeypatch.setattr('dp_swing_ros.nodes.connections.QUIET', 150)
    namespace = '/second'
    reports = peer.record(DIAGNOSTICS)
    start_here('plant', arguments=['-r', f'__ns:={namespace}']).wait_for('states a second')
    topic = JOINT_STATES._replace(name=f'{namespace}/joint_states')
    states, other = peer.record(topic), peer.record(topic)   # found later than it is ready
    assert peer.until(lambda: len(other) > 2 and reports)
    assert to_state(states[0]).tolist() == to_state(other[0]).tolist() == [
        0.0, math.pi, math.pi, 0.0, 0.0, 0.0]
    assert states[0].header.stamp == other[0].header.stamp
    assert (reports[0].status[0].name, reports[0].status[0].hardware_id) == (
        'second/plant', '/second/joint_states')
    newest = seconds(states[-1].header.stamp)
    late = late_states(peer, topic.name)
    assert peer.until(lambda: late)
    assert seconds(late[0].header.stamp) >= newest
    commands = FORCE_COMMAND._replace(name=f'{namespace}/force_command')
    peer.publisher(commands)
    peer.spin(1.5)
    assert not topics_of(reports)
    peer.publisher(commands)

    def level_with(words):
        """Return the level of the last report, once it has some words."""
        # at first the name of a node may not be known
        assert peer.until(lambda: any(words in each.message for each in topics_of(reports)[-1:]))
        return topics_of(reports)[-1].level
    assert level_with('/second/force_command has 2 publishers, /peer, /peer; expected one'
                      ) == DiagnosticStatus.WARN[0]
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    deaf = peer.node.create_subscription(JointState, topic.name, print, latched)
    assert level_with(f'{topic.name} from /second/plant to /peer: durability volatile is offered'
                      ) == DiagnosticStatus.ERROR[0]
    peer.node.destroy_subscription(deaf)
    assert peer.until(lambda: topics_of(reports)[-1].level == DiagnosticStatus.WARN[0])
