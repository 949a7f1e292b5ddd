# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Plant, mpc and logger as real processes, started as the user starts them."""

import json
import os
from pathlib import Path
import signal
import subprocess
import time
import uuid

from conftest import wait_until
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
import numpy as np
from one_process import record, TRIES
from PIL import Image
import pytest
from rosbags.highlevel import AnyReader

from dp_swing_ros.bags import read_episode
from dp_swing_ros.bags.episodes import configurations_of, reports_of
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.control import controllers
from dp_swing_ros.errors import BagError
from dp_swing_ros.evaluation.metrics import measure, outcome
from dp_swing_ros.provenance import commit, machine
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.tools import demo, verify

LIMIT = 280  # [s] for one call; the first start on a machine compiles
MARK = 'DP_SWING_ROS_TEST'


class Demo:
    """The demo in a folder, its processes marked so that none is overlooked."""

    def __init__(self, folder, *arguments, domain=''):
        self.folder = folder / 'run'
        self.mark = uuid.uuid4().hex
        # without a domain it finds one that is free, whatever else runs beside it
        environment = {**os.environ, MARK: self.mark, 'ROS_DOMAIN_ID': domain}
        self.process = subprocess.Popen(
            ['ros2', 'run', 'dp_swing_ros', 'demo', '--output', str(self.folder), *arguments],
            env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def finish(self):
        self.out, self.err = self.process.communicate(timeout=LIMIT)
        return self.process.returncode

    def left_behind(self):
        return left_behind(self.mark)


def left_behind(mark):
    """Return what still runs of all that was started with a mark in its environment."""
    left = []
    for process in Path('/proc').glob('[0-9]*'):
        try:
            if f'{MARK}={mark}'.encode() in (process / 'environ').read_bytes():
                left.append((process / 'cmdline').read_bytes())
        except OSError:
            continue
    return left


def messages(bag, topic):
    """Return the messages of a topic as two other readers see them."""
    with AnyReader([bag]) as reader:
        connections = [one for one in reader.connections if one.topic == topic]
        first = [reader.deserialize(data, one.msgtype)
                 for one, _, data in reader.messages(connections=connections)]
    with next(bag.glob('*.mcap')).open('rb') as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        second = [decoded for *_, decoded in reader.iter_decoded_messages(topics=[topic])]
    assert len(first) == len(second)
    return first


@pytest.mark.parametrize('solver', sorted(SOLVERS))
def test_solver_swings_up_in_lockstep_and_the_bag_tells_with_what(solver, tmp_path):
    bag = record(tmp_path, '--solver', solver, '--duration', '6', '--seed', '3', '--lockstep')
    episode = read_episode(bag)
    metrics = measure(episode)
    assert metrics.success
    assert max(abs(force.data) for force in messages(bag, '/force_command')) <= 20
    assert metrics.largest_force <= 20.0
    assert metrics.largest_position <= 2.4
    assert episode.solver == solver
    told = configurations_of(Bag(bag))
    assert set(told) == {'plant', 'mpc', 'logger'}
    assert (told['mpc'].parameters['solver'], told['mpc'].parameters['seed']) == (solver, 3)
    assert told['plant'].parameters['duration'] == 6.0
    this = commit(), machine()
    for each in told.values():
        assert (each.commit, each.machine) == this
        assert each.packages['numpy'] == np.__version__


def test_processes_give_the_run_of_one_to_the_bit_and_a_plant_is_described_to_an_mpc(
        tmp_path, capsys):
    """The bodies are told to the plant alone, which starts after the mpc."""
    bodies = {'links': 1, 'cart_mass': 0.6, 'link1_mass': 0.2, 'link1_length': 0.5,
              'link1_centre': 0.2, 'cart_dry_friction': 0.3, 'track_limit': 1.1,
              'drive': 'acceleration'}
    plant = json.dumps(bodies)[1:-1]
    file = tmp_path / 'rig.yaml'
    file.write_text(f"""
/**/plant: {{ros__parameters: {{{plant}}}}}
/**/mpc: {{ros__parameters: {{bodies: description}}}}
""")
    assert demo.drive_in([file]) == 'acceleration'
    arguments = ('--solver', 'mppi', '--seed', '3', '--duration', '3', '--lockstep')
    run = Demo(tmp_path, *arguments, '--no-figures', '--params', str(file))
    assert run.finish() == 0, run.out + run.err
    assert run.left_behind() == []
    first = read_episode(run.folder / 'bag')
    believed = configurations_of(Bag(run.folder / 'bag'))['mpc'].parameters
    assert {name: believed[name] for name in bodies} == bodies
    assert believed['step'] < 0.05   # the defaults go with them
    assert verify.main([str(run.folder / 'bag')]) == 0
    assert 'to the bit' in capsys.readouterr().out
    second = read_episode(record(
        tmp_path / 'again', *arguments, plant=f'{{{plant}}}',
        mpc=json.dumps({**believed, 'bodies': 'parameters'})))
    assert f'{measure(first).settling_time:.2f}' in run.out
    np.testing.assert_array_equal(first.X, second.X)
    np.testing.assert_array_equal(first.U, second.U)
    np.testing.assert_array_equal(first.ticks.cost, second.ticks.cost)


def test_several_runs_end_in_a_summary(here, lockstep_bag, monkeypatch, capsys):
    asked = []
    monkeypatch.setattr(demo, 'perform', lambda *given: asked.append(given) or lockstep_bag)
    assert demo.main(['--runs', '2', '--duration', '5', '--lockstep', '--no-figures',
                      '--output', 'run']) == 0
    assert asked == [(Path('run', f'seed_{seed}'), {
        'mpc': {'solver': 'ilqr', 'seed': seed},
        'plant': {'seed': seed, 'duration': 5.0, 'lockstep': True}}, []) for seed in (0, 1)]
    assert 'upright in 2 of 2 runs (95 % interval 34-100 %)' in capsys.readouterr().out
    assert [path.name for path in sorted((here / 'run').iterdir())] == ['seed_0', 'seed_1']


class Watched:
    """A plant that remembers what was measured."""

    def __init__(self, plant):
        self.plant, self.measured = plant, []

    def __getattr__(self, name):
        return getattr(self.plant, name)

    def measure(self):
        found = self.plant.measure()
        self.measured += [] if found is None else [found]
        return found


@pytest.mark.parametrize('delay', [0.0, 0.07])
def test_a_lockstep_run_is_the_one_without_ros_to_the_bit(delay, tmp_path):
    faults = {'velocity_noise': 0.02, 'force_noise': 0.5, 'command_jitter': 0.02,
              'command_loss': 0.1, 'actuator_response': 0.5, 'delay': delay}
    bag = record(tmp_path, '--duration', '2', '--lockstep', '--solver', 'mppi', '--seed', '4',
                 plant=''.join(f'    {name}: {value}\n' for name, value in faults.items()))
    recorded = read_episode(bag)
    plant = Watched(plants.plant({**faults, 'seed': 4}))
    simulate(plant, controllers.controller({'solver': 'mppi', 'seed': 4}), 2.0)
    X = np.array([measured.x for measured in plant.measured])
    assert len(X) >= 38 and len(recorded.X) == len(X) + 1   # the last one is not answered
    np.testing.assert_array_equal(recorded.X[:-1], X)


def test_real_time_run_leaves_a_whole_bag_and_pictures(tmp_path):
    for n in range(TRIES):   # on a busy machine the mpc may hear of the plant when that is done
        run = Demo(tmp_path / str(n), '--duration', '1')
        code, bag = run.finish(), run.folder / 'bag'
        assert run.left_behind() == []
        if reports_of(Bag(bag)):
            break
    states, forces = messages(bag, '/joint_states'), messages(bag, '/force_command')
    episode, ticks = read_episode(bag), reports_of(Bag(bag))
    assert code == (0 if measure(episode).success else 1), run.out + run.err
    assert len(states) == len(episode.t)
    assert len(forces) == len(ticks) + 1
    assert forces[-1].data == 0.0
    assert len(messages(bag, '/mpc/plan')) == len(ticks)
    # what the mpc does after the plant's end is none of the run
    assert len(episode.ticks.t) <= len(ticks) and episode.ticks.t[-1] <= episode.t[-1]
    for name in ('hero.png', 'snapshots.png', 'squared_error.png', 'timeline.png',
                 'animation.gif'):
        with Image.open(run.folder / name) as image:
            image.verify()
    report = (run.folder / 'report.html').read_text()
    assert f'iLQR: {outcome(episode).value}' in report
    assert commit() in report and machine() in report
    assert len(report) < 3e6
    assert episode.t[-1] > 0.8   # [s] of a clock that stops with the plant


def states_so_far(bag):
    """Return how many states a bag has that is being recorded."""
    try:
        return len(read_episode(bag, partial=True).t)
    except BagError:
        return 0


def test_demo_joins_no_other_and_an_interrupt_ends_everything_and_finishes_the_bag(
        tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(demo, 'DISCOVERY', LIMIT)   # which ends once somebody is found
    run = Demo(tmp_path / 'first', '--duration', '600')
    domain = run.process.stdout.readline().removeprefix('ROS_DOMAIN_ID=').strip()

    def is_recording():
        assert run.process.poll() is None, run.finish() or run.err
        time.sleep(0.3)   # to read takes a while
        return states_so_far(run.folder / 'bag') >= 20
    assert wait_until(is_recording, LIMIT)
    monkeypatch.setenv('ROS_DOMAIN_ID', domain)
    assert demo.main(['--output', str(tmp_path / 'second')]) == 2
    assert 'already in this ROS domain' in capsys.readouterr().err
    run.process.send_signal(signal.SIGINT)
    assert run.finish() == 130
    assert run.left_behind() == []
    assert 'demo: interrupted' in run.err
    assert len(read_episode(run.folder / 'bag').t) >= 20


def test_node_that_fails_is_shown_and_ends_the_demo(here, monkeypatch, capsys):
    (here / 'wrong.yaml').write_text(
        'mpc:\n  ros__parameters: {dynamics: learned, model: none.json}\n')
    monkeypatch.setenv('ROS_DOMAIN_ID', '')
    monkeypatch.setenv(MARK, uuid.uuid4().hex)
    assert demo.main(['--params', 'wrong.yaml', '--output', 'run']) == 1
    assert left_behind(os.environ[MARK]) == []
    error = capsys.readouterr().err
    assert 'mpc ended early with exit code 2' in error
    assert 'none.json' in error
    assert 'Traceback' not in error
