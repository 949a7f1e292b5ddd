# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dp_swing_ros verify BAG`: a recorded run again, to the bit."""

import argparse
from collections import Counter
from collections.abc import Iterator, Sequence
import sys

from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.rerun.verification import Verification, verify
from dp_swing_ros.tools.command_lines import bag_parser, execute, progress

IDENTICAL, DIFFERS, UNKNOWN = 0, 1, 2  # exit codes


def main(argv: Sequence[str] | None = None) -> int:
    """Verify the bag that the command line names; return the exit code."""
    parser = bag_parser(
        'verify', 'Solve every recorded tick again, with the recorded parameters, seeds and, in '
        'real time, numbers of iterations, and demand the recorded forces and plans to the bit; '
        'in lockstep, simulate the plant again too, and demand its states. The exit code is 0 '
        'where all are, 1 where one is not, and 2 where that is not known.')
    return execute(parser, _verify, argv)


def _verify(arguments: argparse.Namespace) -> int:
    found = verify(Bag(arguments.bag, arguments.partial, arguments.namespace, arguments.node),
                   lambda ticks: progress(ticks, desc='ticks'))
    ticks = f'{found.ticks} ticks of {found.solver} in ' \
        f'{"real time" if found.real_time else "lockstep"}' \
        + (f' (no state came for {found.silent})' if found.silent else '')
    for text in _differences(found, ticks) if found.differences else _identical(found, ticks):
        print(text)
    if found.incomplete:
        print(found.incomplete)
    if found.rivals and not found.differences:
        print(f'{"likely cause" if found.unchecked else "note"}: {"; ".join(found.rivals)}')
    for text in found.unverifiable:
        print(f'not checked: {text}')
    for text in found.unchecked:
        print(f'verify: error: {text}', file=sys.stderr)
    if found.differences:
        return DIFFERS
    return UNKNOWN if found.unchecked else IDENTICAL


def _identical(found: Verification, ticks: str) -> Iterator[str]:
    if found.ticks:
        yield f'{ticks}: every force is the recorded one to the bit'
    if found.plans:
        yield f'{found.plans} plans: all states and forces are the recorded ones to the bit'
    if found.states:
        yield (f'{found.states} states: the plant simulated again gives them and the forces '
               'applied to the bit')
    if found.states and not (found.unchecked or found.incomplete):
        yield 'so the whole run, simulated again from its parameters alone, is the recorded one'
    if found.ticks and found.environment_changes:
        changes = '; '.join(found.environment_changes)
        yield f'note: recorded elsewhere ({changes}), which changed nothing'


def _differences(found: Verification, ticks: str) -> Iterator[str]:
    first, counts = found.differences[0], Counter(each.of for each in found.differences)
    yield f'{first.place}, differs: {first.text}'
    if counts['ticks']:
        yield f'{counts["ticks"]} of {ticks} differ; after the first, one may follow from another'
    if counts['forces']:
        yield f'{counts["forces"]} forces on force_command are of no tick'
    if counts['states']:
        yield (f'{counts["states"]} of {found.states} states differ from those of the plant '
               'simulated again')
    causes = found.rivals or found.environment_changes
    yield (f'likely cause: {"; ".join(causes)}' if causes else
           'code, packages and machine are the same: the bag was changed, or the run depended on '
           'what is not recorded')
