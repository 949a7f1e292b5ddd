# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The arguments that command lines over bags share."""

import argparse
from pathlib import Path

from dp_swing_ros.tools import program


def bag_parser(tool: str, description: str) -> argparse.ArgumentParser:
    """Return a parser of a command line that names one bag."""
    parser = argparse.ArgumentParser(prog=program(tool), description=description)
    add_bag(parser)
    add_partial(parser)
    add_namespace(parser)
    return parser


def add_bag(parser: argparse.ArgumentParser) -> None:
    """Let a command line name a recorded bag."""
    parser.add_argument('bag', type=Path, metavar='BAG',
                        help='folder of a bag that the logger recorded, or its .mcap file')


def add_partial(parser: argparse.ArgumentParser) -> None:
    """Let a command line ask for what there is."""
    parser.add_argument('--partial', action='store_true',
                        help='read what there is of a bag whose logger was killed')


def add_namespace(parser: argparse.ArgumentParser) -> None:
    """Let a command line choose one of several pendulums in a bag."""
    parser.add_argument('--namespace', metavar='NAME',
                        help='of several pendulums in a bag, that whose topics lie in this '
                             'namespace, such as /second (/ for the one in none)')


def beside(bag: Path, what: str) -> Path:
    """Return the folder for what is made of a bag: beside it, where rosbag2 does not look."""
    bag = bag.resolve()
    return bag.with_name(f'{bag.stem if bag.suffix == ".mcap" else bag.name}_{what}')
