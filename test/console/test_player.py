# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A recorded run in the page, without ROS."""

import signal
import subprocess
import sys

from conftest import starting
from pages import Page, port_of
import pytest
from real_bags import stalled
from recorded_runs import START, written
from synthetic import swing_up

from dp_swing_ros.bags.episodes import read_episode
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.console.player import parameters_of, Tape
from dp_swing_ros.declarations import DECLARATIONS
from dp_swing_ros.nodes.messages import to_joint_state, to_stamp
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.tools.console import main
from dp_swing_ros.topics import JOINT_STATES


@pytest.fixture(scope='module')
def console(lockstep_bag, tmp_path_factory):
    """Return a console that plays a bag, one for all tests."""
    with starting(tmp_path_factory.mktemp('console')) as start:
        node = start('console', options=[str(lockstep_bag), '--port', '0'])
        port_of(node)
        yield node


@pytest.fixture
def page(console):
    """Return a page on a bag, with a clock of its own."""
    with Page(port_of(console)) as page:
        page.node = console
        page.until(lambda page: 'frame' in page.newest and 'hello' in page.newest)
        yield page


def test_a_bag_is_played_and_stops_at_its_end(page):
    hello = page.newest['hello']
    assert (hello['replay'], hello['duration']) == (True, pytest.approx(5.0))
    assert hello['nodes'] == {'plant': '/plant', 'mpc': '/mpc'}
    assert not page.newest['frame']['paused']
    assert page.ask('play', on=True, rate=5.0)['ok']
    page.until(lambda page: page.newest['frame']['paused'])
    assert page.newest['frame']['t'] == pytest.approx(5.0)
    assert page.ask('play', on=True, rate=1.0)['ok']   # from the beginning
    page.until(lambda page: page.newest['frame']['t'] < 0.5)
    solver = page.value('mpc', 'solver')
    assert (solver['value'], solver['read_only']) == ('ilqr', True)


def test_each_state_can_be_sought_and_is_the_recorded_one(page, lockstep_bag):
    episode = read_episode(lockstep_bag)
    assert page.ask('play', on=False, rate=1.0)['ok']
    for n in (60, 3, 100, 0, 61):
        page.send('seek', at=float(episode.t[n]) + 0.01)
        frame = page.until(lambda page: page.newest['frame']['t'] == pytest.approx(episode.t[n])
                           and page.newest['frame'])
        assert frame['x'] == pytest.approx(episode.X[n].tolist(), abs=1e-4)
        assert frame['time'] == frame['t']
        assert frame['paused']
        if n > 0:   # in lockstep the next state may be faster than the plan that answers this one
            assert frame['t'] - frame['plan']['t'] == pytest.approx(0.025, abs=0.026)
            assert frame['tick']['solver'] == 'ilqr'
    for by, n in ((1, 62), (1, 63), (-2, 61)):
        page.send('skip', states=by)
        page.until(lambda page: page.newest['frame']['t'] == pytest.approx(episode.t[n]))
    for at in (-5.0, 99.0):
        page.send('seek', at=at)
        page.until(lambda page: page.newest['frame']['t'] == pytest.approx(5.0 * (at > 0)))


def test_a_logger_that_was_busy_changes_nothing(lockstep_bag, tmp_path):
    late = stalled(lockstep_bag, tmp_path / 'late', span=1_000_000_000)
    tapes = [Tape(Bag(folder)) for folder in (lockstep_bag, late)]
    for n in range(0, len(tapes[0].moments), 10):
        frames = [tape.scene_at(n).frame() for tape in tapes]
        assert frames[0] == frames[1]


def test_a_run_after_a_reset_in_lockstep_follows_the_one_before(tmp_path):
    """Where the recording began in mid-run, and time at zero again; one state is sent twice."""
    run = swing_up(duration=1.0)
    times = [30.0, 30.05, 30.1, 30.1, 30.15, 0.0, 0.05, 0.1, 0.15, 0.2]
    with written(tmp_path / 'bag', [JOINT_STATES]) as write:
        for n, t in enumerate(times):
            write(JOINT_STATES, START + n * 50_000_000, to_joint_state(
                to_stamp(round(t * 1e9)), run.X[n], 0.0))
    tape = Tape(Bag(tmp_path / 'bag'))
    kept = [0, 1, 2, 4, 5, 6, 7, 8, 9]
    assert tape.times == pytest.approx([0.05 * n for n in range(len(kept))])
    for index, n in enumerate(kept):
        assert tape.scene_at(index).frame()['x'] == pytest.approx(run.X[n].tolist(), abs=1e-4)
    assert [row.t for row in tape.rows()] == pytest.approx(tape.times)


def test_a_state_that_is_overtaken_is_left_out(tmp_path):
    run = swing_up(duration=1.0)
    with written(tmp_path / 'bag', [JOINT_STATES]) as write:
        for n, t in enumerate([5.0, 5.05, 5.15, 5.1, 5.2]):
            write(JOINT_STATES, START + n * 50_000_000, to_joint_state(
                to_stamp(round(t * 1e9)), run.X[n], 0.0))
    assert Tape(Bag(tmp_path / 'bag')).times == pytest.approx([0.0, 0.05, 0.15, 0.2])


def test_pages_have_clocks_of_their_own_and_can_change_nothing(page):
    with Page(port_of(page.node)) as other:
        other.until(lambda page: 'frame' in page.newest)
        assert page.ask('play', on=False, rate=1.0)['ok']
        page.send('seek', at=1.0)
        page.until(lambda page: page.newest['frame']['t'] == pytest.approx(1.0))
        other.until(lambda page: page.newest['frame']['t'] > 1.5)
        answer = page.ask('set', node='mpc', parameters={'horizon': 20})
        assert not answer['ok']
        assert 'this one is recorded' in answer['text']
        assert page.newest['frame']['t'] == pytest.approx(1.0)


def test_the_past_and_branches_are_there_too(page, lockstep_bag):
    past = page.ask('history', kind='history')
    episode = read_episode(lockstep_bag)
    assert past['t'] == pytest.approx(episode.t.tolist(), abs=1e-6)
    assert past['x'][50] == pytest.approx(episode.X[50].tolist(), abs=1e-4)
    for field in ('u', 'force', 'push', *past['figures'].values()):
        assert len(past[field] if isinstance(field, str) else field) == len(past['t'])
    ticks = {'cost', 'cost_angles', 'solve_time', 'latency', 'iterations'}
    assert ticks <= set(past['figures'])
    page.ask('play', on=False, rate=1.0)
    page.send('seek', at=past['t'][50])
    frame = page.until(lambda page: page.newest['frame']['t'] == past['t'][50]
                       and page.newest['frame'])
    assert {name: past['figures'][name][50] for name in ticks} == {
        name: frame['tick'][name] for name in ticks}
    page.send('branch', id=7, at=1.0, duration=2.0)
    page.until(lambda page: page.newest.get('branch', {}).get('trajectories'))
    trajectories = page.newest['branch']['trajectories']
    assert len(trajectories) == 1 + len(SOLVERS)
    for trajectory in trajectories.values():
        assert (trajectory['t'][0], trajectory['t'][-1]) == (1.0, 3.0)
    # it saw every state until then, and does it again
    assert trajectories['ilqr']['X'] == trajectories['recorded ilqr']['X']


@pytest.mark.parametrize('node', DECLARATIONS)
def test_defaults_are_those_of_the_bodies(node):
    bodies = {'link1_length': 0.15, 'link2_length': 0.15}
    found = parameters_of(node, DECLARATIONS[node].complete(bodies))
    assert {each['name'] for each in found
            if each['value'] != each['default']} == bodies.keys()


def test_it_needs_no_ros():
    code = ('import sys; sys.modules["rclpy"] = None; from dp_swing_ros.tools import console; '
            'assert "numba" in sys.modules; sys.exit(console.main([]))')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True)
    assert (done.returncode, 'the following arguments are required: BAG' in done.stderr) == (
        2, True)


def test_what_is_no_bag_is_said(tmp_path, capsys):
    assert main([str(tmp_path), '--port', '0']) == 2
    assert 'is no bag' in capsys.readouterr().err


def test_it_ends_quietly(console):
    """In the end, for it is the last test of it."""
    assert console.stop(signal.SIGINT) == 0
    assert 'Traceback' not in console.output()
