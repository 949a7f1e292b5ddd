# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dp_swing_ros recover BAG`: a whole bag of what is left of a damaged one."""

import argparse
from collections.abc import Sequence
from datetime import datetime, timezone
from pathlib import Path
import sys

from tqdm import tqdm

from dp_swing_ros.messages.fields import BILLION
from dp_swing_ros.recovery.recover import recover, Recovery
from dp_swing_ros.tools import program
from dp_swing_ros.tools.bag_arguments import beside
from dp_swing_ros.tools.exit_codes import exit_code

LINES = 20  # of losses, before only their number is said


def main(argv: Sequence[str] | None = None) -> int:
    """Recover the bag that the command line names; return the exit code."""
    arguments = _parser().parse_args(argv)
    output = arguments.output or beside(arguments.bag, 'recovered')
    return exit_code('recover', lambda: _recover(arguments.bag, output))


def _recover(bag: Path, output: Path) -> int:
    try:
        with tqdm(desc='bytes', unit='B', unit_scale=True, leave=False, delay=1,
                  disable=None) as bar:
            def progress(done: int, size: int) -> None:
                bar.total = size
                bar.update(done - bar.n)

            found = recover(bag, output, progress)
    except KeyboardInterrupt:
        print(f'recover: interrupted; {output} holds a part, if it is there', file=sys.stderr)
        raise
    if found.whole:
        print(f'{bag} {"has nothing to repair" if found.incomplete else "is whole"}: '
              f'{found.saved} messages; nothing was written')
    else:
        print(report(found, bag, output))
    if found.incomplete:
        print(found.incomplete)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program('recover'),
        description='Write a whole bag of what can be saved of a truncated or damaged one, and '
                    'say what was saved and what is gone. The damaged one is left as it is.')
    parser.add_argument('bag', type=Path, metavar='BAG',
                        help='folder of a bag, or its .mcap file')
    parser.add_argument('--output', type=Path, metavar='DIR',
                        help='folder to make (default: BAG_recovered, beside the bag)')
    return parser


def report(found: Recovery, bag: Path, output: Path) -> str:
    """Return what was saved and what is gone."""
    counted = f' of the {found.counted} that the bag counts' if found.counted else ''
    losses = found.losses()
    if len(losses) > LINES:
        losses[LINES:] = [f'and {len(losses) - LINES} more like these']
    start = min(account.first for account in found.topics.values())
    lines = [f'{bag} is damaged; saved {found.saved} messages{counted}: {output}', '',
             *_table(found, start), '',
             f'time 0 is {_date(start)}; lost: numbers skipped where one publisher counts',
             '', 'damaged:',
             *(f'  {loss}' for loss in losses)]
    if found.unverified:
        lines += ['', f'{found.unverified} messages were saved that no checksum verifies, as '
                  'those of a chunk without its end; their numbers may be wrong']
    return '\n'.join(lines)


def _table(found: Recovery, start: int) -> list[str]:
    rows = [('topic', 'saved', 'first [s]', 'last [s]', 'lost')]
    for name, account in sorted(found.topics.items()):
        rows.append((name, str(account.saved), f'{(account.first - start) / BILLION:.3f}',
                     f'{(account.last - start) / BILLION:.3f}',
                     '-' if account.missing is None else str(account.missing)))
    widths = [max(map(len, column)) for column in zip(*rows)]
    return ['  '.join([row[0].ljust(widths[0]),
                       *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:]))])
            for row in rows]


def _date(time: int) -> str:
    try:
        return f'{datetime.fromtimestamp(time / BILLION, timezone.utc):%Y-%m-%d %H:%M:%S} UTC'
    except (OverflowError, ValueError):
        return f'{time} ns'


if __name__ == '__main__':
    sys.exit(main())
