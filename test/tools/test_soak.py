# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Soaks as the user starts them, and what is refused before one starts."""

import json
import os
from pathlib import Path
import re
import signal
import subprocess
import uuid

from conftest import wait_until
from PIL import Image
import pytest
from synthetic import soaked

from dp_swing_ros.tools import soak

LIMIT = 280   # [s] for one call; the first start on a machine compiles
MARK = 'DP_SWING_ROS_SOAK'
DURATION, RATE = 8.0, 50.0


class Started:
    """A soak in a folder, its processes marked so that none is overlooked."""

    def __init__(self, folder, *arguments):
        self.folder, self.mark = folder / 'soak', f'{MARK}={uuid.uuid4().hex}'
        name, value = self.mark.split('=')
        self.process = subprocess.Popen(
            ['ros2', 'run', 'dp_swing_ros', 'soak', '--output', str(self.folder), *arguments],
            env={**os.environ, name: value, 'ROS_DOMAIN_ID': ''}, stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, text=True)

    def finish(self):
        self.out, self.err = self.process.communicate(timeout=LIMIT)
        return self.process.returncode

    def wait_for_states(self):
        log = self.folder / 'plant.log'
        assert wait_until(lambda: log.exists() and 'states a second' in log.read_text(), LIMIT)

    def running(self):
        """Return the command lines of all that runs of it, by their numbers."""
        found = {}
        for process in Path('/proc').glob('[0-9]*'):
            try:
                if self.mark.encode() in (process / 'environ').read_bytes():
                    found[int(process.name)] = (process / 'cmdline').read_text()
            except OSError:
                continue
        return found

    @property
    def summary(self):
        return json.loads((self.folder / 'summary.json').read_text())


@pytest.fixture(scope='module')
def done(tmp_path_factory):
    started = Started(tmp_path_factory.mktemp('soak'), '--duration', str(DURATION), '--rate',
                      str(RATE), '--burn', '1', '--seed', '3')
    started.code = started.finish()
    assert started.code in (0, 1), started.out + started.err
    return started


def test_every_state_is_counted_once(done):
    answers, ticks = done.summary['answers'], done.summary['ticks']
    for who in ('mpc', 'echo'):
        row = answers[who]
        assert 0 < row['states'] <= DURATION * RATE + 1
        assert row['states'] == row['answered in time'] + row['late'] + row['unanswered']
        assert row['answered in time'] > 0
    assert 0 <= answers['mpc']['late by itself'] <= answers['mpc']['late']
    assert ticks['messages not heard'] == 0
    answered = answers['mpc']['states'] - answers['mpc']['unanswered']
    assert ticks['of the mpc'] >= answered
    assert ticks['of the mpc'] == sum(done.summary['statuses'].values())
    assert done.summary['forces']['total'] > answered   # a last zero


def test_times_are_those_of_what_was_answered(done):
    times = done.summary['times [ms]']
    for who, name in (('mpc', 'mpc, state to force'), ('echo', 'echo, state to answer')):
        row = done.summary['answers'][who]
        assert times[name]['count'] == row['answered in time'] + row['late']
    for row in times.values():
        assert 0 < row['p50'] <= row['p99'] <= row['p99.9'] <= row['max']
    assert done.summary['bound of p99 [ms]'] == pytest.approx(
        times['echo, state to answer']['p99'] + times['mpc, solve']['p99'] + 1.0)


def test_forces_and_processes_are_watched(done):
    forces = done.summary['forces']
    assert forces['not_finite'] == forces['beyond_limit'] == 0
    assert 10.0 < forces['largest'] <= 20.0
    processes = done.summary['processes']
    assert list(processes) == ['plant', 'mpc', 'echo', 'watcher']
    for row in processes.values():
        assert 0.0 < row['processor [%]'] < 100.0 * os.cpu_count()
        assert 1.0 < row['private [MB]'] < row['resident [MB]'] < 2000.0
        assert row['growth [MB]'] is None


def test_the_report_and_the_exit_code_are_those_of_the_summary(done):
    summary = done.summary
    assert done.code == (0 if summary['success'] else 1)
    assert summary['failure'] == done.err == ''
    assert (summary['rate'], summary['seed'], summary['burn']) == (RATE, 3, 1)
    assert re.search(rf'^\| mpc +\| +{summary["answers"]["mpc"]["states"]} \|', done.out, re.M)
    assert f'falls {summary["pendulum"]["falls"]}' in done.out
    assert 'memory: too short for its growth, which takes 78 s' in done.out
    assert 'of the mpc' in done.out and 'echo p99 + solve p99' in done.out


def test_picture_and_logs_are_left_and_no_process(done):
    with Image.open(done.folder / 'soak.png') as image:
        assert min(image.size) > 500
    assert {file.name for file in done.folder.iterdir()} == {
        'summary.json', 'soak.png', 'plant.log', 'mpc.log', 'echo.log'}
    assert done.running() == {}


@pytest.mark.real_time
def test_the_pendulum_stays_up(tmp_path):
    started = Started(tmp_path, '--duration', '8')
    assert started.finish() == 0, started.out + started.err
    assert started.summary['pendulum']['falls'] == 0
    assert started.summary['answers']['mpc']['unanswered'] == 0


def test_an_interrupt_ends_it_with_a_report(tmp_path):
    started = Started(tmp_path, '--duration', '3600', '--burn', '1')
    started.wait_for_states()
    assert wait_until(lambda: any('os.getppid' in line for line in started.running().values()))
    with pytest.raises(subprocess.TimeoutExpired):
        started.process.wait(3.0)
    started.process.send_signal(signal.SIGINT)
    assert started.finish() in (0, 1)
    assert started.err == ''
    assert 0 < started.summary['answers']['echo']['states'] < 3600 * 20
    assert started.summary['duration'] == 3600.0
    assert started.running() == {}


def test_a_process_that_dies_is_named_and_the_rest_reported(tmp_path):
    started = Started(tmp_path, '--duration', '3600')
    started.wait_for_states()
    with pytest.raises(subprocess.TimeoutExpired):
        started.process.wait(3.0)
    mpc, = [pid for pid, line in started.running().items() if '/dp_swing_ros/mpc\0' in line]
    os.kill(mpc, signal.SIGKILL)
    assert started.finish() == 1
    assert re.match(r'soak: error: mpc ended early with exit code -9; the end of .*mpc.log',
                    started.err)
    assert started.summary['failure'].startswith('mpc ended early')
    assert started.summary['answers']['mpc']['states'] > 0
    assert 'state to force' in started.out
    assert started.running() == {}


@pytest.mark.usefixtures('here')
@pytest.mark.parametrize('arguments, complaint', [
    ([], 'required: --duration'),
    (['--duration', '0.5'], '0.5 is not a number of at least 1'),
    (['--duration', 'inf'], 'inf is not a number of at least 1'),
    (['--duration', '9', '--rate', '0'], '0 is not a number of at least 1 and at most 1000'),
    (['--duration', '9', '--burn', '-1'], '-1 is not a whole number of at least 0'),
    (['--duration', '9', '--seed', '-1'], '-1 is not a whole number of at least 0'),
    (['--duration', '9', '--links', '4'], 'invalid choice: 4'),
    (['--duration', '9', '--solver', 'none'], 'choose from')])
def test_misuse_is_refused_at_once(arguments, complaint, capsys, here):
    with pytest.raises(SystemExit) as end:
        soak.main(arguments)
    assert end.value.code == 2
    assert complaint in capsys.readouterr().err
    assert not list(here.iterdir())


@pytest.mark.parametrize('text, complaint', [
    (None, 'cannot read the parameter file file.yaml'),
    ('mpc:\n  ros__parameters: {horizon: 0}\n', 'horizon'),
    ('mcp:\n  ros__parameters: {horizon: 9}\n', "did you mean 'mpc'?"),
    ('plant:\n  ros__parameters: {ratte: 9.0}\n', "'ratte'")])
def test_a_bad_parameter_file_is_one_line(text, complaint, capsys, here):
    if text:
        (here / 'file.yaml').write_text(text)
    before = list(here.iterdir())
    assert soak.main(['--duration', '9', '--params', 'file.yaml']) == 2
    error = capsys.readouterr().err
    assert error.startswith('soak: error: ') and complaint in error
    assert error.count('\n') == 1
    assert list(here.iterdir()) == before


def test_what_is_not_known_is_a_dash():
    text = soak.report(soaked(10))
    assert 'up after [s] -' in text
    assert not re.search(r'\bnan\b', text)
