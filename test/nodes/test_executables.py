# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Each node as it is started: its first line, its help, its parameter files, early signals."""

import re
import sys
import time

import pytest

from dp_swing_ros import executables

NODES = ('plant', 'mpc', 'relay', 'logger', 'replay', 'console')


@pytest.mark.usefixtures('here')
@pytest.mark.parametrize(('name', 'option'), [
    *((name, '--help') for name in NODES), ('plant', '-h')])
def test_help_says_what_it_does_and_takes(monkeypatch, capsys, name, option):
    monkeypatch.setattr(sys, 'argv', [name, option])
    assert getattr(executables, name)() == 0
    shown = capsys.readouterr().out
    assert f'usage: ros2 run dp_swing_ros {name}' in shown
    for word in {'plant': ('joint_states  ', 'cart_mass:=1 kg', 'plant/reset'),
                 'mpc': ('force_command  ', 'mppi.samples:=', 'solver:=ilqr'),
                 'relay': ('force_controller/commands', 'force_command  '),
                 'logger': ('configuration  ', 'output:='),
                 'replay': ('replay/pause', 'rate:=1'),
                 'console': ('disturbance  ', 'port:=8080')}[name]:
        assert word in shown


@pytest.mark.parametrize(('name', 'delay'), [
    ('plant', 0.15), ('logger', 0.5), ('plant', 1.0)])
def test_an_early_signal_ends_it_without_a_word(start_node, tmp_path, name, delay):
    node = start_node(name, {'output': str(tmp_path / 'bag')} if name == 'logger' else {},
                      environment={'XDG_CACHE_HOME': str(tmp_path)})
    node.wait_for('loading')
    time.sleep(delay)
    assert node.stop() == 0, node.output()
    assert 'Traceback' not in node.output()


def test_the_first_line_comes_before_all_compiling_which_a_signal_ends(start_node, tmp_path):
    node = start_node('mpc', environment={'XDG_CACHE_HOME': str(tmp_path)})
    node.wait_for('loading')
    node.wait_for('preparing')
    time.sleep(0.5)   # into it
    assert node.stop() == 0, node.output()
    assert 'Traceback' not in node.output()
    said = float(re.search(r'\[([\d.]+)\] \[mpc\]: preparing', node.output())[1])
    # the clock of files may be some milliseconds behind
    assert all(file.stat().st_mtime > said - 0.1 for file in tmp_path.rglob('*.nbc'))


SHARED = """
/**:
  ros__parameters: {cart_mass: 1.2, solver: ddp, of_another_node: 3}
"""


@pytest.mark.parametrize('name', NODES)
def test_of_what_is_for_any_node_each_takes_its_own(start_here, tmp_path, name):
    file = tmp_path / 'shared.yaml'
    file.write_text(SHARED)
    own = {'logger': {'output': str(tmp_path / 'bag')}, 'console': {'port': 0}}
    node = start_here(name, own.get(name, {}), arguments=['--params-file', str(file)])
    expected = {'plant': 'states a second', 'mpc': 'ready',
                'relay': 'ready, for /force_controller/commands',
                'logger': 'recording to', 'replay': "parameter 'bag' is empty",
                'console': 'the page is at'}[name]
    node.wait_for(expected)
    assert name != 'mpc' or "the solver 'ddp'" in node.output()
    if name != 'replay':
        node.stop()
    assert 'unknown parameter' not in node.output()


@pytest.mark.parametrize('text, arguments', [
    ('/**/plant:\n  ros__parameters: {solver: ddp}\n', []),
    ('plant:\n  ros__parameters: {solver: ddp}\n', []),
    (SHARED, ['-p', 'solver:=mppi'])])
def test_what_is_for_this_node_must_be_its_own(start_here, tmp_path, text, arguments):
    file = tmp_path / 'own.yaml'
    file.write_text(text)
    node = start_here('plant', arguments=['--params-file', str(file), *arguments])
    assert node.wait() == 2
    assert "plant: error: unknown parameter 'solver' of the node 'plant'" in node.output()
