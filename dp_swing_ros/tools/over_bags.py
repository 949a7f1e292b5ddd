# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the command lines over bags share: arguments, places, and how they end."""

import argparse
from collections.abc import Callable
from pathlib import Path
import sys

from dp_swing_ros.errors import UserError
from dp_swing_ros.parameters import ParameterError

MISUSED, INTERRUPTED = 2, 130  # exit codes


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


def exit_code(tool: str, work: Callable[[], int]) -> int:
    """Do the work and return its exit code; what the user can put right is one line."""
    try:
        return work()
    except (UserError, ParameterError, OSError) as error:
        print(f'{tool}: error: {error}', file=sys.stderr)
        return MISUSED
    except KeyboardInterrupt:
        return INTERRUPTED
