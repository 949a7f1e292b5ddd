# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Plant and mpc in real time on cores that others keep busy.

Run by `make results`, on a machine that must do nothing else.
"""

import argparse
from collections.abc import Iterator, Sequence
import os
from pathlib import Path

from campaigns import METHODS
from live_rates import ABOUT, answered, played, Run
import pandas as pd
from stamp import made, sources, store_page, TOP

from dp_swing_ros.evaluation.campaign.report import share
from dp_swing_ros.evaluation.comparison import rate
from dp_swing_ros.tables import compact

BUSY = 30.0       # [s]
RUNS = 3


def runs() -> Iterator[Run]:
    """Yield all that are done."""
    for solver in METHODS:
        for seed in range(RUNS):
            yield Run('busy', solver, BUSY, burn=os.cpu_count() or 1, seed=seed)


def of_busy(rows: pd.DataFrame) -> str:
    """Return the table of the busy cores."""
    return compact([
        ('solver', 'up to the end', 'late ticks', 'answered before the next',
         'worst state to force p99 [ms]', 'largest angle once up [rad]'),
        *((f'`{solver}`', share(rate(of.success.tolist())),
           str(of.late_total.sum()), answered(of), f'{of.mpc_p99.max():.1f}',
           f'{of.largest.max():.2f}')
          for solver, of in rows.groupby('solver', sort=False))])


def page(rows: pd.DataFrame, made: str) -> str:
    """Return the page as Markdown."""
    return '\n'.join([
        '# Busy cores\n', made, ABOUT.format('live_busy'),
        f'{BUSY:g} s beside as many busy processes as there are cores, {RUNS} runs '
        'each.\n',
        of_busy(rows), ''])


def main(argv: Sequence[str] | None = None) -> None:
    """Do all runs, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--docs', type=Path, default=TOP / 'results')
    arguments = parser.parse_args(argv)
    rows = played(runs())
    store_page('live_busy', rows, page(rows, made('live_busy', sources('live_busy'))),
               arguments.docs)


if __name__ == '__main__':
    main()
