# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Make the published figures anew from one commit: the pages of docs/results, README's table.

Behind `make results`. What was played stays under runs/results until the sources change, so that a
call that is stopped goes on where it was; a page that is there is put in its place again.
"""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
import shutil
import subprocess
import sys
import time
from typing import NamedTuple

import ablation
import campaigns
import compute
import hard
import links
import live
import methods
import near_goal
import pandas as pd
import readme
import rig
import seeded
import stamp
import suites

from dp_swing_ros.evaluation.campaign.rows import CampaignError, Row, store
from dp_swing_ros.executables import INTERRUPTED
from dp_swing_ros.kernels import processor
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.tools.command_lines import FAILED, interrupt_on_signals, MISUSED, OK

HERE = Path(__file__).parent
KEPT = stamp.TOP / 'runs' / 'results'
DOCS = stamp.TOP / 'docs'


class Failure(Exception):
    """A page could not be made; what was played is kept."""


class Page(NamedTuple):
    """
    One page: how long it takes on two cores, what decides it, and how it is written.

    `write` is given a folder for results/ and figures/ and one to keep what was played in.
    """

    minutes: float
    sources: Callable[[], str]
    write: Callable[[Path, Path], None]


OF_ROWS = {'ablation': ablation.page, 'compute': compute.page,
           'links': links.page, 'near_goal': near_goal.page}
PICTURES = {'ablation': ablation.picture, 'compute': compute.picture,
            'near_goal': near_goal.picture}   # of those


def of_rows(name: str, minutes: float) -> Page:
    """Return a page that is written from the rows of its episodes."""
    def write(docs: Path, kept: Path) -> None:
        rows, made = played(name, docs, kept)
        text = OF_ROWS[name](rows, made) if name in OF_ROWS else (
            campaigns.page(name, rows, made, docs / 'figures'))
        if name in PICTURES:
            PICTURES[name](rows).savefig(docs / 'figures' / f'{name}.png')
        (docs / 'results' / f'{name}.md').write_text(text, encoding='utf-8')
    return Page(minutes, lambda: seeded.sources(name), write)


def of_rigs(minutes: float) -> Page:
    """Return the page of the rigs, from rows and from estimates, which are stored beside them."""
    def write(docs: Path, kept: Path) -> None:
        rows, made = played('rig', docs, kept)
        found = rig.estimates()
        stamp.store_table(pd.DataFrame(found), docs / 'results' / 'rig_estimates.csv.gz')
        rig.picture(rows).savefig(docs / 'figures' / 'rig.png')
        (docs / 'results' / 'rig.md').write_text(rig.page(rows, found, made), encoding='utf-8')
    return Page(minutes, lambda: seeded.sources('rig'), write)


def played(name: str, docs: Path, kept: Path) -> tuple[list[Row], str]:
    """Play and store the rows of a page; return them, and the sentence on where it comes from."""
    rows = seeded.played(name, kept)
    store(docs / 'results' / f'{name}.csv.gz', rows)
    return rows, stamp.made(name, seeded.sources(name), seeded.SEEDED[name].packages)


def of_script(name: str, minutes: float, script: str = '',
              sources: Callable[[], str] | None = None,
              python: Path = Path(sys.executable)) -> Page:
    """Return a page that a script writes, of the name of the page if no other is given."""
    def write(docs: Path, kept: Path) -> None:
        if not python.exists():
            raise Failure(f'there is no {python}, which this page needs; `make results '
                          f'PAGES={name}` installs it')
        command = [str(python), str(HERE / (script or f'{name}.py')), '--docs', str(docs)]
        if subprocess.run(command).returncode:
            raise Failure(f'{" ".join(command)} failed; what it wrote stands above')
    return Page(minutes, sources or (lambda: stamp.sources(name)), write)


PAGES = {
    'random': of_rows('random', 5),
    'robustness': of_rows('robustness', 13),
    'baselines': of_rows('baselines', 4),
    'links': of_rows('links', 6),
    'stress': of_rows('stress', 12),
    'ablation': of_rows('ablation', 55),
    'fresh': of_rows('fresh', 18),
    'transitions': of_rows('transitions', 6),
    'oracle': of_script('oracle', 13),
    'near_goal': of_rows('near_goal', 1),
    'optimum': of_script('optimum', 8),
    'compute': of_rows('compute', 15),
    'hard': of_script('hard', 8, sources=hard.sources),
    'convergence': of_script('convergence', 2),
    'methods': of_script('methods', 1, sources=methods.sources),
    'suites': of_script('suites', 35, sources=suites.sources, python=suites.PYTHON),
    'rig': of_rigs(50),
    'paper': of_script('paper', 7, sources=lambda: seeded.sources('paper')),
    'real_time': of_script('real_time', 9),
    'foreign': of_script('foreign', 26),
    'live_changes': of_script('live_changes', 16),
    'live_faults': of_script('live_faults', 34),
    'live_rates': of_script('live_rates', 48),
    'live_busy': of_script('live_busy', 43),
    'live_soak': of_script('live_soak', 61),
    'live': of_script('live', 0.1),
    'learned': of_script('learned', 45),
    'learned_rigs': of_script('learned_rigs', 75),
    'console': of_script('console', 25),
    'durability': of_script('durability', 6),
    'damaged_bags': of_script('damaged_bags', 4, 'mutated_bags.py'),
    'benchmark': of_script('benchmark', 18)}


def main(argv: Sequence[str] | None = None) -> int:
    """Make the pages that the command line asks for; return the exit code."""
    arguments = command_line().parse_args(argv)
    try:
        interrupt_on_signals()
        if not (arguments.dirty or arguments.mark) and (changed := stamp.changed()):
            print(f'make results: error: {", ".join(changed)} differ from the commit '
                  f'{stamp.commit()}; commit first, or call with RESULTS=--dirty for pages that '
                  'say so', file=sys.stderr)
            return MISUSED
        make([] if arguments.mark else arguments.pages or list(PAGES), arguments.again)
    except KeyboardInterrupt:
        print('make results: interrupted; call again to go on', file=sys.stderr)
        return INTERRUPTED
    except (CampaignError, Failure, OSError, ParameterError) as error:
        print(f'make results: error: {error}', file=sys.stderr)
        return FAILED
    return OK


def command_line() -> argparse.ArgumentParser:
    """Return the parser of the arguments."""
    parser = argparse.ArgumentParser(
        prog='benchmarks/published.py', description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('pages', nargs='*', metavar='PAGE', type=name_of_page,
                        help=f'of {", ".join(PAGES)} (default: all)')
    parser.add_argument('--dirty', action='store_true',
                        help='though sources differ from the commit; the pages say so')
    parser.add_argument('--mark', action='store_true',
                        help='make none; only say on each page, and in README, whether what it '
                             'measures has changed since')
    parser.add_argument('--again', action='store_true',
                        help='forget what was played from the same sources')
    return parser


def name_of_page(text: str) -> str:
    """Read the name of a page."""
    if text not in PAGES:
        raise argparse.ArgumentTypeError(f'unknown page {text!r}; expected of {", ".join(PAGES)}')
    return text


def make(names: Sequence[str], again: bool) -> None:
    """
    Make pages, one after the other, and README's table of all that are there; mark what is older.

    Raises Failure, CampaignError or OSError; what was finished stays.
    """
    expected = spent = 0.0    # [min] of the pages that were made here
    for number, name in enumerate(names, 1):
        pace = spent / expected if expected else 1.0
        left = pace * sum(PAGES[other].minutes for other in names[number - 1:])
        print(f'== {name}, page {number} of {len(names)}: {pace * PAGES[name].minutes:.0f} min; '
              f'{left:.0f} min left of all', flush=True)
        began = time.monotonic()
        if place(name, again):
            print('   made from the same sources before; RESULTS=--again makes it anew')
        else:
            expected += PAGES[name].minutes
            spent += (time.monotonic() - began) / 60
    for path, text in marked(DOCS / 'results').items():
        path.write_text(text, encoding='utf-8')
    readme.write(stamp.TOP / 'README.md', DOCS / 'results')
    print(f'== {len(names)} pages, {spent:.1f} min', flush=True)


def marked(results: Path) -> dict[Path, str]:
    """Return every page, whose first line says if it is older than what it measures."""
    stamps = {page: stamp.read(results / f'{page}.md') for page in PAGES
              if (results / f'{page}.md').exists()}
    older = {page for page, of in stamps.items() if PAGES[page].sources() != of.sources}
    if not older.isdisjoint(live.PARTS):   # it measures nothing itself
        older.add('live')
    return {results / f'{page}.md': stamp.marked(
        (results / f'{page}.md').read_text(encoding='utf-8'), of, page in older,
        stamp.usual(stamps.values())) for page, of in stamps.items()}


def place(name: str, again: bool) -> bool:
    """
    Put a page into docs, made anew unless it was made from the same sources; return whether.

    A page is put there as a whole, or not at all.
    """
    kept = KEPT / f'{name}_{PAGES[name].sources()}_{processor()}'
    if again:
        shutil.rmtree(kept, ignore_errors=True)
    finished = kept / 'docs'
    was_there = finished.exists()
    if not was_there:
        begun = kept / 'begun'
        shutil.rmtree(begun, ignore_errors=True)
        for folder in ('results', 'figures'):
            (begun / folder).mkdir(parents=True)
        PAGES[name].write(begun, kept)
        begun.rename(finished)
    shutil.copytree(finished, DOCS, dirs_exist_ok=True)
    return was_there


if __name__ == '__main__':
    sys.exit(main())
