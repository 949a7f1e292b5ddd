# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A node that observes the states: the last of them, and their subscribers."""

import time
from typing import Any

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from dp_swing_ros.messages.fields import links_in, seconds, to_state
from dp_swing_ros.nodes.connections import subscribe
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.topics import JOINT_STATES


class Observer:
    """
    The last state, its time and force; used as a context manager.

    t [s] from the first state, x (2n + 2,), u [N] applied over the period before; None at first.
    """

    t: float | None = None
    x: Array | None = None
    u: float = 0.0

    def __init__(self) -> None:
        self._first: float | None = None
        self._heard = time.monotonic()

    def __enter__(self) -> 'Observer':
        self._context = rclpy.Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = Node('demo', context=self._context, enable_rosout=False,
                          start_parameter_services=False, use_global_arguments=False)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        subscribe(self._node, JOINT_STATES, self._receive)
        return self

    def __exit__(self, *error: object) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    @property
    def silence(self) -> float:
        """Return the time [s] since the last state."""
        return time.monotonic() - self._heard

    def nodes(self) -> set[str]:
        """Return the names of the nodes that are there."""
        return set(self._node.get_node_names())

    def listeners(self) -> set[str]:
        """Return the names of the nodes that subscribe to the states."""
        return {end.node_name
                for end in self._node.get_subscriptions_info_by_topic(JOINT_STATES.name)}

    def wait(self, timeout: float) -> None:
        """Wait for the next state, at most for a time [s]."""
        self._executor.spin_once(timeout_sec=timeout)

    def _receive(self, message: Any) -> None:
        try:
            x = to_state(message, links_in(message))
        except ValueError:
            return  # of another robot
        stamp = seconds(message.header.stamp)
        self._first = stamp if self._first is None else self._first
        self.t, self.x, self._heard = stamp - self._first, x, time.monotonic()
        self.u = float(message.effort[0]) if message.effort else 0.0
