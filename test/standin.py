# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What stands in for ros2cli, in the test's process."""

from contextlib import redirect_stderr, redirect_stdout
import io
from pathlib import Path
import runpy
from unittest.mock import patch

from rclpy import utilities

ROS2 = Path(__file__).parents[1] / 'scripts' / 'ros2'
MAIN = runpy.run_path(str(ROS2))['main']


def ros2(*arguments):
    """Do here what it does; return exit code, output and errors."""
    # a context of its own, beside those of nodes of the test
    with redirect_stdout(io.StringIO()) as output, redirect_stderr(io.StringIO()) as errors, \
            patch.object(utilities, 'g_default_context', None):
        try:
            code = MAIN(list(arguments)) or 0
        except SystemExit as end:
            code = end.code
    return code, output.getvalue(), errors.getvalue()
