# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Measure the swing-up in real time through the real nodes, and print docs/results/real_time.md.

Run by `make results`; takes five minutes on a machine that must do nothing else.
"""

import argparse
from datetime import date
import os
from pathlib import Path
import platform
import re
import subprocess
import sys
import tempfile

from dp_swing_ros.provenance import commit

SOLVERS = ('ilqr', 'ddp', 'mppi')
RUNS = 5

WANTED = {'settling time': 'median settling [s]', 'largest force u': 'largest force [N]',
          'largest position x': 'largest position [m]',
          'solve time, median': 'median solve [ms]', 'solve time, p99': 'worst p99 solve [ms]'}
EXTREME = ('largest force u', 'largest position x', 'solve time, p99')


def measured(solver: str) -> dict[str, str]:
    """Do repeated runs and return the cells of their row; a fall is a result, not a failure."""
    with tempfile.TemporaryDirectory() as folder:
        command = ['ros2', 'run', 'dp_swing_ros', 'demo', '--solver', solver, '--runs', str(RUNS),
                   '--spread', '--no-figures', '--output', f'{folder}/runs']
        print(' '.join(command), file=sys.stderr)
        done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode not in (0, 1) or 'upright in' not in done.stdout:
        raise SystemExit(f'{" ".join(command)} failed:\n{done.stdout}{done.stderr}')
    line = re.search(r'upright in (\d+ of \d+) runs \(95 % interval ([^)]*)\), late ticks (\d+)',
                     done.stdout)
    assert line is not None
    row = {'solver': f'`{solver}`', 'upright to the end': f'{line[1]} ({line[2]})',
           'late ticks': line[3]}
    for label, title in WANTED.items():
        cells = re.search(rf'\| {label} +\| \S+ +\|([^\n]*)\|\n', done.stdout)
        assert cells is not None, label
        row[title] = cells[1].split('|')[2 if label in EXTREME else 1].strip()
    return row


def page(rows: list[dict[str, str]]) -> str:
    """Return the page as Markdown."""
    return '\n'.join([
        '# In real time\n',
        f'Made by `make results` ({Path(__file__).name}) on {date.today()} at commit {commit()}; '
        f'{os.cpu_count()} shared cores, {platform.machine()}, CPython '
        f'{platform.python_version()}.\n',
        'Swing-up from hanging by three processes at 20 Hz, 10 s, default parameters, seeds from '
        f'0 on, first attempts only, {RUNS} runs a row, read from their bags. Upright to the end: '
        'both angles within 0.1 rad and all speeds under 1 over the last second; in brackets the '
        '95 % interval (Wilson). Median over the runs; force, position and p99 are the largest of '
        'any run.\n',
        f'| {" | ".join(rows[0])} |', '| --- ' * len(rows[0]) + '|',
        *(f'| {" | ".join(row.values())} |' for row in rows)])


def main() -> None:
    """Do all runs."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    print(page([measured(solver) for solver in SOLVERS]))


if __name__ == '__main__':
    main()
