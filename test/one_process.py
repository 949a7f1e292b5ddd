# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Plant, mpc and logger in this process: what `demo` records, without the time processes take."""

from contextlib import contextmanager, ExitStack, redirect_stdout
import gc
import io
import os
from unittest.mock import patch

from conftest import spin_until
from domains import claim_domain
import rclpy
from rclpy import utilities
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
import yaml

from dp_swing_ros.nodes import connections
from dp_swing_ros.nodes.logger import LoggerNode
from dp_swing_ros.nodes.mpc import MpcNode
from dp_swing_ros.nodes.plant import PlantNode
from dp_swing_ros.nodes.taking import Executor
from dp_swing_ros.tools.demo import asked, command_line, keeping
from dp_swing_ros.topics import DIAGNOSTICS, FORCE_COMMAND, JOINT_STATES

TRIES = 8
DOMAIN, LOCK = claim_domain()   # where runs are recorded that nobody else hears
PATIENCE = 120.0   # [s] for a run
ANSWER = 5.0       # [s] for the one to the last state, which may be lost
SILENCE = 5.0      # [s] at most, until an mpc that hears no state in real time sends a zero


class Crew:
    """Nodes of this process, which find each other at once; used as a context manager."""

    def __init__(self, file, parameters, arguments=(), domain=None):
        """Take the parameters of each node, by name, which are written to a file, and a domain."""
        self.arguments = ['crew', '--ros-args', '--params-file', str(file), *arguments]
        self.stack, self.domain = ExitStack(), domain
        file.write_text(yaml.safe_dump({
            node: {'ros__parameters': own} for node, own in parameters.items()}))

    def __enter__(self):
        enter = self.stack.enter_context
        enter(patch.object(connections, 'QUIET', 1))
        enter(patch.object(os, 'nice', lambda by: by))   # what is made aside is waited for
        enter(redirect_stdout(io.StringIO()))   # what a logger says in the end
        self.stack.callback(gc.unfreeze)        # what an mpc has frozen
        self.context = rclpy.Context()
        rclpy.init(args=self.arguments, context=self.context, domain_id=self.domain,
                   signal_handler_options=SignalHandlerOptions.NO)
        self.stack.callback(self.context.try_shutdown)
        self.executor = enter(Executor(context=self.context))
        return self

    def __exit__(self, *error):
        self.stack.close()

    def add(self, node):
        """Let a node take part, and return it."""
        self.stack.callback(node.destroy_node)
        self.executor.add_node(node)
        return node

    def start(self, kind):
        """Start a node of ours, and return it."""
        # each crew has arguments, and so a context, of its own
        with patch.object(utilities, 'g_default_context', self.context):
            node = self.add(kind())
            node.prepare()
        return node

    def until(self, is_over, seconds=PATIENCE):
        """Let callbacks come until it is over, at most for some seconds; return whether it is."""
        return spin_until(self.executor, is_over, seconds)

    def end(self, node):
        """Let a node do no more, and say its last words."""
        self.executor.remove_node(node)
        # one that waits for another time begins anew: what this node was about to take is left
        self.executor.spin_once(0.0)
        node.close()


@contextmanager
def recording(bag, parameters, meddle=None):
    """
    Yield a crew, an mpc and a plant that run, and are recorded; parameters are of each, by name.

    meddle is given a node with which to do more.
    """
    given = {'logger': {'output': str(bag), 'progress_period': 0.0},
             'mpc': keeping(FORCE_COMMAND, DIAGNOSTICS), 'plant': keeping(JOINT_STATES)}
    with Crew(bag.with_name('nodes.yaml'), {
            node: {**parameters.get(node, {}), **own} for node, own in given.items()},
            domain=DOMAIN) as crew:
        if meddle is not None:
            meddle(crew.add(Node('other', context=crew.context)))
        logger, mpc, plant = map(crew.start, (LoggerNode, MpcNode, PlantNode))
        yield crew, mpc, plant
        crew.end(plant)
        if plant.core.lockstep:
            crew.until(lambda: mpc.core.answered == plant.core.state.stamp, ANSWER)
        else:
            crew.until(mpc.silence.is_canceled, SILENCE)
        crew.end(mpc)
        logger.close()   # which takes what is still underway


def run(bag, parameters, meddle=None):
    """Record a run, as above, until the plant is done; return the bag."""
    with recording(bag, parameters, meddle) as (crew, _, plant):
        assert crew.until(lambda: plant.done)
    return bag


def recorded_until(is_enough, folder, *arguments, **parameters):
    """
    Record as below until a bag is enough, and return it.

    In real time a busy machine may hold this process up, and leave few ticks or none.
    """
    bags = (record(folder / str(n), *arguments, **parameters) for n in range(TRIES))
    return next(bag for bag in bags if is_enough(bag))


def record(folder, *arguments, plant='', mpc='', meddle=None):
    """
    Record what the demo would, with these lines of parameters, and return its bag.

    meddle is given a node with which to do more.
    """
    of_files = {'mpc': yaml.safe_load(mpc) or {}, 'plant': yaml.safe_load(plant) or {}}
    parameters, bag = asked(command_line().parse_args(arguments), of_files), folder / 'run' / 'bag'
    bag.parent.mkdir(parents=True)
    return run(bag, {node: {**own, **parameters[node]} for node, own in of_files.items()}, meddle)
