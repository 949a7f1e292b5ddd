# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The parameters of a plant or an mpc, which depend on how many links there are."""

from typing import Any

from rclpy.node import Node

from dp_swing_ros import configuration
from dp_swing_ros.nodes.ros_parameters import declare, given, overrides


def declare_pendulum(node: Node, kind: str) -> dict[str, Any]:
    """
    Declare the parameters of a plant or an mpc, those of a pendulum with as many links as given.

    Raises ParameterError, as `declare`.
    """
    values = {name: given(node, name, None) for name in overrides(node)}
    links = configuration.links_in(values)
    for name in values:
        configuration.check_links(kind, name, links)
    return declare(node, configuration.declared(kind, links), links)
