# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Plant, mpc and logger in this process: what `demo` records, without the time processes take."""

from contextlib import ExitStack, redirect_stdout
from functools import cache
import gc
import io
import time
from unittest.mock import patch

import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
import yaml

from dp_swing_ros import provenance
from dp_swing_ros.nodes import connections, ros_parameters
from dp_swing_ros.nodes.logger import LoggerNode
from dp_swing_ros.nodes.mpc import MpcNode
from dp_swing_ros.nodes.plant import PlantNode
from dp_swing_ros.nodes.taking import Executor
from dp_swing_ros.tools.demo import keeping
from dp_swing_ros.topics import DIAGNOSTICS, FORCE_COMMAND, JOINT_STATES

COMMIT = cache(provenance.commit)   # asks git
PATIENCE = 120.0   # [s] for a run
ANSWER = 1.0       # [s] for the one to the last state, which may be lost
SILENCE = 5.0      # [s] at most, until an mpc that hears no state in real time sends a zero


def run(bag, parameters, meddle=None):
    """
    Let a plant run until it is done, and record that; parameters are of each node, by name.

    meddle is given a node with which to do more.
    """
    given = {'logger': {'output': str(bag), 'progress_period': 0.0},
             'mpc': keeping(FORCE_COMMAND, DIAGNOSTICS), 'plant': keeping(JOINT_STATES)}
    file = bag.with_name('nodes.yaml')
    file.write_text(yaml.safe_dump({node: {'ros__parameters': {**parameters.get(node, {}), **own}}
                                    for node, own in given.items()}))
    with ExitStack() as stack:
        # nodes of one process find each other at once
        stack.enter_context(patch.object(connections, 'QUIET', 1))
        stack.enter_context(redirect_stdout(io.StringIO()))
        stack.enter_context(patch.object(ros_parameters, 'commit', COMMIT))
        stack.callback(gc.unfreeze)   # what the mpc has frozen
        rclpy.init(args=['run', '--ros-args', '--params-file', str(file)],
                   signal_handler_options=SignalHandlerOptions.NO)
        stack.callback(rclpy.try_shutdown)
        executor = stack.enter_context(Executor())

        def add(node):
            stack.callback(node.destroy_node)
            executor.add_node(node)
            return node

        def start(kind):
            node = add(kind())
            node.prepare()
            return node

        def spin(seconds, is_over=lambda: False):
            end = time.monotonic() + seconds
            while not is_over() and time.monotonic() < end:
                executor.spin_once(0.02)
            return is_over()

        if meddle is not None:
            meddle(add(Node('other')))
        logger, mpc, plant = (start(kind) for kind in (LoggerNode, MpcNode, PlantNode))
        assert spin(PATIENCE, lambda: plant.done)
        executor.remove_node(plant)
        if plant.core.lockstep:
            spin(ANSWER, lambda: mpc.core.answered == plant.core.state.stamp)
        else:
            spin(SILENCE, mpc.silence.is_canceled)
        executor.remove_node(mpc)
        mpc.close()
        logger.close()   # which takes what is still underway
    return bag
