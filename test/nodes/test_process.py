# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How a node's process ends, whatever ends it."""

import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from conftest import PATIENCE, wait_until
import pytest

from dp_swing_ros.tools.processes import Process

PRIORITY = 7
REAL_TIME = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, PRIORITY   # for no child
NODE = Path(__file__).with_name('example_node.py')


@pytest.fixture
def start():
    """Return a function that starts the node with these ROS arguments, in its own process."""
    processes = []

    def begin(*arguments, **variables):
        environment = {**os.environ, **variables}
        processes.append(subprocess.Popen(
            [sys.executable, NODE, *arguments], stdout=subprocess.PIPE,
            stderr=subprocess.PIPE, text=True,
            env={name: value for name, value in environment.items() if value is not None}))
        return processes[-1]

    yield begin
    for process in processes:
        process.kill()
        process.communicate()


def wait_for(process, line):
    while process.stdout.readline() != f'{line}\n':
        assert process.poll() is None, process.stderr.read()


def end(process):
    """Return exit code, output and errors of a process that ends by itself."""
    out, errors = process.communicate(timeout=PATIENCE)
    return process.returncode, out, errors


def mode(name):
    return '--ros-args', '-p', f'mode:={name}'


@pytest.mark.parametrize(('name', 'number'), [
    ('busy', signal.SIGINT), ('slow', signal.SIGTERM), ('idle', signal.SIGHUP)])
def test_signal_ends_it_in_order(start, name, number):
    process = start(*mode(name))
    wait_for(process, 'ready')
    process.send_signal(number)
    time.sleep(0.02)
    process.send_signal(number)  # the impatient user's second one
    braking = 'braking\n' if name == 'slow' else ''   # for it may not end yet
    assert end(process) == (0, f'{braking}closed\n', '')


def test_tests_in_the_background_of_a_script_start_what_obeys():
    here = f'{__file__}::test_signal_ends_it_in_order'
    command = f'trap "" INT HUP; exec {sys.executable} -m pytest -q {here} -k "not slow"'
    run = subprocess.run(['bash', '-c', command], capture_output=True, text=True)
    assert run.returncode == 0, run.stdout


def test_signal_cuts_preparation_short(start):
    process = start(*mode('prepare'))
    wait_for(process, 'prepare')
    process.send_signal(signal.SIGINT)
    assert end(process) == (0, 'closed\n', '')


@pytest.mark.parametrize(('name', 'line'), [('destructor', 'dying'), ('callback', 'called')])
def test_a_signal_is_not_lost_where_an_exception_is(start, name, line):
    process = start(*mode(name))
    wait_for(process, line)
    process.send_signal(signal.SIGINT)
    assert end(process) == (0, 'closed\n', '')


@pytest.fixture
def ended(start_here):
    """Return a function that gives exit code and output of what ends by itself, in a thread."""
    def run(name):
        node = start_here(NODE.name, {'mode': name})
        return node.wait(), node.output()
    return run


def test_user_error_is_one_line(ended):
    assert ended('user') == (2, f'prepare\nready\nclosed\n{NODE.name}: error: the disk is full\n')


def test_bug_is_a_traceback(ended):
    code, said = ended('bug')
    assert code == 1
    assert said.startswith('prepare\nclosed\nTraceback')
    assert said.endswith('RuntimeError: oops\n')


def test_a_library_that_asks_for_the_exit_ends_it_in_order(ended):
    code, said = ended('exit')
    assert code == 1 and said.startswith('prepare\nready\nclosed\nTraceback')
    assert said.endswith('SystemExit: 0\n')


def test_a_node_goes_on_where_a_callback_fails_and_says_in_one_line_what_failed(ended):
    code, said = ended('goes on')
    first, second, *lines, last = said.splitlines()
    assert (code, first, second, last) == (0, 'prepare', 'ready', 'closed')
    assert 1 <= len(lines) < 4   # of four failures, for it is said once in a second
    assert all('RuntimeError: oops (example_node.py, line' in line and line.endswith('; going on')
               for line in lines)


def test_what_is_made_aside_ends_or_holds_up_nothing(ended):
    code, said = ended('aside')
    assert code == 0
    assert said.splitlines() == [
        'prepare', 'ready', 'made', 'ZeroDivisionError: division by zero', 'SystemExit: 3',
        'ParameterError: what was asked for is not there after 0.2 s',
        'ParameterError: what was asked for before is still being made; try again later',
        'closed']


@pytest.mark.parametrize('arguments, text', [
    (['-p', 'rate:=0.5'], "parameter 'rate' is 0.5; expected at least 1 Hz"),
    (['-p', 'rat:=5.0'], "unknown parameter 'rat' of the node 'example'; did you"),
    (['-p', 'rate:='], "parameter 'rate' is None; expected a value"),
    (['-p', 'rate:=[1, 2.0]'], "'rate' is [1, 2.0]; ROS wants the values of a list "
     'alike: [1.0, 2.0]'),
    (['--params-file', 'none.yaml'], 'cannot read the parameter file none.yaml'),
    (['-p', 'use_sim_time:=1'], "'use_sim_time' to '1'"),
    (['rate:=5.0'], "UnknownROSArgsError: ['rate:=5.0']"),
    (['--', 'rate:=5.0'], "unknown argument 'rate:=5.0'; parameters are given as: --ros-args -p"),
])
def test_misuse_is_one_line(start_here, arguments, text):
    node = start_here(NODE.name, arguments=arguments)
    assert node.wait() == 2
    assert node.output().startswith(f'{NODE.name}: error: ') and text in node.output()
    assert node.output().count('\n') == 1 and '/src/' not in node.output()


def test_an_environment_that_only_ros_can_judge_is_named(start):
    code, out, errors = end(start(ROS_LOG_DIR='/dev/null/log'))
    assert (code, out) == (2, '')
    line = errors.splitlines()[-1]
    assert line.startswith('example: error: ') and 'ROS_LOG_DIR=/dev/null/log' in line
    assert 'Traceback' not in errors


@pytest.mark.filterwarnings('ignore:Failed to fini')   # which rcl has not begun
def test_peers_that_only_ros_can_judge_are_named(start_here, monkeypatch):
    monkeypatch.setenv('ROS_STATIC_PEERS', 'junk,,::')
    node = start_here(NODE.name)
    assert node.wait() == 2
    line = node.output().splitlines()[-1]
    assert line.startswith(f'{NODE.name}: error: ') and 'ROS_STATIC_PEERS=junk,,::' in line
    assert 'Traceback' not in node.output() and 'ready' not in node.output()


def test_a_node_ends_its_process_and_needs_no_home(start, tmp_path):
    process = start(*mode('done'), HOME=None, ROS_HOME=None, ROS_LOG_DIR=None,
                    TMPDIR=str(tmp_path))
    assert end(process) == (0, 'prepare\nready\nclosed\n', '')
    assert list(tmp_path.glob('ros_log_*/*'))


def scheduled(pid):
    """Return policies and priorities of a process's threads, without those that ended."""
    found = set()
    for thread in map(int, os.listdir(f'/proc/{pid}/task')):
        try:
            found.add((os.sched_getscheduler(thread), os.sched_getparam(thread).sched_priority))
        except ProcessLookupError:
            continue
    return found


def may_prioritise():
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    except PermissionError:
        return False
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    return True


@pytest.mark.skipif(not may_prioritise(), reason='this user may have no real-time priority')
def test_all_threads_have_the_priority_and_nothing_that_they_start(tmp_path):
    with Process('mpc', {'thread_priority': PRIORITY}, tmp_path / 'log') as node:
        assert wait_until(lambda: scheduled(node.pid) == {REAL_TIME}, PATIENCE)


def test_a_plant_asks_for_the_priority_of_all_its_threads(start_here, monkeypatch):
    asked = {}
    monkeypatch.setattr(os, 'sched_setscheduler', lambda thread, policy, param: asked.update(
        {thread: (policy, param.sched_priority)}))
    before = {*map(int, os.listdir('/proc/self/task'))}
    node = start_here('plant', {'thread_priority': PRIORITY})
    node.wait_for('states a second')
    assert wait_until(lambda: node.thread.native_id in asked)
    node.stop()
    assert {*asked.values()} == {REAL_TIME}
    assert asked.keys() - before   # of the middleware, too


def test_a_priority_that_the_user_may_not_have_is_refused_with_a_remedy():
    without = ['prlimit', '--rtprio=0']
    if os.geteuid() == 0:
        without += ['setpriv', '--inh-caps=-sys_nice', '--bounding-set=-sys_nice']
    done = subprocess.run(
        [*without, 'ros2', 'run', 'dp_swing_ros', 'plant', '--ros-args', '-p',
         f'thread_priority:={PRIORITY}'], capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith(
        f"plant: error: parameter 'thread_priority' is {PRIORITY}; this user may have 0 at most "
        '(ulimit -r). Allow more in /etc/security/limits.conf')
