# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

import contextlib
import os
from pathlib import Path
import signal
import socket
import subprocess
import time
from xml.etree import ElementTree

from conftest import wait_until
import pytest

from dp_swing_ros.declarations import DECLARATIONS
from dp_swing_ros.errors import UserError
from dp_swing_ros.runtime.mpc import ENDING
from dp_swing_ros.tools import processes
from dp_swing_ros.tools.processes import (
    attributed, await_ready, Crew, isolated, Process, ProcessError)

# stands for ros2: the executable's name says how it behaves
ROS2 = """\
#!/bin/bash
echo "$@"
case "$3" in
    polite) trap 'echo bye; exit 0' INT; echo 'obeys'; while true; do sleep 0.05; done;;
    rude) trap '' INT; sleep 60 & echo "child $!"; wait;;
    broken) echo 'it broke' >&2; exit 3;;
    short) exit 0;;
esac
"""


@pytest.fixture(autouse=True)
def ros2(tmp_path, monkeypatch):
    path = tmp_path / 'bin' / 'ros2'
    path.parent.mkdir()
    path.write_text(ROS2)
    path.chmod(0o755)
    monkeypatch.setenv('PATH', str(path.parent), prepend=os.pathsep)


def started(process, word):
    """Wait for a line with the word, which comes once the signal is handled."""
    lines = []
    assert wait_until(lambda: lines.extend(process.new_lines())
                      or any(word in line for line in lines))
    return lines


def alive(pid):
    try:
        return Path(f'/proc/{pid}/stat').read_text().split()[2] != 'Z'
    except OSError:
        return False


def test_parameters_reach_ros_as_they_are_and_half_a_line_waits_for_its_end(tmp_path):
    file, other, log = (tmp_path / name for name in ('some.yaml', 'other.yaml', 'log'))
    file.write_text('/**:\n  ros__parameters: {seed: 3}\n')
    other.write_text('/**/long:\n  ros__parameters: {seed: 3}\n')   # of which it would warn
    process = Process('short', {'duration': 10.0, 'lockstep': True, 'output': '2024'},
                      log, parameter_files=[file, other])
    process.finish()
    assert process.new_lines() == [
        f'run dp_swing_ros short --ros-args --params-file {file} '
        '-p duration:=10.0 -p lockstep:=true -p output:="2024"']
    with log.open('a') as lines:
        lines.write('one\ntw')
    assert process.new_lines() == ['one']
    with log.open('a') as lines:
        lines.write('o\n')
    assert process.new_lines() == ['two']


def test_who_fails_or_does_not_come_is_named_and_a_polite_process_ends_when_asked(
        tmp_path, monkeypatch):
    with Process('polite', {}, tmp_path / 'polite.log') as polite:
        started(polite, 'obeys')
        polite.check()
        with Process('broken', {}, tmp_path / 'broken.log') as broken:
            assert wait_until(lambda: not broken.running)
            with pytest.raises(ProcessError, match='broken ended with exit code 3(.|\n)*it broke'):
                broken.finish()
            with pytest.raises(ProcessError, match='broken ended early with exit code 3'):
                broken.check()
            with pytest.raises(ProcessError, match='broken ended early'):
                await_ready([polite, broken], lambda: {'broken'}, time.sleep)
        names = iter([{'a', 'b'}, {'b'}])
        await_ready([polite], lambda: next(names, set()), time.sleep)
        monkeypatch.setattr(processes, 'READY', 0.3)
        with pytest.raises(ProcessError, match='^a and b not ready after 0.3 s'):
            await_ready([polite], lambda: {'b', 'a'}, time.sleep)
        polite.check()
        polite.end()
        assert not polite.running
        assert polite.new_lines() == ['bye']
        assert polite.new_lines() == []


def test_process_that_does_not_end_is_an_error_and_can_be_killed(tmp_path, monkeypatch):
    """Its number is not that of `ros2 run`: ros2cli waits for what it starts."""
    monkeypatch.setattr(processes, 'GRACE', 0.3)
    with Process('rude', {}, tmp_path / 'log') as rude:
        child = int(started(rude, 'child')[-1].split()[-1])
        assert rude.pid == child
        with pytest.raises(ProcessError, match='did not end within'):
            rude.end()
        rude.kill()
        assert wait_until(lambda: not alive(child))


def test_an_mpc_has_the_time_to_brake():
    longest = DECLARATIONS['mpc'].fields(2)['controlled_stop'].metadata['maximum']
    assert processes.GRACE >= longest + ENDING + 10.0


def test_nobody_is_left_behind(tmp_path, monkeypatch):
    with pytest.raises(KeyboardInterrupt):
        with Process('polite', {}, tmp_path / 'polite.log') as polite, \
                monkeypatch.context() as short, Process('rude', {}, tmp_path / 'rude.log') as rude:
            short.setattr(processes, 'GRACE', 0.5)   # of the rude one, which ends first
            started(polite, 'obeys')
            child = int(started(rude, 'child')[-1].split()[-1])
            raise KeyboardInterrupt
    assert polite.new_lines() == ['bye']
    assert not polite.running
    assert not rude.running
    assert wait_until(lambda: not alive(child))


def test_an_interrupt_while_one_starts_leaves_nobody_behind(tmp_path, monkeypatch):
    """As it comes between the start of a process and its place in the crew."""
    class Interrupted(subprocess.Popen):

        def __init__(self, *arguments, **options):
            super().__init__(*arguments, **options)
            pids.append(self.pid)
            signal.raise_signal(signal.SIGTERM)
    pids, before = [], signal.signal(signal.SIGTERM, signal.default_int_handler)
    monkeypatch.setattr(subprocess, 'Popen', Interrupted)
    monkeypatch.setattr(processes, 'GRACE', 0.5)
    try:
        with pytest.raises(KeyboardInterrupt), Crew() as crew:
            crew.start('rude', {}, tmp_path / 'log')
            pytest.fail('the interrupt was lost')
    finally:
        signal.signal(signal.SIGTERM, before)
    assert not alive(*pids)


@pytest.mark.parametrize('line, text', [
    ('[INFO] [1732.25] [mpc]: ready', 'ready'), ('[WARN] [1.5] [a.b]: [1] x', '[1] x'),
    ('plain text', 'plain text'), ('mpc: loading', 'loading')])
def test_a_line_of_a_log_names_its_node_once(line, text):
    assert attributed('mpc', line) == f'mpc: {text}'


def test_missing_ros2_is_said(tmp_path, monkeypatch):
    monkeypatch.setenv('PATH', '')
    with pytest.raises(UserError, match='no ros2 on the PATH'):
        Process('short', {}, tmp_path / 'log')


@pytest.fixture(autouse=True)
def environment(monkeypatch):
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'SUBNET')
    monkeypatch.setenv('ROS_DOMAIN_ID', '')
    monkeypatch.setenv('FASTRTPS_DEFAULT_PROFILES_FILE', 'mine.xml')


def test_domain_of_the_user_is_kept(monkeypatch):
    monkeypatch.setenv('ROS_DOMAIN_ID', '42')
    with isolated() as domain:
        assert domain == '42'
        assert os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'
    assert os.environ['ROS_DOMAIN_ID'] == '42'


def test_two_at_once_get_different_domains(monkeypatch):
    with isolated() as domain:
        assert os.environ['ROS_DOMAIN_ID'] == domain
        monkeypatch.setenv('ROS_DOMAIN_ID', '')
        with isolated() as other:
            assert other != domain


def test_domain_with_a_participant_is_passed_over(monkeypatch):
    # whoever looks for one beside this test takes the first
    monkeypatch.setattr(processes, 'DOMAINS', processes.DOMAINS[::-1])
    with isolated() as domain:
        pass
    monkeypatch.setattr(processes, 'DOMAINS', [int(domain)])
    with contextlib.closing(socket.socket(socket.AF_INET, socket.SOCK_DGRAM)) as participant:
        participant.bind(('', 7400 + 250 * int(domain) + 12))
        with pytest.raises(UserError, match='set ROS_DOMAIN_ID'), isolated():
            pass
    with isolated() as again:
        assert again == domain


def test_profile_of_the_user_is_kept():
    with isolated():
        assert os.environ['FASTRTPS_DEFAULT_PROFILES_FILE'] == 'mine.xml'


def test_profile_of_the_package_is_one_of_fast_dds(monkeypatch):
    monkeypatch.delenv('FASTRTPS_DEFAULT_PROFILES_FILE')
    with isolated():
        profile = Path(os.environ['FASTRTPS_DEFAULT_PROFILES_FILE'])
    root = ElementTree.parse(profile).getroot()
    participant = root.find('.//{*}participant')
    assert participant.get('is_default_profile') == 'true'
    assert participant.find('.//{*}leaseAnnouncement') is not None
