# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dp_swing_ros verify BAG`: every recorded tick again, to the bit."""

import argparse
from collections.abc import Sequence
import sys

from tqdm import tqdm

from dp_swing_ros.bags.fields import BILLION
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.rerun.verification import Verification, verify
from dp_swing_ros.tools import program
from dp_swing_ros.tools.over_bags import add_bag, add_namespace, add_partial, exit_code

IDENTICAL, DIFFERS, UNKNOWN = 0, 1, 2  # exit codes


def main(argv: Sequence[str] | None = None) -> int:
    """Verify the bag that the command line names; return the exit code."""
    arguments = _parser().parse_args(argv)
    return exit_code('verify', lambda: _verify(arguments))


def _verify(arguments: argparse.Namespace) -> int:
    found = verify(Bag(arguments.bag, arguments.partial, arguments.namespace),
                   lambda ticks: tqdm(ticks, desc='ticks', leave=False, disable=None))
    return _differs(found) if found.differences else _identical(found)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program('verify'),
        description='Solve every recorded tick again, with the recorded parameters, seeds and, '
                    'in real time, numbers of iterations, and demand the recorded forces to the '
                    'bit. The exit code is 0 where all are, 1 where one is not, and 2 where that '
                    'cannot be told.')
    add_bag(parser)
    add_partial(parser)
    add_namespace(parser)
    return parser


def _identical(found: Verification) -> int:
    if found.ticks:
        print(f'{found.ticks} ticks of {found.solver} in {_mode(found)}: every force is the '
              'recorded one to the bit')
    if found.unheard:
        print(f'{found.unheard} of these forces are not on force_command in the bag')
    if found.ticks and found.elsewhere:
        print(f'note: recorded elsewhere ({"; ".join(found.elsewhere)}), which changed nothing')
    if found.gap:
        print(f'verify: error: {found.gap}; from there on nothing can be verified, for a tick '
              'depends on all before it', file=sys.stderr)
        return UNKNOWN
    return IDENTICAL


def _differs(found: Verification) -> int:
    tick, text = found.differences[0]
    print(f'tick {tick.number} at {tick.stamp} ns ({tick.stamp / BILLION:.3f} s), {tick.status}, '
          f'differs: {text}')
    print(f'{len(found.differences)} of {found.ticks} ticks of {found.solver} in {_mode(found)} '
          'differ; after the first, one may follow from another')
    print(f'likely cause: {"; ".join(found.elsewhere)}' if found.elsewhere else
          'code, packages and machine are the same: the bag was changed, or the run depended on '
          'what is not recorded')
    if found.gap:
        print(f'{found.gap}, and nothing after it was looked at')
    return DIFFERS


def _mode(found: Verification) -> str:
    return 'real time' if found.real_time else 'lockstep'
