# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dp_swing_ros parameters`: the reference of all parameters, as it is in docs/."""

import argparse
from collections.abc import Sequence

from dp_swing_ros.configuration import Groups, OF_MPC, OF_PLANT, SHARED
from dp_swing_ros.nodes.parameters import LoggerParameters, ReplayParameters, table
from dp_swing_ros.tools import program

SECTIONS: dict[str, Groups] = {
    'The bodies and their limits (plant and mpc)': SHARED, 'plant': OF_PLANT, 'mpc': OF_MPC,
    'logger': [('', LoggerParameters)], 'replay': [('', ReplayParameters)]}
HEAD = """\
# Parameters

Made by `make docs` from the dataclasses that declare them. A parameter is given as
`--ros-args -p name:=value` or in a YAML file (`config/` has examples), is checked when the node
starts, and stays as it is while the node runs. What is unknown, misspelt or out of range ends the
node with one line that says what is expected. The mpc is told the same bodies and limits as the
plant unless a test of robustness wants it otherwise.
"""


def reference() -> str:
    """Return the page as Markdown."""
    return '\n'.join([HEAD, *(f'## {name}\n\n{table(groups)}'
                              for name, groups in SECTIONS.items())])


def main(argv: Sequence[str] | None = None) -> int:
    """Print the page."""
    argparse.ArgumentParser(
        prog=program('parameters'),
        description='Print all parameters of all nodes, with default, unit, range and '
                    'description, as Markdown.').parse_args(argv)
    print(reference(), end='')
    return 0
