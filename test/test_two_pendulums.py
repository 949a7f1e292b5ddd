# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Two pendulums at the same time in one ROS domain, one of them in a namespace."""

from contextlib import ExitStack
import time
from unittest.mock import patch

from conftest import PATIENCE
from one_process import Crew
import pytest

from dp_swing_ros.bags import read_episode
from dp_swing_ros.errors import BagError
from dp_swing_ros.nodes import connections
from dp_swing_ros.nodes.logger import LoggerNode
from dp_swing_ros.nodes.mpc import MpcNode
from dp_swing_ros.nodes.plant import PlantNode
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

    def crew(name, namespace, **parameters):
        parameters['logger'] = {'output': str(folder / name), 'progress_period': 0.0,
                                **parameters.get('logger', {})}
        arguments = ['-r', f'__ns:={namespace}'] if namespace else []
        return stack.enter_context(Crew(folder / f'{name}.yaml', {
            f'/**/{node}': values for node, values in parameters.items()}, arguments))

    with ExitStack() as stack:
        crews = [crew(name, namespace, mpc={'solver': solver},
                      plant={'duration': DURATION, 'lockstep': True})
                 for name, namespace, solver in (('first', '', 'mppi'),
                                                 ('second', '/second', 'ddp'))]
        third = crew('both', '/third', logger={'topics': BOTH})
        # as of processes: those of another crew are not found at once
        stack.enter_context(patch.object(connections, 'QUIET', 40))
        loggers = [each.start(LoggerNode) for each in (*crews, third)]
        controllers = [each.start(MpcNode) for each in crews]
        plants = [each.start(PlantNode) for each in crews]

        def all_is_answered():
            return all(plant.done and mpc.core.answered == plant.core.state.stamp
                       for mpc, plant in zip(controllers, plants))
        end = time.monotonic() + PATIENCE
        while not all_is_answered() and time.monotonic() < end:
            for each in (*crews, third):
                each.executor.spin_once(0.0)
        assert all_is_answered()
        for each, mpc, plant in zip(crews, controllers, plants):
            each.end(plant)
            each.end(mpc)
        for logger in loggers:
            logger.close()
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
