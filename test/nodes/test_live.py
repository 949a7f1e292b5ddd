# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters of a running mpc: changed by a stranger, between ticks, and repeated from the bag."""

from functools import partial
import math
import os
from pathlib import Path
import shutil
import subprocess

from builtin_interfaces.msg import Time
from conftest import PATIENCE
import numpy as np
from one_process import Crew, recording
from peer import Member
import pytest
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.parameter import Parameter, parameter_value_to_python
from rosgraph_msgs.msg import Clock
from standin import ROS2, ros2
from test_mpc import Conversation, LEANING

from dp_swing_ros.bags import read_episode
from dp_swing_ros.bags.episodes import reports_of, revisions_of
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.messages.configuration import BEFORE, from_text
from dp_swing_ros.messages.fields import from_diagnostics, from_trajectory, to_state
from dp_swing_ros.nodes.plant import PlantNode
from dp_swing_ros.pendulum.sensors import SensorParameters
from dp_swing_ros.pendulum.state import angles, errors
from dp_swing_ros.tools import verify
from dp_swing_ros.topics import CONFIGURATION, DIAGNOSTICS, FORCE_COMMAND, JOINT_STATES


def put(peer, node='mpc', **values):
    """Set parameters of a node, all or none; return why they are refused, if they are."""
    result = peer.call(SetParametersAtomically, f'{node}/set_parameters_atomically', parameters=[
        Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]).result
    assert result.successful is not bool(result.reason)
    return result.reason


def value(peer, name):
    """Return the value of a parameter of the mpc."""
    found, = peer.call(GetParameters, 'mpc/get_parameters', names=[name]).values
    return parameter_value_to_python(found)


REFUSED = [
    ({'force_weight': -1.0}, "'force_weight' is -1.0; expected at least"),
    ({'solver': 'lqr'}, 'expected one of ddp, ilqr'),
    ({'state_weights': [1.0]}, 'a list of 6 numbers'), ({'links': 3}, 'read-only'),
    ({'force_limit': 0.0}, 'the controller needs a force'), ({'horizon': 30.5}, 'a whole number'),
    ({'reference': [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]}, 'expected an equilibrium'),
    ({'goal': 'up'}, 'expected one of given, down_down'),
    ({'smaples': 3}, "unknown parameter 'smaples'"),
    ({'force_weight': math.nan}, 'a finite number'),
    ({'initial_force': math.nan}, 'initial_force'), ({'force_weight': None}, 'a number')]


def test_all_of_a_request_change_or_none(peer, start_here):
    told = peer.record(CONFIGURATION)
    talk = Conversation(peer, start_here)
    names = {'horizon', *(name for wrong, _ in REFUSED for name in wrong)} - {'smaples'}
    before = {name: value(peer, name) for name in names}
    for wrong, words in REFUSED:
        why = put(peer, **{'horizon': 33, **wrong})
        assert words in why and why, (wrong, why)
        talk.send(LEANING + 1e-3 * talk.n)
        assert talk.report().values['revision'] == 0
    assert {name: value(peer, name) for name in names} == before
    # whole numbers will do for numbers
    assert put(peer, horizon=40, step=0.04, solver='ddp', force_limit=10,
               state_weights=[20, 100, 100, 2, 6, 1]) == ''
    assert abs(talk.send(LEANING + 1e-3 * talk.n)) <= 10.0
    values, plan = talk.report().values, from_trajectory(talk.plans[-1])
    assert (len(plan.U), plan.t[1]) == (40, pytest.approx(0.04))
    assert (values['revision'], values['solver']) == (1, 'ddp')
    assert peer.until(lambda: any('revision: 1' in each.data for each in told))
    assert from_text(told[-1].data).parameters['horizon'] == 40
    assert (value(peer, 'force_limit'), value(peer, 'solver')) == (10.0, 'ddp')
    assert list(value(peer, 'state_weights')) == [20.0, 100.0, 100.0, 2.0, 6.0, 1.0]


def test_no_parameter_ends_or_holds_up_what_drives(start_here, tmp_path, monkeypatch):
    """Files that never end, pipes, what no parser or memory holds, values of another kind."""
    monkeypatch.setattr('dp_swing_ros.nodes.mpc.AWAY', 60.0)   # of a busy machine
    os.mkfifo(tmp_path / 'pipe')
    mpc = start_here('mpc')
    mpc.wait_for('ready')
    with Crew(tmp_path / 'nodes.yaml', {'plant': {}}) as crew:
        peer = Member(crew)
        forces = peer.record(FORCE_COMMAND)
        crew.start(PlantNode)
        assert peer.until(lambda: len(forces) > 3)
        big = {'mppi.samples': 1_000_000, 'horizon': 1000}
        for wrong, words in (
                ({'model': '/dev/zero'}, 'no regular file'),
                ({'model': str(tmp_path / 'pipe')}, 'no regular file'),
                ({'model': '{"a":' + '[' * 25_000}, 'nests deeper'),
                ({'state_weights': 5}, 'expected a list'), ({'solver': 'mppi', **big}, 'GB')):
            learned = {'dynamics': 'learned'} if 'model' in wrong else {}
            why = put(peer, **wrong, **learned)
            assert words in why and '\n' not in why
            before = len(forces)
            assert peer.until(lambda: len(forces) > before + 2)
        mpc.ask_to_end()
        assert peer.until(mpc.ended) and mpc.wait() == 0
        assert 'Traceback' not in mpc.output()
        assert peer.until(lambda: forces[-1].data == 0.0)


def by_process(*arguments):
    """Call what `ros2` is here; return exit code, output and errors."""
    done = subprocess.run(['ros2', *arguments], capture_output=True, text=True, timeout=PATIENCE)
    return done.returncode, done.stdout, done.stderr


def ros2_param(call, *command):
    """Return exit code and output of `ros2 param`."""
    for _ in range(10):   # on a busy machine it may not find the node in time
        code, output, errors = call('param', *command)
        if 'no node' not in errors:
            break
    return code, output + errors


def test_a_file_is_loaded_as_a_whole_or_not_at_all(peer, start_here, tmp_path):
    """By the stand-in; sections of other nodes are theirs, as the plant's rate."""
    Conversation(peer, start_here)
    param = partial(ros2_param, ros2)
    assert param('set', '/mpc', 'force_weight', '1.e-2') == (0, 'Set parameter successful\n')
    file = tmp_path / 'both.yaml'
    file.write_text('/**/plant:\n  ros__parameters: {rate: 50.0}\n/**/mpc:\n  ros__parameters: '
                    '{force_limit: .inf, track_limit: .inf, mppi.largest_noise: 5.0}\n')
    code, text = param('load', '/mpc', str(file))
    assert code == 0, text
    assert (value(peer, 'force_limit'), value(peer, 'track_limit')) == (math.inf, math.inf)
    assert (value(peer, 'force_weight'), value(peer, 'mppi.largest_noise')) == (0.01, 5.0)
    file.write_text('plant:\n  ros__parameters: {rate: 50.0}\n'
                    '/**/mpc:\n  ros__parameters: {horizon: 20, links: 3, seed: 7}\n')
    code, text = param('load', '/mpc', str(file))
    assert code == 1 and 'read-only while the node runs: links' in text
    assert (text.count('\n'), value(peer, 'horizon')) == (1, 30)
    file.write_text('mpc:\n  ros__parameters: {state_weights: [1, 2.0]}\n')
    code, text = param('load', '/mpc', str(file))
    assert code == 2 and "'state_weights' is [1, 2.0]; ROS wants" in text
    # by ros2cli, where that is installed
    cli, ours = (Path(each).read_text().splitlines()[1:] for each in (shutil.which('ros2'), ROS2))
    param = partial(ros2_param, ros2 if cli == ours else by_process)
    file.write_text('/mpc:\n  ros__parameters:\n    horizon: 20\n    force_weight: 0.5\n')
    assert param('set', '/mpc', 'solver', 'ddp') == (0, 'Set parameter successful\n')
    code, text = param('set', '/mpc', 'solver', 'lqr')
    assert code == 1 and 'expected one of ddp, ilqr' in text
    assert param('load', '/mpc', str(file))[0] == 0
    assert 'ddp' in ros2_param(by_process, 'get', '/mpc', 'solver')[1]
    assert value(peer, 'horizon') == 20
    assert 'mppi.samples' in param('list', '/mpc')[1]


def test_a_run_with_changes_is_repeated_to_the_bit(tmp_path, capsys):
    """In lockstep: three solvers, a reference, a goal, and another seed in between."""
    bag = tmp_path / 'bag'
    changes = [{'solver': 'ddp'}, {'solver': 'mppi', 'mppi.samples': 256}, {'seed': 4},
               {'reference': [0.4, 0.0, 0.0, 0.0, 0.0, 0.0]}, {'solver': 'ilqr'},
               {'goal': 'down_up'}]
    with recording(bag, {'mpc': {'horizon': 40}, 'plant': {'lockstep': True}}) as (crew, *_):
        peer = Member(crew)
        reports = peer.record(DIAGNOSTICS)
        for change in changes:
            before = len(reports)
            assert peer.until(lambda: len(reports) > before + 12)
            assert put(peer, **change) == ''
        before = len(reports)
        assert peer.until(lambda: len(reports) > before + 200)
    found = Bag(bag)
    assert sorted(revisions_of(found)['mpc']) == list(range(len(changes) + 1))
    assert reports_of(found)[-1].values['revision'] == len(changes)
    episode = read_episode(bag)
    goal = np.array([0.4, np.pi, 0.0, 0.0, 0.0, 0.0])
    assert np.abs(errors(episode.X[-20:], goal)[:, angles(goal)]).max() < 0.1
    assert verify.main([str(bag)]) == 0
    assert 'to the bit' in capsys.readouterr().out


def test_the_plant_s_changes_are_repeated_to_the_bit(tmp_path, capsys):
    """In lockstep, from before the first state on: bodies, noises, delay, rate and drive."""
    bag = tmp_path / 'bag'
    changes = [{'link2_mass': 0.6, 'cart_friction': 0.5}, {'velocity_noise': 0.1, 'seed': 3},
               {'rate': 40.0}, {'actuation_delay': 0.01, 'force_gain': 0.9}, {'delay': 0.05},
               {'delay': 0.0, 'track_limit': 2.0}]
    # it begins with the clock, so that there is time before
    with recording(bag, {'plant': {'lockstep': True, 'use_sim_time': True}}) as (crew, *_):
        peer = Member(crew)
        reports = peer.record(DIAGNOSTICS)
        assert put(peer, 'plant', start='down_up', position_noise=1e-3) == ''
        clock = peer.node.create_publisher(Clock, '/clock', 1)
        peer.node.create_timer(0.1, lambda: clock.publish(Clock(clock=Time(sec=1))))
        for change in changes:
            before = len(reports)
            assert peer.until(lambda: len(reports) > before + 8)
            assert put(peer, 'plant', **change) == ''
        assert 'read-only' in put(peer, 'plant', lockstep=False)
        assert 'a list of 6 numbers' in put(peer, 'plant', initial_state=[0.0])
        before = len(reports)
        assert peer.until(lambda: len(reports) > before + 25)
    found = revisions_of(Bag(bag))['plant']
    # the logger may meet the plant when its first announcement is replaced already
    assert [*found][-len(changes) - 1:] == list(range(1, len(changes) + 2))
    assert found[1].since == BEFORE < found[2].since < found[3].since
    assert verify.main([str(bag)]) == 0
    assert 'so the whole run, simulated again' in capsys.readouterr().out


@pytest.mark.real_time
def test_no_tick_is_late_for_a_change(peer, start_node):
    """While it balances: every solver after every other, and what needs other kernels."""
    states, reports = peer.record(JOINT_STATES), peer.record(DIAGNOSTICS)
    start_node('mpc', {'solver': 'mppi'}).wait_for('ready')
    start_node('plant', {'initial_state': LEANING.tolist()})

    def ticks():
        found = (from_diagnostics(message, 'mpc') for message in reports)
        return [report.values for report in found if report is not None]
    assert peer.until(lambda: len(states) > 40)
    changes = [{'solver': name} for name in ('ddp', 'ilqr', 'mppi', 'ilqr', 'ddp', 'mppi')]
    changes += [{'horizon': 60}, {'step': 0.04, 'solver': 'ilqr'}, {'estimator': 'none'},
                {'estimator': 'ekf'}, {'angle_error': 'angle'}, {'force_weight': 0.01}]
    for n, change in enumerate(changes, 1):
        assert put(peer, **change) == ''
        assert peer.until(lambda: ticks()[-1]['revision'] == n, timeout=150.0), change
        peer.spin(0.5)
    values = ticks()
    assert [each['late_total'] for each in values][-1] == 0
    assert max(int(each['carried']) for each in values) == 0
    X = np.array([to_state(state, 2, SensorParameters()) for state in states])
    assert np.abs(X[:, 1:3]).max() < 0.2
