# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How long it takes from the start of the mpc's process to its first force.

A peer in this process sends states at 20 Hz, stamped now, to `ros2 run dp_swing_ros mpc`. Cold is
with an empty folder for compiled kernels; warm is the same command again. Needs the installed
package and ROS (`make shell`).
"""

import os
from pathlib import Path
import signal
import subprocess
import tempfile
import time

from dp_swing_ros.pendulum.state import hanging

PERIOD = 0.05     # [s]
PATIENCE = 180.0  # [s]


def first_force(solver: str, cache: Path) -> float:
    """
    Return the time [s] from the start of the process to its first force.

    Raises RuntimeError where none comes.
    """
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node

    from dp_swing_ros.nodes.connections import publish, subscribe
    from dp_swing_ros.nodes.messages import to_joint_state
    from dp_swing_ros.topics import FORCE_COMMAND, JOINT_STATES

    heard: list[float] = []
    context = rclpy.Context()
    rclpy.init(context=context)
    node = Node('benchmark', context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    subscribe(node, FORCE_COMMAND, lambda _: heard.append(time.perf_counter()))
    states = publish(node, JOINT_STATES)
    began = time.perf_counter()
    process = subprocess.Popen(
        ['ros2', 'run', 'dp_swing_ros', 'mpc', '--ros-args', '-p', f'solver:={solver}'],
        env={**os.environ, 'NUMBA_CACHE_DIR': str(cache)}, start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        while not heard and process.poll() is None and time.perf_counter() - began < PATIENCE:
            states.publish(to_joint_state(node.get_clock().now().to_msg(), hanging(), 0.0))
            sent = time.perf_counter()
            while not heard and (rest := PERIOD - (time.perf_counter() - sent)) > 0:
                executor.spin_once(timeout_sec=rest)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGINT)
        process.wait()
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()
    if not heard:
        raise RuntimeError(f'the mpc sent no force in {PATIENCE:g} s')
    return heard[0] - began


def start_ups(warm: int, solver: str) -> dict[str, list[float]]:
    """Return the times [s] of one cold start and of some warm ones."""
    with tempfile.TemporaryDirectory() as cache:
        cold = first_force(solver, Path(cache))
        return {'cold': [cold], 'warm': [first_force(solver, Path(cache)) for _ in range(warm)]}
