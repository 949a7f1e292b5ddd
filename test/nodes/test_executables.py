# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Each node as it is started: its first line, its help, its parameter files, early signals."""

import signal
import time

import pytest

NODES = ('plant', 'mpc', 'relay', 'logger', 'replay', 'console')


@pytest.mark.parametrize(('name', 'option'), [
    *((name, '--help') for name in NODES), ('plant', '-h')])
def test_help_says_what_it_does_and_takes(start_node, name, option):
    node = start_node(name, options=[option])
    assert node.wait() == 0
    assert f'usage: ros2 run dp_swing_ros {name}' in node.output()
    for word in {'plant': ('joint_states  ', 'cart_mass:=1 kg', 'plant/reset'),
                 'mpc': ('force_command  ', 'mppi.samples:=', 'solver:=ilqr'),
                 'relay': ('force_controller/commands', 'force_command  '),
                 'logger': ('configuration  ', 'output:='),
                 'replay': ('replay/pause', 'rate:=1'),
                 'console': ('disturbance  ', 'port:=8080')}[name]:
        assert word in node.output()


@pytest.mark.parametrize('delay', [0.15, 0.5, 1.0, 2.0])
@pytest.mark.parametrize('name', ['plant', 'mpc', 'logger'])
def test_an_early_signal_ends_it_without_a_word(start_node, tmp_path, name, delay):
    node = start_node(name, {'output': str(tmp_path / 'bag')} if name == 'logger' else {},
                      environment={'XDG_CACHE_HOME': str(tmp_path)})
    node.wait_for('loading')
    time.sleep(delay)
    assert node.stop(signal.SIGINT, timeout=60) == 0, node.output()
    assert 'Traceback' not in node.output()


@pytest.mark.parametrize('name', ['plant', 'mpc'])
def test_the_first_line_comes_before_anything_is_compiled(start_node, tmp_path, name):
    node = start_node(name, environment={'XDG_CACHE_HOME': str(tmp_path)})
    node.wait_for('loading', timeout=10)
    node.wait_for('preparing', timeout=30)
    assert not list(tmp_path.rglob('*.nbc'))


SHARED = """
/**:
  ros__parameters: {cart_mass: 1.2, solver: ddp, of_another_node: 3}
"""


@pytest.mark.parametrize('name', NODES)
def test_of_what_is_for_any_node_each_takes_its_own(start_node, tmp_path, name):
    file = tmp_path / 'shared.yaml'
    file.write_text(SHARED)
    own = {'logger': {'output': str(tmp_path / 'bag')}, 'console': {'port': 0}}
    node = start_node(name, own.get(name, {}), arguments=['--params-file', str(file)])
    expected = {'plant': 'states a second', 'mpc': "the solver 'ddp'",
                'relay': 'ready, for /force_controller/commands',
                'logger': 'recording to', 'replay': "parameter 'bag' is empty",
                'console': 'the page is at'}[name]
    node.wait_for(expected)
    node.stop()
    assert 'unknown parameter' not in node.output()


@pytest.mark.parametrize('text, arguments', [
    ('/**/plant:\n  ros__parameters: {solver: ddp}\n', []),
    ('plant:\n  ros__parameters: {solver: ddp}\n', []),
    (SHARED, ['-p', 'solver:=mppi'])])
def test_what_is_for_this_node_must_be_its_own(start_node, tmp_path, text, arguments):
    file = tmp_path / 'own.yaml'
    file.write_text(text)
    node = start_node('plant', arguments=['--params-file', str(file), *arguments])
    assert node.wait() == 2
    assert "plant: error: unknown parameter 'solver' of the node 'plant'" in node.output()
