# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the environment tells ROS: obeyed, or refused in one line that names the variable."""

import json
import os
import subprocess
import sys

from conftest import PATIENCE
import pytest

from dp_swing_ros import environment

JUNK = [
    ('RMW_IMPLEMENTATION', 'rmw_nobodys_cpp', 'cannot be loaded'),
    ('RCL_ASSERT_RMW_ID_MATCHES', '../rmw', 'cannot be loaded'),
    *(('ROS_DOMAIN_ID', value, 'a whole number from 0 to 232')
      for value in ('300', '233', '-1', 'abc', '1.0', '9' * 10_000, '\u0663')),
    ('FASTRTPS_DEFAULT_PROFILES_FILE', '/nowhere/profile.xml', 'no such file'),
    ('FASTRTPS_DEFAULT_PROFILES_FILE', '/dev/zero', 'no such file'),
    ('FASTRTPS_DEFAULT_PROFILES_FILE', __file__, 'not well-formed'),
    *((name, 'junk', f'one of {", ".join(choices)}')
      for name, choices in environment.CHOICES.items())]


@pytest.fixture(autouse=True)
def bare(monkeypatch):
    """Leave nothing of the environment that is for ROS."""
    for name in list(os.environ):
        if name.startswith(environment.OF_ROS):
            monkeypatch.delenv(name)


@pytest.mark.parametrize('name, value, words', JUNK, ids=lambda each: each[:20])
def test_what_ros_cannot_obey_is_one_line(monkeypatch, name, value, words):
    monkeypatch.setenv(name, value)
    line = environment.misused()
    assert line.startswith(f'the environment variable {name} is {value[:80]!r}; ')
    assert words in line and line.endswith(', or unset it') and len(line.splitlines()) == 1


@pytest.mark.parametrize('name, value', [
    ('RMW_IMPLEMENTATION', 'rmw_fastrtps_cpp'), ('ROS_DOMAIN_ID', '0'), ('ROS_DOMAIN_ID', '232'),
    *((name, choice) for name, choices in environment.CHOICES.items() for choice in choices),
    *((name, '') for name, *_ in JUNK)])
def test_what_ros_obeys_is_left_to_it(monkeypatch, name, value):
    monkeypatch.setenv(name, value)
    assert environment.misused() == ''


# each executable as `ros2 run` calls it, then as `python -m dp_swing_ros` does
CALLING = """
from contextlib import redirect_stderr, redirect_stdout
import io, json, runpy, sys
from dp_swing_ros import executables

def called(name, work):
    sys.argv = [name, *[name] * (work is module), '--version']
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()) as error:
        try:
            code = work()
        except SystemExit as end:
            code = end.code
    return name, code, error.getvalue()

def module():
    runpy.run_module('dp_swing_ros', run_name='__main__')

answers = [called(name, work) for name in ('plant', 'demo', 'recover')
           for work in (getattr(executables, name), module)]
print(json.dumps([answers, 'rclpy' in sys.modules]))
"""


def test_what_talks_to_ros_ends_before_it_loads_it(monkeypatch):
    """A tool that needs no ROS does its work."""
    monkeypatch.setenv('RMW_IMPLEMENTATION', 'rmw_nobodys_cpp')
    done = subprocess.run([sys.executable, '-c', CALLING], capture_output=True, text=True,
                          timeout=PATIENCE)
    assert done.returncode == 0, done.stderr
    answers, has_loaded = json.loads(done.stdout)
    assert len(answers) == 6 and not has_loaded
    for name, code, error in answers:
        assert ('RMW_IMPLEMENTATION' in error) is (name != 'recover'), name
        if name != 'recover':
            assert (code, error.count('\n')) == (2, 1), name
