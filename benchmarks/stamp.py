# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where a stored page comes from: the sentence that names it, what it says, and its table."""

import argparse
from collections.abc import Iterable, Sequence
from datetime import date
import hashlib
from pathlib import Path
import re
import subprocess
from typing import NamedTuple

import pandas as pd

from dp_swing_ros import provenance
from dp_swing_ros.kernels import processor

TOP = Path(__file__).parents[1]
# by `make results`, which they may not stop
GENERATED = ('README.md', 'docs/results', 'docs/figures')
MADE = re.compile(r'Made by `make results PAGES=(?P<page>\w+)` on \S+ at commit '
                  r'(?P<commit>[\w-]+), sources (?P<sources>[0-9a-f]{16}); '
                  r'(?P<machine>[^;]*) \((?P<processor>[\w-]+)\); (?P<versions>[^;]*)\.\n')


class Stamp(NamedTuple):
    """What a page says of its origin."""

    page: str
    commit: str
    sources: str
    processor: str
    versions: str


def made(page: str, sources: str, packages: Iterable[str] = provenance.COMPUTING) -> str:
    """Return the sentence, as a line of Markdown; sources are what decides the page."""
    return (f'Made by `make results PAGES={page}` on {date.today()} at commit {commit()}, '
            f'sources {sources}; {provenance.machine()} ({processor()}); {versions(packages)}.\n')


def versions(packages: Iterable[str] = provenance.COMPUTING) -> str:
    """Return the versions of Python and of packages in words."""
    return ', '.join(f'{name} {number}'
                     for name, number in provenance.packages(packages).items())


def read(page: Path) -> Stamp:
    """
    Return what a page says of its origin.

    Raises ValueError where it does not.
    """
    found = MADE.search(page.read_text(encoding='utf-8'))
    if found is None:
        raise ValueError(f'{page} does not name its commit and sources; run `make results '
                         f'PAGES={page.stem}`')
    return Stamp(**{name: found[name] for name in Stamp._fields})


def sources_with(*scripts: str) -> str:
    """Return a digest of the whole package and of some files of this folder."""
    digest = hashlib.sha256(provenance.sources(()).encode())
    for script in scripts:
        digest.update(Path(__file__).with_name(script).read_bytes())
    return digest.hexdigest()[:16]


def folders(docs: Path) -> tuple[Path, Path]:
    """Return the folders of documents for results and for figures, which it makes."""
    results, figures = docs / 'results', docs / 'figures'
    for folder in (results, figures):
        folder.mkdir(parents=True, exist_ok=True)
    return results, figures


def asked(description: str | None, argv: Sequence[str] | None,
          seeds: int) -> tuple[int, Path, Path]:
    """Return what a command line asks for: how many seeds, and the folders of `folders`."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument('--seeds', type=int, default=seeds)
    parser.add_argument('--docs', type=Path, default=TOP / 'docs')
    arguments = parser.parse_args(argv)
    return (arguments.seeds, *folders(arguments.docs))


def verdict(is_met: bool) -> str:
    """Return whether an aim is met, in a word."""
    return 'met' if is_met else '**missed**'


def store_table(table: pd.DataFrame, path: Path) -> None:
    """Write a compressed table, the same bytes for the same numbers."""
    table.to_csv(path, index=False, compression={'method': 'gzip', 'mtime': 0})


def store_page(name: str, table: pd.DataFrame, text: str, docs: Path) -> None:
    """Write a page and its table into the results of a folder of documents."""
    results = docs / 'results'
    results.mkdir(parents=True, exist_ok=True)
    store_table(table, results / f'{name}.csv.gz')
    (results / f'{name}.md').write_text(text, encoding='utf-8')


def commit() -> str:
    """Return the commit that is checked out, and whether a source was changed since."""
    head = _git('rev-parse', '--short=10', 'HEAD').strip()
    return f'{head}-dirty' if changed() else head


def changed() -> list[str]:
    """Return the files that differ from the commit, but for those that are generated."""
    lines = _git('status', '--porcelain', '--', '.', *(f':(exclude){name}' for name in GENERATED))
    return [line[3:] for line in lines.splitlines()]


def _git(*arguments: str) -> str:
    return subprocess.run(['git', '-C', str(TOP), *arguments], capture_output=True, text=True,
                          check=True).stdout
