# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Measure the swing-up from hanging through the real nodes, and print docs/results/swing_up.md.

Run by `make results`; takes a quarter of an hour on a machine that does nothing else.
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

SOLVERS = ('ilqr', 'ddp', 'mppi')
PAPER = ('--lockstep', '--params', 'config/paper.yaml')
EULER = (*PAPER, '--params', 'config/paper_euler.yaml')
AUTHORS = ('--params', 'config/paper_mppi.yaml')

# title, what to know about it, runs, and for each row a solver with the demo's arguments
CAMPAIGNS = (
    ('In real time', 'Three processes at 20 Hz for 10 s, default parameters.', 5,
     [(solver, ()) for solver in SOLVERS]),
    ('In lockstep', 'The same without a clock, so repeatable to the bit.', 20,
     [(solver, ('--lockstep',)) for solver in SOLVERS]),
    ("The paper's set-up as printed", 'Its cost, unlimited force, random ±10 N start, open-loop '
     'shift, plain MPPI (also with the weights, horizon and limit that its authors ran); '
     'on a plant that is integrated properly, 7.5 s.', 20,
     [*((solver, (*PAPER, '--duration', '7.5')) for solver in SOLVERS),
      ('mppi', (*PAPER, *AUTHORS, '--duration', '7.5'))]),
    ("The paper's set-up on its authors' Euler plant", 'The same with forward Euler at 50 ms as '
     'plant and as model; such a plant makes energy of its own.', 20,
     [*((solver, (*EULER, '--duration', '7.5')) for solver in SOLVERS),
      ('mppi', (*EULER, *AUTHORS, '--duration', '7.5'))]))

WANTED = {'settling time': 'median settling [s]', 'largest force u': 'largest force [N]',
          'largest position x': 'largest position [m]',
          'solve time, median': 'median solve [ms]', 'solve time, p99': 'worst p99 solve [ms]'}
EXTREME = ('largest force u', 'largest position x', 'solve time, p99')


def measured(solver: str, arguments: tuple[str, ...], runs: int) -> dict[str, str]:
    """Do repeated runs and return the cells of their row; a fall is a result, not a failure."""
    with tempfile.TemporaryDirectory() as folder:
        command = ['ros2', 'run', 'dp_swing_ros', 'demo', '--solver', solver, *arguments,
                   '--runs', str(runs), '--spread', '--no-figures', '--output', f'{folder}/runs']
        print(' '.join(command), file=sys.stderr)
        done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode not in (0, 1) or 'upright in' not in done.stdout:
        raise SystemExit(f'{" ".join(command)} failed:\n{done.stdout}{done.stderr}')
    line = re.search(r'upright in (\d+ of \d+) runs \(95 % interval ([^)]*)\), late ticks (\d+)',
                     done.stdout)
    assert line is not None
    row = {'solver': f'`{solver}`' + (" (authors' weights)" if AUTHORS[1] in arguments else ''),
           'upright to the end': f'{line[1]} ({line[2]})', 'late ticks': line[3]}
    for label, title in WANTED.items():
        cells = re.search(rf'\| {label} +\| \S+ +\|([^\n]*)\|\n', done.stdout)
        assert cells is not None, label
        row[title] = cells[1].split('|')[2 if label in EXTREME else 1].strip()
    return row


def page(rows: dict[str, list[dict[str, str]]]) -> str:
    """Return the page as Markdown."""
    commit = subprocess.run(['git', 'rev-parse', '--short', 'HEAD'], capture_output=True,
                            text=True, check=True).stdout.strip()
    text = ['# Swing-up from hanging\n',
            f'Made by `make results` ({Path(__file__).name}) on {date.today()} at commit '
            f'{commit}; {os.cpu_count()} shared cores, {platform.machine()}, CPython '
            f'{platform.python_version()}.\n',
            'Through the real nodes and a bag, seeds from 0 on, first attempts only. Upright to '
            'the end: both angles within 0.1 rad and all speeds under 1 over the last second; in '
            'brackets the 95 % interval (Wilson). Median over the runs; force, position and p99 '
            'are the largest of any run.']
    for title, about, runs, _ in CAMPAIGNS:
        columns = list(rows[title][0])
        text += [f'\n## {title}\n', f'{about} {runs} runs a row.\n',
                 f'| {" | ".join(columns)} |', '| --- ' * len(columns) + '|',
                 *(f'| {" | ".join(row.values())} |' for row in rows[title])]
    return '\n'.join(text)


def main() -> None:
    """Do all campaigns."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    print(page({title: [measured(solver, arguments, runs) for solver, arguments in each]
                for title, _, runs, each in CAMPAIGNS}))


if __name__ == '__main__':
    main()
