# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Measure the swing-up in real time through the real nodes, and write docs/results/real_time.md.

Run by `make results`, on a machine that must do nothing else; takes minutes.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
import tempfile

from stamp import made, sources_with, TOP

from dp_swing_ros.bags import read_episode
from dp_swing_ros.evaluation.campaign.report import share
from dp_swing_ros.evaluation.campaign.rows import Key, Row, store
from dp_swing_ros.evaluation.comparison import rate, spread
from dp_swing_ros.evaluation.metrics import measure, outcome
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.tables import compact
from dp_swing_ros.tools.demo import perform, Run
from dp_swing_ros.tools.isolation import isolated

RUNS = 5
DURATION = 10.0  # [s]
SCENARIO = 'real_time'


def run(solver: str, seed: int, folder: Path) -> Row:
    """
    Do a run and return its row; a fall is a result, not a failure.

    Raises ProcessError if a process fails.
    """
    folder.mkdir(parents=True)
    episode = read_episode(perform(Run(solver, seed, None, DURATION, False, (), folder)))
    return Row(Key(solver, SCENARIO, '', None, seed), outcome(episode).name, '', measure(episode),
               episode.ticks.solve_time)


def cells(solver: str, rows: Sequence[Row]) -> tuple[str, ...]:
    """Return the line of a solver."""
    runs = [row.metrics for row in rows if row.key.contestant == solver]
    of = spread(runs)
    middle, largest = of['median'], of['largest']
    return (f'`{solver}`', share(rate([one.success for one in runs])),
            str(sum(one.late_ticks for one in runs)), str(sum(one.strikes for one in runs)),
            f'{middle.settling_time:.2f}', f'{largest.largest_force:.2f}',
            f'{largest.largest_position:.2f}', f'{1e3 * middle.median_solve_time:.2f}',
            f'{1e3 * largest.p99_solve_time:.2f}')


def page(rows: Sequence[Row], made: str) -> str:
    """Return the page as Markdown."""
    runs = len({row.key.seed for row in rows})
    return '\n'.join([
        '# In real time\n', made,
        f'Swing-up from hanging by three processes at 20 Hz, {DURATION:g} s, default parameters, '
        f'seeds from 0 on, first attempts only, {runs} runs a line, read from their bags; the '
        'rows: [real_time.csv.gz](real_time.csv.gz). Upright to the end: both angles within 0.1 '
        'rad and all speeds under 1 over the last second; in brackets the 95 % interval (Wilson). '
        'Median over the runs; force, position and p99 are the largest of any run.\n',
        compact([('solver', 'upright to the end', 'late ticks', 'track strikes',
                  'median settling [s]', 'largest force [N]', 'largest position [m]',
                  'median solve [ms]', 'worst p99 solve [ms]'),
                 *(cells(solver, rows)
                   for solver in dict.fromkeys(row.key.contestant for row in rows))]), ''])


def main() -> None:
    """Do all runs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--runs', type=int, default=RUNS, help='of each solver')
    parser.add_argument('--docs', type=Path, default=TOP / 'docs')
    arguments = parser.parse_args()
    with isolated(), tempfile.TemporaryDirectory() as folder:
        rows = [run(solver, seed, Path(folder, solver, str(seed)))
                for solver in SOLVERS for seed in range(arguments.runs)]
    results = arguments.docs / 'results'
    results.mkdir(parents=True, exist_ok=True)
    store(results / 'real_time.csv.gz', rows)
    (results / 'real_time.md').write_text(
        page(rows, made('real_time', sources_with('real_time.py'))), encoding='utf-8')


if __name__ == '__main__':
    main()
