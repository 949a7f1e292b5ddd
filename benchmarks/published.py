# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Make the published figures anew from one commit: the pages of docs/results, README's table.

Behind `make results`. A page is made of parts. What was played of one stays under results/played
until the sources change, so that a call that is stopped goes on where it was; rows are left in
results/, for who wants to look closer.
"""

import argparse
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
import re
import shutil
import subprocess
import sys
import time
from typing import NamedTuple

import ablation
import campaigns
import drives
import links
import methods
import pandas as pd
import rig
import seeded
import sizes
import stamp
import summary

from dp_swing_ros.evaluation.campaign.rows import CampaignError, read, Row, store
from dp_swing_ros.executables import INTERRUPTED
from dp_swing_ros.kernels import processor
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.tools.command_lines import FAILED, interrupt_on_signals, MISUSED, OK

HERE = Path(__file__).parent
ROWS = stamp.TOP / 'results'   # ignored by git
KEPT = ROWS / 'played'
DOCS = stamp.TOP / 'docs'
BEGIN = '<!-- {} -->\n'        # of a part in its page


class Failure(Exception):
    """A part could not be made; what was played is kept."""


class Part(NamedTuple):
    """
    A part of a page: how long it takes on two cores, what decides it, and how it is written.

    `write` is given a folder for results/ and figures/ and one to keep what was played in. What
    only puts rows of other parts together has no sources.
    """

    minutes: float
    sources: Callable[[], str] | None
    write: Callable[[Path, Path], None]


def of_rows(name: str, minutes: float) -> Part:
    """Return a part that is written from the rows of its episodes."""
    def write(docs: Path, kept: Path) -> None:
        rows, made = played(name, docs, kept)
        text = OF_ROWS[name](rows, made) if name in OF_ROWS else (
            campaigns.page(name, rows, made, docs / 'figures'))
        (docs / 'results' / f'{name}.md').write_text(text, encoding='utf-8')
    return Part(minutes, lambda: seeded.sources(name), write)


OF_ROWS = {'ablation': ablation.page, 'drives': drives.page, 'links': links.page,
           'sizes': sizes.page}


def of_rigs(minutes: float) -> Part:
    """Return the part of the rigs, from rows and from estimates, which are stored beside them."""
    def write(docs: Path, kept: Path) -> None:
        rows, made = played('rig', docs, kept)
        found = rig.estimates()
        stamp.store_table(pd.DataFrame(found), docs / 'results' / 'rig_estimates.csv.gz')
        rig.picture(rows).savefig(docs / 'figures' / 'rig.png')
        (docs / 'results' / 'rig.md').write_text(rig.page(
            rows, found, rig.intervals(), made), encoding='utf-8')
    return Part(minutes, lambda: seeded.sources('rig'), write)


def played(name: str, docs: Path, kept: Path) -> tuple[list[Row], str]:
    """Play and store the rows of a part; return these, and the sentence on where it comes from."""
    stored = docs / 'results' / f'{name}.csv.gz'
    store(stored, seeded.played(name, kept))
    return read(stored), stamp.made(name, seeded.sources(name), seeded.SEEDED[name].packages)


def of_script(name: str, minutes: float, script: str = '',
              sources: Callable[[], str] | None = None) -> Part:
    """Return a part that a script writes, of the name of the part if no other is given."""
    def write(docs: Path, kept: Path) -> None:
        command = [sys.executable, str(HERE / (script or f'{name}.py')), '--docs', str(docs)]
        if subprocess.run(command).returncode:
            raise Failure(f'{" ".join(command)} failed; what it wrote stands above')
    return Part(minutes, sources or (lambda: stamp.sources(name)), write)


def of_others(name: str, needed: Sequence[str], write_from: Callable[[Path, Path], None]) -> Part:
    """Return a part that puts together what other parts have left in results/."""
    def write(docs: Path, kept: Path) -> None:
        if missing := [one for one in needed if not (ROWS / f'{one}.csv.gz').exists()]:
            raise Failure(f'{name} needs the rows of {", ".join(missing)}: '
                          f'`make results PAGES=\'{" ".join(missing)}\'` first')
        write_from(ROWS, docs)
        path = docs / 'results' / f'{name}.md'
        title, _, text = path.read_text(encoding='utf-8').partition('\n\n')
        path.write_text(f'{title}\n\n{stamp.together(needed)}\n{text}', encoding='utf-8')
    return Part(0.1, None, write)


PARTS = {
    'random': of_rows('random', 3),
    'robustness': of_rows('robustness', 13),
    'fresh': of_rows('fresh', 1.5),
    'transitions': of_rows('transitions', 4.5),
    'stress': of_rows('stress', 9),
    'links': of_rows('links', 2.2),
    'drives': of_rows('drives', 14),
    'summary': of_others('summary', summary.NEEDED, summary.write),
    'recordings': of_script('recordings', 4),
    'intervals': of_script('intervals', 11),
    'rig': of_rigs(4),
    'wrong_models': of_script('wrong_models', 11),
    'sizes': of_rows('sizes', 16),
    'benchmark': of_script('benchmark', 13),
    'closed_loops': of_script('closed_loops', 11),
    'methods': of_others('methods', methods.NEEDED, methods.write),
    'ablation': of_rows('ablation', 10),
    'paper': of_script('paper', 6, sources=lambda: seeded.sources('paper')),
    'learned': of_script('learned', 5),
    'live_changes': of_script('live_changes', 4.5),
    'live_faults': of_script('live_faults', 6.5),
    'live_rates': of_script('live_rates', 14),
    'live_busy': of_script('live_busy', 6),
    'live_soak': of_script('live_soak', 3.5),
    'durability': of_script('durability', 3),
    'damaged_bags': of_script('damaged_bags', 2, 'mutated_bags.py'),
    'large_logs': of_script('large_logs', 1)}


class Page(NamedTuple):
    """A page: its title, what it answers, and its parts."""

    title: str
    question: str
    parts: Sequence[str]


PAGES = {
    'reliability': Page(
        'How reliable is it?',
        'Who holds the pendulum, from where, under what, and where it breaks. Words and measures '
        'are those of [evaluate](../evaluation.md#measures).',
        ('summary', 'random', 'fresh', 'robustness', 'stress', 'transitions', 'links')),
    'rigs': Page(
        'On what rigs?',
        'What is found of a real pendulum, and who holds one whose drive, frictions, sensors and '
        'bodies are not as told, or of which the model lacks a term.',
        ('recordings', 'intervals', 'drives', 'rig', 'wrong_models')),
    'sizes': Page(
        'Of what size, at what rate?',
        'Who holds pendulums of other lengths and masses, as fast as their sensors are; why one '
        'number tells it: [theory](../theory.md#units-of-the-pendulum).',
        ('sizes',)),
    'benchmark': Page(
        'How fast is it?', 'How long it takes beside its peers, on the same problems.',
        ('benchmark', 'closed_loops')),
    'methods': Page(
        'Which method, when?',
        'What each solver holds and costs on the same cases, and what each part around them is '
        'worth. What follows: [evaluation](../evaluation.md#which-method-when).',
        ('methods', 'ablation')),
    'paper': Page(
        'What of the paper comes out again?',
        'Its six experiments in numbers; what they mean, claim by claim: [the paper '
        'anew](../paper.md).', ('paper',)),
    'learned': Page(
        'What does it learn, and from how much?',
        'How it learns: [learned dynamics](../learned_dynamics.md).', ('learned',)),
    'live': Page(
        'What does it do in real time?',
        'Plant and mpc as processes, while parameters change, processes fail, states come faster, '
        'and others keep the cores busy.',
        ('live_changes', 'live_faults', 'live_rates', 'live_busy', 'live_soak')),
    'bags': Page(
        'What do bags survive?',
        'A logger that is killed, a full disk, and damage; and what becomes a bag: a log of a '
        'million rows. How it is done: [bags](../bags.md).',
        ('durability', 'damaged_bags', 'large_logs'))}


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
        make([] if arguments.mark else parts_of(arguments.pages or PAGES), arguments.again)
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
                        help=f'of {", ".join(PAGES)}, or a part of one, of {", ".join(PARTS)} '
                             '(default: all pages)')
    parser.add_argument('--dirty', action='store_true',
                        help='though sources differ from the commit; the pages say so')
    parser.add_argument('--mark', action='store_true',
                        help='make none; only say on each page whether what it measures has '
                             'changed since')
    parser.add_argument('--again', action='store_true',
                        help='forget what was played from the same sources')
    return parser


def name_of_page(text: str) -> str:
    """Read the name of a page, or of a part."""
    if text not in {**PAGES, **PARTS}:
        raise argparse.ArgumentTypeError(f'unknown page {text!r}; expected of {", ".join(PAGES)}')
    return text


def parts_of(names: Iterable[str]) -> list[str]:
    """Return the parts of pages, those last that put others together."""
    parts = dict.fromkeys(part for name in names for part in (
        PAGES[name].parts if name in PAGES else [name]))
    return sorted(parts, key=lambda part: PARTS[part].sources is None)


def make(names: Sequence[str], again: bool) -> None:
    """
    Make parts, one after the other, each into its page; mark what is older; write README's table.

    Raises Failure, CampaignError or OSError; what was finished stays.
    """
    expected = spent = 0.0    # [min] of the parts that were made here
    for number, name in enumerate(names, 1):
        pace = spent / expected if expected else 1.0
        left = pace * sum(PARTS[other].minutes for other in names[number - 1:])
        print(f'== {name}, part {number} of {len(names)}: {pace * PARTS[name].minutes:.0f} min; '
              f'{left:.0f} min left of all', flush=True)
        began = time.monotonic()
        if place(name, again):
            print('   made from the same sources before; RESULTS=--again makes it anew')
        else:
            expected += PARTS[name].minutes
            spent += (time.monotonic() - began) / 60
    for path, text in marked(DOCS / 'results').items():
        path.write_text(text, encoding='utf-8')
    if 'summary' in names:
        summary.into_readme(stamp.TOP / 'README.md', DOCS / 'results' / 'reliability.md')
    print(f'== {len(names)} parts, {spent:.1f} min', flush=True)


def marked(results: Path) -> dict[Path, str]:
    """Return every page, with a line above each part that is older than what it measures."""
    texts = {path: path.read_text(encoding='utf-8')
             for page in PAGES if (path := results / f'{page}.md').exists()}
    stamps = {name: of for text in texts.values() for name, of in stamp.read(text).items()}
    older = {name for name, of in stamps.items() if PARTS[name].sources() != of.sources}
    usual = stamp.usual(stamps.values())
    return {path: stamp.marked(text, older, usual) for path, text in texts.items()}


def place(name: str, again: bool) -> bool:
    """
    Put a part into its page, made anew unless it was made from the same sources; return whether.

    It is put there as a whole, or not at all; its rows go to results/.
    """
    sources = PARTS[name].sources
    kept = KEPT / (f'{name}_{sources()}_{processor()}' if sources else name)
    if again or not sources:
        shutil.rmtree(kept, ignore_errors=True)
    finished = kept / 'docs'
    was_there = finished.exists()
    if not was_there:
        begun = kept / 'begun'
        shutil.rmtree(begun, ignore_errors=True)
        for folder in ('results', 'figures'):
            (begun / folder).mkdir(parents=True)
        PARTS[name].write(begun, kept)
        begun.rename(finished)
    shutil.copytree(finished / 'figures', DOCS / 'figures', dirs_exist_ok=True)
    shutil.copytree(finished / 'results', ROWS, dirs_exist_ok=True)
    page = next(page for page, of in PAGES.items() if name in of.parts)
    path = DOCS / 'results' / f'{page}.md'
    path.parent.mkdir(parents=True, exist_ok=True)
    before = path.read_text(encoding='utf-8') if path.exists() else ''
    text = (finished / 'results' / f'{name}.md').read_text(encoding='utf-8')
    path.write_text(composed(page, {**parts_in(before), name: text}), encoding='utf-8')
    if name in seeded.SEEDED:
        seeded.store_sample(name, read(ROWS / f'{name}.csv.gz'), DOCS / 'results' / 'sample')
    return was_there


def parts_in(text: str) -> dict[str, str]:
    """Return the parts of a page, by their names."""
    return {name: re.sub('^##', '#', part, flags=re.M) for name, part in re.findall(
        r'^<!-- (\w+) -->\n(.*?)(?=^<!-- \w+ -->$|\Z)', text, re.M | re.S)}


def composed(page: str, parts: Mapping[str, str]) -> str:
    """Return a page of the parts that there are."""
    of = PAGES[page]
    return f'# {of.title}\n\n{of.question}\n' + ''.join(
        f'\n{BEGIN.format(name)}' + re.sub('^#', '##', parts[name].strip(), flags=re.M) + '\n'
        for name in of.parts if name in parts)


if __name__ == '__main__':
    sys.exit(main())
