# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Measure the swing-up in real time through the real nodes, and write docs/results/real_time.md.

Run by `make results`, on a machine that must do nothing else; takes minutes.
"""

import argparse
from collections.abc import Sequence
from itertools import product
from pathlib import Path
import tempfile

from campaigns import METHODS
from stamp import made, sources, TOP

from dp_swing_ros.bags import read_episode
from dp_swing_ros.evaluation.campaign.report import share
from dp_swing_ros.evaluation.campaign.rows import Key, Row, store
from dp_swing_ros.evaluation.comparison import rate, spread
from dp_swing_ros.evaluation.metrics import measure, outcome
from dp_swing_ros.figures import hero
from dp_swing_ros.pendulum.state import DEFAULT_LINKS
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.episode import Episode
from dp_swing_ros.tables import compact
from dp_swing_ros.tools.demo import perform
from dp_swing_ros.tools.processes import isolated

RUNS = 5
DURATIONS = {2: 10.0, 3: 15.0}  # [s] of a run, by the number of links
SHOWN = ('ddp', 3, 0)           # solver, links and seed of the run in the picture


def scenario(links: int) -> str:
    """Return what the runs of a pendulum are called in the rows."""
    return 'real_time' if links == DEFAULT_LINKS else f'real_time_{links}_links'


def run(solver: str, links: int, seed: int, folder: Path) -> Episode:
    """
    Do a run and return what its bag holds; a fall is a result, not a failure.

    Raises ProcessError if a process fails.
    """
    folder.mkdir(parents=True)
    return read_episode(perform(folder, solver, seed, DURATIONS[links], links))


def row_of(solver: str, links: int, seed: int, episode: Episode) -> Row:
    """Return the row of a run."""
    return Row(Key(solver, scenario(links), '', None, seed), outcome(episode).name, '',
               measure(episode), episode.ticks.solve_time)


def cells(solver: str, links: int, rows: Sequence[Row]) -> tuple[str, ...]:
    """Return the line of a solver and a pendulum."""
    runs = [row.metrics for row in rows if row.key[:2] == (solver, scenario(links))]
    of = spread(runs)
    middle, largest = of['median'], of['largest']
    return (str(links), f'`{solver}`', share(rate([one.success for one in runs])),
            str(sum(one.late_ticks for one in runs)), str(sum(one.strikes for one in runs)),
            f'{middle.settling_time:.2f}', f'{largest.largest_force:.2f}',
            f'{largest.largest_position:.2f}', f'{1e3 * middle.median_solve_time:.2f}',
            f'{1e3 * largest.p99_solve_time:.2f}')


def page(rows: Sequence[Row], made: str) -> str:
    """Return the page as Markdown."""
    runs = len({row.key.seed for row in rows})
    return '\n'.join([
        '# In real time\n', made,
        'Swing-up from hanging by three processes at 20 Hz, '
        f'{" and ".join(f"{DURATIONS[links]:g} s with {links} links" for links in DURATIONS)}, '
        'default parameters, so a force of '
        f'{" and ".join(f"{limit(links):g} N" for links in DURATIONS)} at most; seeds from 0 on, '
        f'first attempts only, {runs} runs a line, read from their bags; the rows: '
        '[real_time.csv.gz](real_time.csv.gz). Upright to the end: all angles within 0.1 rad and '
        'all speeds under 1 over the last second; in brackets the 95 % interval (Wilson). Median '
        'over the runs; force, position and p99 are the largest of any run.\n',
        '![Three links, swung up in real time by DDP](../figures/three_links.png)\n',
        compact([('links', 'solver', 'upright to the end', 'late ticks', 'track strikes',
                  'median settling [s]', 'largest force [N]', 'largest position [m]',
                  'median solve [ms]', 'worst p99 solve [ms]'),
                 *(cells(solver, links, rows) for links in DURATIONS for solver in METHODS)]),
        ''])


def limit(links: int) -> float:
    """Return the default limit of the force [N]."""
    return plants.plant({'links': links}).limits.force_limit


def main() -> None:
    """Do all runs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--runs', type=int, default=RUNS, help='of each solver')
    parser.add_argument('--docs', type=Path, default=TOP / 'docs')
    arguments = parser.parse_args()
    with isolated(), tempfile.TemporaryDirectory() as folder:
        episodes = {one: run(*one, Path(folder, *map(str, one)))
                    for one in product(METHODS, DURATIONS, range(arguments.runs))}
    results, figures = arguments.docs / 'results', arguments.docs / 'figures'
    for made_here in (results, figures):
        made_here.mkdir(parents=True, exist_ok=True)
    rows = [row_of(*one, episode) for one, episode in episodes.items()]
    hero(episodes[SHOWN]).savefig(figures / 'three_links.png')
    store(results / 'real_time.csv.gz', rows)
    (results / 'real_time.md').write_text(
        page(rows, made('real_time', sources('real_time'))), encoding='utf-8')


if __name__ == '__main__':
    main()
