# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Two pendulums at the same time in one ROS domain, one of them in a namespace."""

import signal

from conftest import NodeProcess
import pytest

from dp_swing_ros.bags import read_episode
from dp_swing_ros.errors import BagError
from dp_swing_ros.report.recording import recording
from dp_swing_ros.tools import analyse, compare, verify

DURATION = 1.5
BOTH = ['/joint_states', '/force_command', '/configuration', '/robot_description', '/diagnostics',
        '/second/joint_states', '/second/force_command', '/second/configuration',
        '/second/robot_description']


@pytest.fixture(scope='module')
def bags(tmp_path_factory):
    """Return the bags of loggers in no namespace, in /second, and of one that takes both."""
    folder = tmp_path_factory.mktemp('two')
    started = []

    def start(name, parameters, namespace):
        arguments = ['-r', f'__ns:={namespace}'] if namespace else []
        log = folder / f'{name}_{len(started)}.log'
        started.append(NodeProcess(name, log, parameters, arguments))
        return started[-1]

    loggers = [start('logger', {'output': str(folder / 'first')}, ''),
               start('logger', {'output': str(folder / 'second')}, '/second'),
               start('logger', {'output': str(folder / 'both'), 'topics': BOTH}, '/third')]
    try:
        for solver, namespace in (('mppi', ''), ('ddp', '/second')):
            start('mpc', {'solver': solver}, namespace).wait_for('ready')
        plants = [start('plant', {'duration': DURATION, 'lockstep': True}, namespace)
                  for namespace in ('', '/second')]
        assert [each.wait() for each in plants] == [0, 0]
        assert [each.stop() for each in loggers] == [0, 0, 0]
    finally:
        for each in started:
            each.signal(signal.SIGKILL)
            each.popen.wait()
    return folder


@pytest.mark.parametrize('name, options, solver', [
    ('first', [], 'mppi'), ('second', [], 'ddp'),
    ('both', ['--namespace', '/'], 'mppi'), ('both', ['--namespace', '/second'], 'ddp')])
def test_each_is_verified_and_read_as_what_it_was(bags, capsys, name, options, solver):
    bag = str(bags / name)
    assert verify.main([bag, *options]) == 0
    assert f'ticks of {solver} in lockstep' in capsys.readouterr().out
    namespace = options[-1] if options else None
    assert read_episode(bag, namespace=namespace).solver == solver
    assert recording(bag, namespace=namespace).configurations['mpc'].parameters['solver'] == solver


def test_the_one_in_a_namespace_is_analysed_as_what_it_was(bags, tmp_path, capsys):
    assert analyse.main([str(bags / 'second'), '--no-animation', '--output', str(tmp_path)]) == 0
    assert 'ddp' in capsys.readouterr().out


@pytest.mark.parametrize('tool', [verify, analyse, compare])
def test_of_a_bag_of_both_one_must_be_chosen(bags, capsys, tool):
    assert tool.main([str(bags / 'both')]) == 2
    error = capsys.readouterr().err
    assert 'several pendulums' in error and '--namespace /second' in error
    assert tool.main([str(bags / 'both'), '--namespace', '/third']) == 2
    assert "no joint_states in the namespace '/third'" in capsys.readouterr().err


def test_a_pendulum_that_is_not_there_is_named(bags):
    with pytest.raises(BagError, match='/second/joint_states'):
        read_episode(bags / 'second', namespace='/')
