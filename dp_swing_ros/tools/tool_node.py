# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The node of a tool, which listens beside the nodes of a run."""

from collections.abc import Iterator
from contextlib import contextmanager

import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from dp_swing_ros.topics import JOINT_STATES


@contextmanager
def tool_node(name: str) -> Iterator[Node]:
    """Yield a node that offers nothing, and takes no arguments of this process."""
    context = rclpy.Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    node = Node(name, context=context, enable_rosout=False, start_parameter_services=False,
                use_global_arguments=False)
    try:
        yield node
    finally:
        node.destroy_node()
        context.try_shutdown()


def listeners(node: Node) -> set[str]:
    """Return the names of the nodes that subscribe to the states."""
    return {end.node_name for end in node.get_subscriptions_info_by_topic(JOINT_STATES.name)}
