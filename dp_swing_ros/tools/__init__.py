# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Command lines over nodes, bags and episodes."""

from pathlib import Path
import sys


def program(tool: str) -> str:
    """Return how a tool was called: by ros2 run, or without colcon by the package's one name."""
    called = Path(sys.argv[0])
    if called.name == '__main__.py':
        return f'python -m dp_swing_ros {tool}'
    return f'dp_swing_ros {tool}' if called.name == 'dp_swing_ros' \
        else f'ros2 run dp_swing_ros {tool}'
