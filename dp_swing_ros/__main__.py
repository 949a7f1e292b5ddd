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

from dp_swing_ros import environment
from dp_swing_ros.executables import end_quietly, MISUSED, piped, plays_bag, show_help

TOOLS = {
    'analyse': "a bag's table, figures and report, from the bag alone",
    'compare': 'what each solver would have done from a tick on',
    'evaluate': 'seeded campaigns: rates, scores, comparisons, pictures',
    'export': 'a run as CSV or Parquet tables, with units',
    'import': 'a log in CSV or Parquet as a bag',
    'identify': 'masses, lengths, frictions and the drive from recorded motion',
    'learn': 'from random forces to a pendulum that is held: its dynamics, learned',
    'parameters': 'all parameters of all nodes',
    'recover': 'a whole bag from a truncated or damaged one',
    'train': 'dynamics learned from recorded motion, as a model that an mpc plans with',
    'verify': 'every recorded tick solved again, to the bit'}
NODES = {
    'plant': 'integrates the pendulum, publishes its state, applies the force',
    'mpc': 'solves from each state, publishes the force',
    'relay': 'hands the force on to a controller of ros2_control',
    'logger': 'writes the topics to an MCAP bag',
    'replay': 'plays a bag back',
    'console': 'a page in the browser: poke it, tune it, watch it think'}
BY_COLCON = {
    'demo': 'runs plant, mpc and logger, and draws the results',
    'play': 'plant, mpc and a page in the browser on them'}
MODULES = {'import': 'import_log'}   # of tools that have the name of no module
COMMANDS = TOOLS | NODES | BY_COLCON


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tool or node that the first argument names; return its exit code."""
    name, *rest = (sys.argv[1:] if argv is None else argv) or ['--help']
    if name in ('-h', '--help'):
        print(usage())
        return 0
    if name not in COMMANDS:
        return _misused(f'unknown command {name!r}; expected one of {", ".join(COMMANDS)}')
    is_node = name in NODES and not (name == 'console' and plays_bag(rest))
    if is_node and {'-h', '--help'} & set(rest):
        return piped(lambda: show_help(name))
    if argv is None and not is_node:
        end_quietly()   # while it loads
    if (is_node or name in BY_COLCON) and (error := environment.misused()):
        return _misused(error)
    try:
        module = import_module('dp_swing_ros.' + (
            f'nodes.{name}' if is_node else f'tools.{MODULES.get(name, name)}'))
    except ModuleNotFoundError as error:
        remedy = 'pip install what the package needs' if name in TOOLS else \
            'source an installation of ROS 2, or run `make setup` in a checkout'
        return _misused(f'{name} needs the Python module {error.name}, which is not installed; '
                        f'{remedy}')
    # of a node rclpy wants the name of the program, too
    return int(module.main([name, *rest])) if is_node else piped(lambda: module.main(rest))


def _misused(why: str) -> int:
    print(f'dp_swing_ros: error: {why}', file=sys.stderr)
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
