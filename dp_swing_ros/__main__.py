# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
`python -m dp_swing_ros NAME ...`: every tool and node, where `ros2 run` is not at hand.

`pip install` makes the command `dp_swing_ros` of it, and no other: a `logger` of ours would hide
the system's.
"""

from collections.abc import Sequence
from importlib import import_module
import sys

TOOLS = {
    'analyse': "a bag's table, figures and report, from the bag alone",
    'compare': 'what each solver would have done from a tick on',
    'evaluate': 'seeded campaigns: rates, scores, comparisons, pictures',
    'export': 'a run as CSV or Parquet tables, with units',
    'parameters': 'all parameters of all nodes',
    'recover': 'a whole bag from a truncated or damaged one',
    'verify': 'every recorded tick solved again, to the bit'}
NODES = {
    'plant': 'integrates the pendulum, publishes its state, applies the force',
    'mpc': 'solves from each state, publishes the force',
    'logger': 'writes the topics to an MCAP bag',
    'replay': 'plays a bag back'}
BY_COLCON = {'demo': 'runs plant, mpc and logger, and draws the results'}
MISUSED = 2


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tool or node that the first argument names; return its exit code."""
    name, *rest = (sys.argv[1:] if argv is None else argv) or ['--help']
    if name in ('-h', '--help'):
        print(usage())
        return 0
    if name not in TOOLS | NODES | BY_COLCON:
        print(f'dp_swing_ros: error: unknown command {name!r}; expected one of '
              f'{", ".join(TOOLS | NODES | BY_COLCON)}', file=sys.stderr)
        return MISUSED
    try:
        module = import_module(f'dp_swing_ros.{"nodes" if name in NODES else "tools"}.{name}')
    except ModuleNotFoundError as error:
        return _missing(name, str(error.name))
    # of a node rclpy wants the name of the program, too
    return int(module.main([name, *rest] if name in NODES else rest))


def _missing(name: str, module: str) -> int:
    remedy = 'pip install what the package needs' if name in TOOLS else \
        'source an installation of ROS 2, or run `make setup` in a checkout'
    print(f'dp_swing_ros: error: {name} needs the Python module {module}, which is not '
          f'installed; {remedy}', file=sys.stderr)
    return MISUSED


def usage() -> str:
    """Return the help."""
    parts = [('without ROS', TOOLS), ('nodes, with ROS 2', NODES),
             ('with ROS 2 and the package built by colcon', BY_COLCON)]
    return '\n\n'.join([
        'usage: python -m dp_swing_ros COMMAND [ARGUMENT ...]',
        *(f'{title}:\n' + '\n'.join(f'  {name:12}{about}' for name, about in commands.items())
          for title, commands in parts),
        'COMMAND --help lists the arguments of one.'])


if __name__ == '__main__':
    sys.exit(main())
