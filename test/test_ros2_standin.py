# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""scripts/ros2, which stands in for ros2cli, on a prefix that holds one package."""

import os
from pathlib import Path
import signal
import subprocess
import sys

import pytest

ROS2 = Path(__file__).parents[1] / 'scripts' / 'ros2'


@pytest.fixture
def prefix(tmp_path):
    """Return a prefix with the package 'swing': two executables and a text."""
    marker = tmp_path / 'share' / 'ament_index' / 'resource_index' / 'packages' / 'swing'
    marker.parent.mkdir(parents=True)
    marker.touch()
    folder = tmp_path / 'lib' / 'swing'
    folder.mkdir(parents=True)
    (folder / 'echo').write_text('#!/bin/sh\nprintf "<%s>" "$@"\nexit 3\n')
    (folder / 'sleeper').write_text('#!/bin/sh\ntrap "exit 7" INT\necho $$\nread forever\n')
    (folder / 'notes').write_text('no executable')
    for name in ('echo', 'sleeper'):
        (folder / name).chmod(0o755)
    return tmp_path


def start(prefix, *arguments):
    return subprocess.Popen(
        [sys.executable, ROS2, *arguments], text=True,
        env={**os.environ, 'AMENT_PREFIX_PATH': str(prefix)},
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def call(prefix, *arguments):
    process = start(prefix, *arguments)
    output, error = process.communicate(timeout=30)
    return process.returncode, output, error


def test_run_passes_arguments_and_exit_code(prefix):
    words = ('--ros-args', '-p', 'a:=[1.0, 2.0]', '--help', '')
    assert call(prefix, 'run', 'swing', 'echo', *words) == (
        3, ''.join(f'<{word}>' for word in words), '')


def test_run_becomes_the_executable(prefix):
    with start(prefix, 'run', 'swing', 'sleeper') as process:
        assert int(process.stdout.readline()) == process.pid
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=30) == 7


@pytest.mark.parametrize('arguments', [(), ('swing',)])
def test_pkg_executables(prefix, arguments):
    assert call(prefix, 'pkg', 'executables', *arguments) == (
        0, 'swing echo\nswing sleeper\n', '')


@pytest.mark.parametrize('arguments, says', [
    (['run', 'wing', 'echo'], "no package 'wing' in AMENT_PREFIX_PATH; available: swing"),
    (['run', '../wing', 'echo'], "no package '../wing' in AMENT_PREFIX_PATH; available: swing"),
    (['pkg', 'executables', 'wing'], "no package 'wing' in AMENT_PREFIX_PATH; available: swing"),
    (['run', 'swing', 'notes'], "no executable 'notes' in package 'swing'; "
                                'available: echo, sleeper'),
    (['topic', 'list'], "cannot do 'topic list'; this stand-in knows"),
    (['run', 'swing'], "cannot do 'run swing'; this stand-in knows"),
])
def test_what_it_cannot_do_is_one_line(prefix, arguments, says):
    code, output, error = call(prefix, *arguments)
    assert (code, output) == (2, '')
    assert error.startswith(f'ros2: {says}')
    assert error.count('\n') == 1


def test_without_a_sourced_workspace_it_says_what_to_source():
    code, _, error = call('', 'run', 'swing', 'echo')
    assert code == 2
    assert error == 'ros2: AMENT_PREFIX_PATH is not set; source install/setup.bash first\n'


@pytest.mark.parametrize('arguments', [[], ['--help']])
def test_help(prefix, arguments):
    code, output, _ = call(prefix, *arguments)
    assert code == 0
    assert output.startswith('usage: ros2 run PACKAGE EXECUTABLE')
