# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dp_swing_ros recover BAG`: a whole bag of what is left of a damaged one."""

import argparse
from collections.abc import Sequence
from datetime import datetime, timezone
from pathlib import Path

from dp_swing_ros.messages.fields import BILLION
from dp_swing_ros.recovery.recover import recover, Recovery
from dp_swing_ros.tables import aligned
from dp_swing_ros.tools.command_lines import beside, execute, OK, program, progress

LINES = 20  # of losses; of more only the number is printed


def main(argv: Sequence[str] | None = None) -> int:
    """Recover the bag that the command line names; return the exit code."""
    parser = argparse.ArgumentParser(
        prog=program('recover'),
        description='Write a whole bag of what can be saved of a truncated or damaged one, and '
                    'report what was saved and what is gone. The damaged one is left as it is.')
    parser.add_argument('bag', type=Path, metavar='BAG',
                        help='folder of a bag, or its .mcap file')
    parser.add_argument('--output', type=Path, metavar='DIR',
                        help='folder to make (default: BAG_recovered, beside the bag)')
    return execute(parser, _recover, argv)


def _recover(arguments: argparse.Namespace) -> int:
    bag, output = arguments.bag, arguments.output or beside(arguments.bag, 'recovered')
    try:
        found = recover(bag, output, lambda items: progress(items, desc='records', delay=1))
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f'{output} holds a part, if it is there') from None
    if found.whole:
        print(f'{bag} {"has nothing to repair" if found.incomplete else "is whole"}: '
              f'{found.saved} messages; nothing was written')
    else:
        print(_report(found, bag, output))
    if found.incomplete:
        print(found.incomplete)
    return OK


def _report(found: Recovery, bag: Path, output: Path) -> str:
    """Return what was saved and what is gone."""
    counted = f' of the {found.counted} that the bag counts' if found.counted else ''
    losses = found.losses()
    if len(losses) > LINES:
        losses[LINES:] = [f'and {len(losses) - LINES} more like these']
    start = min(account.first for account in found.accounts.values())
    date = datetime.fromtimestamp(start / BILLION, timezone.utc)
    topics = aligned([('topic', 'saved', 'first [s]', 'last [s]', 'lost'), *(
        (name, str(account.saved), f'{(account.first - start) / BILLION:.3f}',
         f'{(account.last - start) / BILLION:.3f}',
         '-' if account.missing is None else str(account.missing))
        for name, account in sorted(found.accounts.items()))], names=1)
    return '\n'.join([
        f'{bag} is damaged; saved {found.saved} messages{counted}: {output}', '', topics, '',
        f'time 0 is {date:%Y-%m-%d %H:%M:%S} UTC; lost: numbers skipped where one publisher '
        'counts', '', 'damaged:', *(f'  {loss}' for loss in losses)])
