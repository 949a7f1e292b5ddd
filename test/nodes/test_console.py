# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The console between a page, which is a foreign WebSocket client here, and plant and mpc."""

import math
import os
from pathlib import Path
import signal
import time

from conftest import starting, wait_until
from pages import deaf, get, memory, Page, port_of
import pytest
from rcl_interfaces.msg import Parameter, ParameterEvent, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.messages.configuration import Configuration, from_text
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.urdf import urdf
from dp_swing_ros.tools import verify
from dp_swing_ros.topics import (
    CONFIGURATION, DISTURBANCE, JOINT_STATES, PLAN, ROBOT_DESCRIPTION, Topic, TRIES)

# in lockstep, so that a machine that is busy with something else only takes longer
UPRIGHT = {'initial_state': [0.0] * 6, 'pace': 2.0}
HANGING = [0.0, math.pi, math.pi, 0.0, 0.0, 0.0]
AWAY = ['-r', '__ns:=/away']
PARAMETER_EVENTS = Topic('/parameter_events', 'rcl_interfaces/msg/ParameterEvent')


def of(node):
    """Return a page of a console that has heard of plant and mpc."""
    page = Page(port_of(node))
    page.node = node
    page.until(lambda page: page.value('plant', 'rate') and page.value('mpc', 'horizon')
               and page.newest.get('frame', {}).get('tick') and page.newest['hello']['goals'])
    return page


@pytest.fixture(scope='module')
def nodes(tmp_path_factory):
    """Return a console of a plant and an mpc that many tests share, and its recordings."""
    folder = tmp_path_factory.mktemp('console')
    with starting(folder) as start:
        start('mpc').wait_for('ready')
        start('plant', {**UPRIGHT, 'lockstep': True})
        console = start('console', {'port': 0, 'recordings': str(folder / 'runs')})
        console.recordings = folder / 'runs'
        yield console


@pytest.fixture
def page(nodes):
    """Return a page of nodes with their defaults, upright."""
    with of(nodes) as page:
        assert page.ask('enable', on=True)['ok']
        assert page.ask('preset', name='defaults')['ok']
        begin(page)
        assert page.ask('reset', node='mpc')['ok']
        yield page
        page.ask('pause', on=False)   # where a test has let the plant wait


def begin(page, **plant):
    """Let the plant begin anew, with other parameters, once the page shows where it does."""
    page.until(lambda page: page.newest['hello']['pausable'])
    assert page.ask('pause', on=True)['ok']
    assert page.ask('set', node='plant', parameters={**UPRIGHT, **plant})['ok']
    assert page.ask('reset', node='plant')['ok']
    insist(page, lambda page: page.newest['frame']['t'] == 0.0 and tick(page),
           'reset', node='plant')
    assert page.ask('pause', on=False)['ok']
    page.until(lambda page: not page.newest['frame']['paused'])


def insist(page, condition, do, **fields):
    """Wait for a condition while paused; ask again where a message, best effort, was lost."""
    asked = time.monotonic()

    def is_there(page):
        nonlocal asked
        if time.monotonic() > asked + 5.0:
            assert page.ask(do, **fields)['ok']
            asked = time.monotonic()
        return condition(page)
    page.until(is_there)


def tick(page):
    """Return the tick of the newest frame, empty where the mpc was not heard in time."""
    return page.newest['frame']['tick'] or {}


def frames(page, count):
    """Receive frames of so many states; return them."""
    found = []
    for _ in range(count):
        before = page.newest['frame']['t']
        page.until(lambda page: page.newest['frame']['t'] != before)
        found.append(page.newest['frame'])
    return found


def newest_state(page):
    """Return the time of the newest state that the console has heard [s]."""
    return page.ask('history', kind='history')['t'][-1]


# without the nodes that tests share, which go on once they are there

@pytest.fixture(scope='module')
def away(tmp_path_factory):
    """Return a console in a namespace of its own."""
    with starting(tmp_path_factory.mktemp('away')) as start:
        yield start('console', {'port': 0}, AWAY)


def test_without_plant_and_mpc_there_is_a_page_and_they_may_come_and_go(away, start_here):
    with Page(port_of(away)) as page:
        page.until(lambda page: 'hello' in page.newest)
        assert page.newest['hello']['nodes'] == {'plant': None, 'mpc': None}
        assert 'frame' not in page.newest
        assert not page.ask('set', node='plant', parameters={})['ok']
        plant = start_here('plant', arguments=AWAY)
        page.until(lambda page: page.value('plant', 'rate') and 'frame' in page.newest)
        assert page.newest['hello']['nodes'] == {'plant': '/away/plant', 'mpc': None}
        assert page.newest['frame']['plan'] is None
        assert not page.newest['hello']['pausable']   # in real time
        answer = page.ask('pause', on=True)
        assert not answer['ok']
        assert 'lockstep:=true' in answer['text']
        assert 'in real time' in page.ask('pace', pace=0.5)['text']
        plant.stop()
        page.until(lambda page: page.newest['hello']['nodes']['plant'] is None)
        assert page.newest['parameters plant']['parameters'] == []
    assert 'Traceback' not in away.output()


def test_nothing_that_other_nodes_send_ends_it_or_keeps_frames_from_a_page(
        away, start_here, peer):
    start_here('plant', arguments=AWAY)
    senders = [(peer.publisher(topic._replace(name=f'/away/{topic.name.lstrip("/")}')), message)
               for topic, message in (
        (CONFIGURATION, String(data='node: /away/plant\nrate: 0.0')),
        (CONFIGURATION, String(data=Configuration(
            '/away/plant', {'lockstep': False, 'rate': 0.0}, '', '', '', '', {}).to_text())),
        (TRIES, PointCloud2(height=2, width=2 ** 31)), (PLAN, JointTrajectory()),
        (ROBOT_DESCRIPTION, String(data='<robot/>')))]
    senders.append((peer.publisher(PARAMETER_EVENTS), ParameterEvent(
        node='/away/plant', changed_parameters=[Parameter(
            name='rate', value=ParameterValue(type=99))])))

    def send():
        for publisher, message in senders:
            publisher.publish(message)
        peer.spin(0.1)

    with Page(port_of(away)) as page:
        page.until(lambda page: page.value('plant', 'rate') and 'frame' in page.newest)
        for _ in range(3):
            send()
            t = page.newest['frame']['t']
            page.until(lambda page: page.newest['frame']['t'] > t)
        # a plan, best effort, is lost until the console has found who sends it
        assert peer.until(lambda: send() or all(
            away.output().count(f'a message on {topic.name} is none') == 1
            for topic in (CONFIGURATION, TRIES, PLAN, ROBOT_DESCRIPTION)))
        assert page.value('plant', 'rate')['value'] == 20.0
        assert page.newest['hello']['period'] == 0.05
    assert 'Traceback' not in away.output()


def test_without_a_plant_a_kick_is_refused_and_a_signal_ends_it(away):
    with Page(port_of(away)) as page:
        page.until(lambda page: 'hello' in page.newest
                   and page.newest['hello']['nodes']['plant'] is None)
        answer = page.ask('push', force=5.0)
    assert not answer['ok'] and 'nothing to push' in answer['text'], answer
    assert away.stop() == 0   # for who is killed keeps what others share of their memory
    assert 'Traceback' not in away.output()


def test_a_given_token_is_told_to_nobody(start_here, peer):
    heard = [peer.record(topic) for topic in (
        CONFIGURATION, Topic('/rosout', 'rcl_interfaces/msg/Log'), PARAMETER_EVENTS)]
    node = start_here('console', {'port': 0, 'token': 'xyzzy'}, ['-r', '__node:=secret'])
    assert get(port_of(node), '/')[0].status == 403
    assert get(port_of(node), '/?token=xyzzy')[0].status == 200
    assert 'xyzzy' not in node.output()
    assert peer.until(lambda: '/secret' in {from_text(message.data).node for message in heard[0]})
    told = peer.call(GetParameters, '/secret/get_parameters', names=['token', 'token_file'])
    assert 'xyzzy' not in repr((heard, told))


def test_it_pulls_at_what_is_there_unless_told_how(start_here, peer):
    small = PendulumParameters(link1_length=0.25, link2_length=0.25, cart_mass=0.1,
                               link1_mass=0.05, link2_mass=0.05)
    port_of(start_here('console', {'port': 0, 'pull_limit': 30.0}, AWAY))
    publisher = peer.publisher(ROBOT_DESCRIPTION._replace(name='/away/robot_description'))

    def pull():
        answer = peer.call(GetParameters, '/away/console/get_parameters',
                           names=['pull_stiffness', 'pull_limit'])
        return [each.double_value for each in answer.values]

    assert pull() == [100.0, 30.0]
    publisher.publish(String(data=urdf(small, LimitParameters())))
    assert peer.until(lambda: pull() == [40.0, 30.0])
    peer.call(SetParametersAtomically, '/away/console/set_parameters_atomically', parameters=[
        Parameter(name='pull_stiffness', value=ParameterValue(type=3, double_value=50.0))])
    publisher.publish(String(data=urdf(PendulumParameters(), LimitParameters())))
    peer.spin(0.5)
    assert pull() == [50.0, 30.0]


# with them

def test_the_page_is_told_what_there_is_and_shown_each_state(page):
    answer = page.ask('set', node='mpc', parameters={'shown_tries': 5})
    assert answer['ok'], answer
    page.until(lambda page: all(page.newest['frame'][each] for each in ('tries', 'plan', 'tick')))
    hello, frame = page.newest['hello'], page.newest['frame']
    assert hello['nodes'] == {'plant': '/plant', 'mpc': '/mpc'}
    assert (hello['links'], hello['lengths'], hello['period']) == (2, [1.0, 1.0], 0.05)
    assert hello['limits'] == {'track': 2.4, 'margin': 0.4, 'force': 20.0, 'disturbance': 100.0}
    assert hello['goals'] == ['down_down', 'down_up', 'up_down', 'up_up']
    assert set(hello['solvers']) == {'ilqr', 'ddp', 'mppi'}
    assert hello['pausable']
    assert len(frame['x']) == len(frame['estimate']) == 6
    assert len(frame['plan']['X']) == 31
    assert len(frame['plan']['U']) == 30
    assert frame['plan']['dt'] == 0.05
    assert all(len(point) == 2 for path in frame['tries']['paths'] for point in path)
    assert frame['tick']['solver'] == 'ilqr'
    page.until(lambda page: {'name': 'plant', 'level': 0, 'message': 'obeys the force'} in
               page.newest['status']['statuses'])


def test_parameters_come_with_all_that_their_descriptors_tell(page):
    horizon = page.value('mpc', 'horizon')
    assert (horizon['type'], horizon['value'], horizon['default']) == ('integer', 30, 30)
    assert horizon['minimum'] >= 1
    assert page.value('plant', 'cart_mass') == {
        'name': 'cart_mass', 'type': 'double', 'value': 1.0, 'default': 1.0, 'unit': 'kg',
        'minimum': 0.001, 'maximum': None, 'choices': None, 'description': 'mass of the cart, m0',
        'read_only': False}
    weights = page.value('mpc', 'state_weights')
    assert (weights['type'], weights['minimum'], weights['default']) == (
        'double[]', 0.0, weights['value'])
    assert page.value('mpc', 'solver')['choices'] == ['ddp', 'ilqr', 'mppi']
    assert page.value('plant', 'lockstep')['read_only']


def test_parameters_change_and_what_is_refused_says_why_in_the_words_of_the_node(page):
    with Page(port_of(page.node)) as other:
        other.until(lambda page: page.value('mpc', 'solver'))
        answer = page.ask('set', node='mpc', parameters={'solver': 'ddp', 'horizon': 25})
        assert answer['ok'], answer
        for one in (page, other):   # whoever changed it
            one.until(lambda page: page.value('mpc', 'solver')['value'] == 'ddp')
            assert one.value('mpc', 'horizon')['value'] == 25
        page.until(lambda page: tick(page).get('solver') == 'ddp')
        for parameters, words in (
                ({'horizon': 0}, "'horizon' is 0; expected at least 1"),
                ({'horizon': 2.5}, 'expected integer'),
                ({'solver': 'best'}, 'expected one of'), ({'nonsense': 1}, 'no parameter'),
                ({'force_weight': 'x'}, 'expected double'), ({'links': 3}, 'read-only')):
            answer = page.ask('set', node='mpc', parameters=parameters)
            assert not answer['ok']
            assert words in answer['text'], answer
        assert page.ask('goal', name='down_up')['ok']
        assert not page.ask('goal', name='sideways')['ok']
        page.until(lambda page: page.value('mpc', 'goal')['value'] == 'down_up')


def test_presets_change_what_can_change_and_defaults_put_it_back(page):
    assert {'defaults', 'paper', 'rig', 'textbook_mppi'} <= set(page.newest['hello']['presets'])
    assert 'ros2_control' not in page.newest['hello']['presets']
    assert page.ask('preset', name='textbook_mppi')['ok']
    page.until(lambda page: page.value('mpc', 'mppi.samples')['value'] == 1024)
    assert not page.ask('preset', name='nonsense')['ok']
    # a switch that is off stays off, and what has no limit by default has none again
    held = {'enabled': False, 'cart_speed_limit': 4.0}
    assert page.ask('set', node='mpc', parameters=held)['ok']
    page.until(lambda page: page.value('mpc', 'cart_speed_limit')['value'] == 4.0)
    assert page.ask('preset', name='defaults')['ok']
    page.until(lambda page: all(
        each['value'] == each['default'] for each in page.newest['parameters mpc']['parameters']
        if each['name'] != 'enabled'))
    assert page.value('mpc', 'enabled')['value'] is False
    assert page.ask('set', node='mpc', parameters={'enabled': True})['ok']
    begin(page)   # at its pace


def quiet(peer, pushes):
    """Return whether nobody pushes for a while."""
    before = len(pushes)
    peer.spin(0.3)
    return len(pushes) == before


def test_a_pull_is_a_force_in_its_direction_that_is_bounded_and_ends(page, peer):
    pushes = peer.record(DISTURBANCE)
    peer.meet('console')   # else the first push may be lost
    assert page.ask('enable', on=False)['ok']
    for to in (0.1, 50.0, -50.0):
        begin(page, initial_state=HANGING)
        assert peer.until(lambda: quiet(peer, pushes))
        pushes.clear()
        before = newest_state(page)
        while len(pushes) < 6:   # as fast as a browser draws
            page.send('pull', body=0, along=0.0, to=[to, 0.0])
            peer.spin(0.016)
            page.receive()
        peer.spin(0.1)
        forces = [message.data for message in pushes]
        states = round((newest_state(page) - before) / 0.05)
        assert len(forces) <= states + 2   # one a state, however often it is asked for
        # where 10 N pull, the cart may be there soon
        assert all(force * to > 0 for force in forces[:3 if abs(to) > 1 else 1])
        assert abs(forces[0]) == pytest.approx(30.0 if abs(to) > 1 else 10.0, abs=1.5)
        assert max(map(abs, forces)) <= 30.0
        assert peer.until(lambda: quiet(peer, pushes))
        assert quiet(peer, pushes)


def test_hands_of_a_page_that_is_gone_let_go_and_a_kick_lasts_a_period(page, peer):
    pushes = peer.record(DISTURBANCE)
    peer.meet('console')   # else the first push may be lost
    assert page.ask('push', force=1.0)['ok']
    assert peer.until(lambda: pushes)
    page.until(lambda page: page.newest['frame']['push'] == 0.0)
    peer.spin(0.2)
    pushes.clear()
    # on a busy machine the one frame of its period may be left out
    kicks = next(count for count in range(1, 21) if page.ask('push', force=3.0)['ok'] and any(
        frame['push'] == 3.0 for frame in (page.newest['frame'], *frames(page, 10))))
    page.until(lambda page: page.newest['frame']['push'] == 0.0)
    peer.spin(0.2)
    assert [message.data for message in pushes] == [3.0] * kicks
    with Page(port_of(page.node)) as other:
        other.send('hold', force=-2.0)
        assert peer.until(lambda: pushes[-1].data == -2.0)
        # again and again, as one lasts 0.3 s, and the console may be held up for longer
        page.until(lambda page: other.send('hold', force=-2.0)
                   or page.newest['frame']['push'] == -2.0)
    page.until(lambda page: page.newest['frame']['push'] == 0.0)
    assert peer.until(lambda: quiet(peer, pushes))
    pushes.clear()
    frames(page, 10)
    peer.spin(0.1)
    assert not pushes


def test_a_link_is_pulled_at_the_place_that_was_taken(page, peer):
    pushes = peer.record(DISTURBANCE)
    peer.meet('console')   # else the first push may be lost
    assert page.ask('enable', on=False)['ok']
    leaning = math.asin(0.5)
    for body, along, place in ((0, 0.5, 0.2), (1, 0.0, 0.2), (1, 1.0, 0.7), (2, 0.5, 0.45),
                               (2, 1.0, 0.2), (99, 1.0, 0.2)):
        begin(page, gravity=1e-6, initial_state=[0.2, leaning, -leaning, 0.0, 0.0, 0.0])
        assert peer.until(lambda: quiet(peer, pushes))
        pushes.clear()
        page.send('pull', body=body, along=along, to=[place + 0.05, 2.0])
        assert peer.until(lambda: pushes)
        assert pushes[0].data == pytest.approx(5.0, abs=2.0), (body, along)
        page.send('release')


def test_services_answer_in_their_own_words(page):
    assert page.ask('reset', node='plant')['text'] == 'the plant is back at its initial state'
    assert page.ask('reset', node='mpc')['text'] == 'the next tick is a first one'
    assert page.ask('enable', on=False)['text'] == 'disabled: zero force'
    page.until(lambda page: tick(page).get('enabled') == 0)
    assert page.ask('enable', on=True)['ok']
    assert page.ask('reference', x=0.3)['ok']
    page.until(lambda page: page.value('mpc', 'reference')['value'][0] == 0.3)
    page.until(lambda page: abs(page.newest['frame']['x'][0] - 0.3) < 0.05)


def test_lockstep_can_be_paused_stepped_and_slowed_down(page):
    page.until(lambda page: page.newest['hello']['pausable'])
    assert page.ask('pause', on=True)['ok']
    insist(page, lambda page: page.newest['frame']['paused'] and page.newest['frame']['plan']
           and page.newest['frame']['plan']['t'] == page.newest['frame']['t'], 'step')
    t = page.newest['frame']['t']
    assert page.ask('step')['ok']
    page.until(lambda page: page.newest['frame']['t'] > t)
    assert page.newest['frame']['t'] == pytest.approx(t + 0.05)
    assert page.ask('pace', pace=0.5)['ok']
    assert page.ask('pause', on=False)['ok']
    page.until(lambda page: not page.newest['frame']['paused'])
    t = page.newest['frame']['t']
    page.until(lambda page: page.newest['frame']['t'] > t + 0.3)
    assert page.value('plant', 'pace')['value'] == 0.5


def test_a_recording_comes_out_again_and_has_a_report(page, capsys):
    assert page.ask('pace', pace=0.5)['ok']   # so that 60 s of the run outlast a slow logger
    before = frames(page, 5)[-1]['t']
    answer = page.ask('record', on=True)
    assert answer['ok'], answer
    assert not page.ask('record', on=True)['ok']
    page.until(lambda page: page.newest['recording']['folder'])
    assert page.ask('past', kind='past', at=before)['frame']   # a logger that begins ends nothing
    assert page.ask('push', force=5.0)['ok']
    assert page.ask('set', node='mpc', parameters={'solver': 'ddp'})['ok']
    page.until(lambda page: tick(page).get('solver') == 'ddp')
    frames(page, 20)
    assert page.ask('record', on=False)['ok']
    assert page.ask('pause', on=True)['ok']   # while the report is made
    page.until(lambda page: page.newest['recording']['finished']
               and page.newest['recording']['finished'][0]['report'])
    assert page.newest['recording']['folder'] is None
    finished = page.newest['recording']['finished'][0]
    port = port_of(page.node)
    assert b'<html' in get(port, finished['report'])[1]
    bag = page.node.recordings / finished['name'] / 'bag'
    assert get(port, finished['bag'])[1] == (bag / 'bag_0.mcap').read_bytes()
    assert [message.data for message in Bag(bag).of(DISTURBANCE)] == [5.0]
    assert len(Bag(bag).of(JOINT_STATES)) > 20
    code, output = verify.main([str(bag)]), capsys.readouterr()
    assert code == 0, output
    assert 'every force is the recorded one to the bit' in output.out
    assert not page.ask('record', on=False)['ok']


def test_a_page_that_does_not_read_keeps_nothing_from_others_and_takes_no_memory(page):
    begin(page, rate=200.0, pace=0.5)   # of which a page is shown some

    def held():
        assert page.ask('push', force=0.0)['ok']   # its answer comes after the frames before it
        return memory(page.node), page.newest['frame']['t']

    def growth():
        frames(page, 60)   # until the queues of the kernel are full
        before, t = held()
        frames(page, 100)
        after, end = held()
        assert end > t
        return after - before, end - t   # [bytes] in a time of the run [s]

    before = growth()
    with deaf(port_of(page.node)):
        grown, passed = growth()
    # of the last minute, to look back; twice, as at first that may fill what was free
    kept = max(size / seconds for size, seconds in (before, growth()))
    assert grown < kept * passed + (4 << 20)
    assert 'Traceback' not in page.node.output()


def test_an_instant_of_the_last_minute_is_branched_from(page):
    """Of a run after a reset in lockstep: of the one before, as long, nothing is left."""
    page.until(lambda page: page.newest['frame']['t'] > 3.0)
    begin(page, initial_state=HANGING, pace=0.5)   # so that a busy machine misses few states
    frames(page, 10)
    assert page.ask('set', node='mpc', parameters={'force_weight': 0.02, 'solver': 'ddp'})['ok']
    assert page.ask('set', node='plant', parameters={'cart_mass': 1.1})['ok']
    page.until(lambda page: tick(page).get('solver') == 'ddp')
    switched = page.newest['frame']['t']
    os.killpg(page.node.popen.pid, signal.SIGSTOP)   # as on a busy machine, so that it misses some
    time.sleep(2.0)
    os.killpg(page.node.popen.pid, signal.SIGCONT)
    page.until(lambda page: page.newest['frame']['t'] > switched + 4.5
               and len(page.ask('history', kind='history')['t']) >= 75)
    assert page.ask('pause', on=True)['ok']   # while solvers are at work
    past = page.ask('history', kind='history')
    assert len(past['t']) == len(past['x']) == len(past['u']) == len(past['force']) >= 75
    assert past['t'] == sorted(past['t'])
    assert past['t'][0] == 0.0
    at = next(t for t in past['t'] if t > switched + 1.5)
    received = []
    page.send('branch', id=1, at=at, duration=1.5)
    page.until(lambda page: 'branch' in page.newest and (
        received.append(page.newest.pop('branch'))
        or received[-1]['trajectories'] or received[-1]['text']))
    assert [each['progress'] for each in received] == sorted(each['progress'] for each in received)
    trajectories = received[-1]['trajectories']
    assert trajectories, received[-1]['text']
    assert set(trajectories) == {'recorded ddp', 'ilqr', 'ddp', 'mppi'}, received[-1]
    # the first tick from there on: on a busy machine it may miss more of them
    assert at - 1e-3 < received[-1]['at'] < at + 1.4
    at = received[-1]['at']
    assert min(abs(t - at) for t in past['t']) < 1e-3
    for trajectory in trajectories.values():
        assert trajectory['t'][0] == pytest.approx(at, abs=1e-3)
        assert trajectory['t'][-1] == pytest.approx(at + 1.5, abs=0.1)
        assert len(trajectory['X']) == len(trajectory['t']) == len(trajectory['U']) + 1
        assert trajectory['X'][0] == trajectories['ddp']['X'][0]
        assert trajectory['regret'] >= 0
        assert trajectory['settled'] is None or at <= trajectory['settled'] + 1e-3 <= at + 1.6
    # the same solver, with what it ran with then, does nearly the same
    assert trajectories['ddp']['X'][10] == pytest.approx(
        trajectories['recorded ddp']['X'][10], abs=0.05)
    page.send('branch', id=2, at=past['t'][-1] + 100, duration=1)
    page.until(lambda page: page.newest.get('branch', {}).get('id') == 2
               and 'there is no tick' in page.newest['branch']['text'])


def test_an_instant_of_the_last_minute_is_shown_as_it_was(page):
    shown = {frame['t']: frame for frame in frames(page, 40) if frame['tick'] and frame['plan']
             and frame['plan']['t'] == frame['t']}
    frames(page, 30)
    past = page.ask('history', kind='history')
    for t in sorted(shown)[10:30:5]:
        then = page.ask('past', kind='past', at=t)['frame']
        for name in ('x', 'u', 'push', 'force', 'plan', 'estimate', 'tick'):
            assert then[name] == shown[t][name], name
        n = past['t'].index(t)
        assert past['figures']['cost'][n] == then['tick']['cost']
        assert past['force'][n] == then['force']
    answer = page.ask('past', at=past['t'][-1] - 1e6)
    assert (answer['ok'], 'nothing is kept' in answer['text']) == (False, True)


def test_a_recording_is_whole_even_where_the_console_is_killed(nodes):
    """The last one, for there is no console from then on."""
    with of(nodes) as page:
        with Page(port_of(nodes)) as other:   # somebody else, who may not end it meanwhile
            page.send('record', on=True, id='begins')
            other.until(lambda other: other.newest.get('recording', {}).get('folder'))
            refused = other.ask('record', on=False)
        assert not refused['ok'] and 'still starting' in refused['text'], refused
        page.until(lambda page: page.newest.get('answer', {}).get('id') == 'begins')
        assert page.newest['answer']['ok']
        folder = Path(page.until(lambda page: page.newest['recording']['folder']))
        frames(page, 20)
        nodes.signal(signal.SIGKILL)
    assert wait_until(lambda: (folder / 'bag' / 'metadata.yaml').exists()
                      and Bag(folder / 'bag').incomplete == '')
    assert len(Bag(folder / 'bag').of(JOINT_STATES)) > 10
