# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the environment tells ROS: obeyed, or refused in one line that names the variable."""

import os
import subprocess
import sys

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


@pytest.mark.parametrize('program', ['executables', '__main__'])
@pytest.mark.parametrize('name, ends', [('plant', True), ('demo', True), ('recover', False)])
def test_what_talks_to_ros_ends_before_it_loads_it(monkeypatch, program, name, ends):
    """A tool that needs no ROS does its work."""
    monkeypatch.setenv('RMW_IMPLEMENTATION', 'rmw_nobodys_cpp')
    code = (f'import sys; from dp_swing_ros import {program} as program; '
            f'sys.argv = ["{name}", "--version"]; sys.exit(program.{name}())')
    command = ['-m', 'dp_swing_ros', name, '--version'] if program == '__main__' else ['-c', code]
    done = subprocess.run([sys.executable, *command], capture_output=True, text=True, timeout=120)
    assert ('RMW_IMPLEMENTATION' in done.stderr) is ends
    if ends:
        assert (done.returncode, done.stderr.count('\n')) == (2, 1)
