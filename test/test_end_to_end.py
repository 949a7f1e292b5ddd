# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Plant, mpc and logger as real processes, started as the user starts them."""

import os
from pathlib import Path
import signal
import subprocess
import time
import uuid

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
import numpy as np
from PIL import Image
import pytest
from real_bags import record
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

LIMIT = 280  # [s] for one call; the first start on a machine compiles
MARK = 'DP_SWING_ROS_TEST'
STOOD_STILL = 0.2  # [s] without a state: the machine did something else


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
        """Return what still runs of all that the demo started."""
        left = []
        for process in Path('/proc').glob('[0-9]*'):
            try:
                if f'{MARK}={self.mark}'.encode() in (process / 'environ').read_bytes():
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
    demo = Demo(tmp_path, '--solver', solver, '--duration', '6', '--seed', '3', '--lockstep',
                '--no-figures')
    assert demo.finish() == 0, demo.out + demo.err
    assert demo.left_behind() == []
    episode = read_episode(demo.folder / 'bag')
    metrics = measure(episode)
    assert metrics.success
    assert max(abs(force.data) for force in messages(demo.folder / 'bag', '/force_command')) <= 20
    assert metrics.largest_force <= 20.0
    assert metrics.largest_position <= 2.4
    assert episode.solver == solver
    assert f'{metrics.settling_time:.2f}' in demo.out
    told = configurations_of(Bag(demo.folder / 'bag'))
    assert set(told) == {'plant', 'mpc', 'logger'}
    assert (told['mpc'].parameters['solver'], told['mpc'].parameters['seed']) == (solver, 3)
    assert told['plant'].parameters['duration'] == 6.0
    for each in told.values():
        assert (each.commit, each.machine) == (commit(), machine())
        assert each.packages['numpy'] == np.__version__


def test_same_seed_gives_the_same_run_to_the_bit(tmp_path):
    arguments = ('--solver', 'mppi', '--seed', '3', '--duration', '2', '--lockstep',
                 '--no-figures')
    both = [Demo(tmp_path / name, *arguments) for name in ('first', 'second')]
    for demo in both:
        demo.finish()
    first, second = (read_episode(demo.folder / 'bag') for demo in both)
    np.testing.assert_array_equal(first.X, second.X)
    np.testing.assert_array_equal(first.U, second.U)
    np.testing.assert_array_equal(first.ticks.cost, second.ticks.cost)


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
    bag = record(tmp_path, '--duration', '3', '--lockstep', '--solver', 'mppi', '--seed', '4',
                 plant=''.join(f'    {name}: {value}\n' for name, value in faults.items()))
    recorded = read_episode(bag)
    plant = Watched(plants.plant({**faults, 'seed': 4}))
    simulate(plant, controllers.controller({'solver': 'mppi', 'seed': 4}), 3.0)
    X = np.array([measured.x for measured in plant.measured])
    assert len(X) >= 58 and len(recorded.X) == len(X) + 1   # the last one is not answered
    np.testing.assert_array_equal(recorded.X[:-1], X)


def undisturbed(folder, *arguments):
    """Return a finished demo through which the machine did not stand still."""
    for attempt in range(3):
        demo = Demo(folder / str(attempt), *arguments)
        demo.finish()
        t = read_episode(demo.folder / 'bag').t
        if np.diff(t).max() < STOOD_STILL:
            return demo
    pytest.skip('the machine stood still in the middle of every run')


def test_real_time_run_leaves_a_whole_bag_and_pictures(tmp_path):
    demo = undisturbed(tmp_path, '--duration', '10')
    assert demo.process.returncode == 0, demo.out + demo.err
    assert demo.left_behind() == []
    bag = demo.folder / 'bag'
    states, forces = messages(bag, '/joint_states'), messages(bag, '/force_command')
    episode, ticks = read_episode(bag), reports_of(Bag(bag))
    assert len(states) == len(episode.t)
    assert len(forces) == len(ticks) + 1
    assert forces[-1].data == 0.0
    assert len(messages(bag, '/mpc/plan')) == len(ticks)
    # what the mpc does after the plant's end is none of the run
    assert len(episode.ticks.t) <= len(ticks) and episode.ticks.t[-1] <= episode.t[-1]
    for name in ('hero.png', 'snapshots.png', 'squared_error.png', 'timeline.png',
                 'animation.gif'):
        with Image.open(demo.folder / name) as image:
            image.verify()
    report = (demo.folder / 'report.html').read_text()
    assert f'iLQR: {outcome(episode).value}' in report
    assert commit() in report and machine() in report
    assert len(report) < 3e6
    assert episode.t[-1] == pytest.approx(10.0, abs=0.1)
    # the controller heard the plant at once
    assert episode.ticks.t[0] < 0.6


def states_so_far(bag):
    """Return how many states a bag has that is being recorded."""
    try:
        return len(read_episode(bag, partial=True).t)
    except BagError:
        return 0


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_interrupted_demo_ends_everything_and_finishes_the_bag(number, tmp_path):
    demo = Demo(tmp_path, '--duration', '60')
    end = time.monotonic() + LIMIT
    while states_so_far(demo.folder / 'bag') < 20 and time.monotonic() < end:
        assert demo.process.poll() is None, demo.finish() or demo.err
        time.sleep(0.1)
    demo.process.send_signal(number)
    assert demo.finish() == 130
    assert demo.left_behind() == []
    assert 'demo: interrupted' in demo.err
    assert len(read_episode(demo.folder / 'bag').t) >= 20


def test_node_that_fails_is_shown_and_ends_the_demo(tmp_path):
    file = tmp_path / 'wrong.yaml'
    file.write_text('mpc:\n  ros__parameters: {dynamics: learned, model: none.json}\n')
    demo = Demo(tmp_path, '--params', str(file))
    assert demo.finish() == 1
    assert demo.left_behind() == []
    assert 'mpc ended early with exit code 2' in demo.err
    assert 'none.json' in demo.err
    assert 'Traceback' not in demo.err


def test_several_runs_end_in_a_summary(tmp_path):
    demo = Demo(tmp_path, '--runs', '2', '--duration', '5', '--lockstep', '--no-figures')
    assert demo.finish() == 0, demo.out + demo.err
    assert 'upright in 2 of 2 runs (95 % interval 34-100 %)' in demo.out
    assert [path.name for path in sorted(demo.folder.iterdir())] == ['seed_0', 'seed_1']


def test_demo_does_not_join_another(tmp_path):
    first = Demo(tmp_path / 'first', '--duration', '30', '--no-figures')
    domain = first.process.stdout.readline().removeprefix('ROS_DOMAIN_ID=').strip()
    end = time.monotonic() + LIMIT
    while not (first.folder / 'plant.log').exists() and time.monotonic() < end:
        time.sleep(0.1)
    second = Demo(tmp_path / 'second', domain=domain)
    assert second.finish() == 2, second.out + second.err
    assert 'already in this ROS domain' in second.err
    first.process.send_signal(signal.SIGINT)
    assert first.finish() == 130, first.out + first.err
