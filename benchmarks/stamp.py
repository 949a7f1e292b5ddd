# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Where a part of a page comes from: the sentence that names it, what it says, its table."""

import argparse
import ast
from collections import Counter
from collections.abc import Container, Iterable, Sequence
from datetime import date
from functools import cache
import hashlib
from pathlib import Path
import re
import subprocess
from typing import Any, NamedTuple

import pandas as pd

from dp_swing_ros import provenance
from dp_swing_ros.kernels import processor

TOP = Path(__file__).parents[1]
# by `make results`, which they may not stop
GENERATED = ('README.md', 'docs/results', 'docs/figures')
MADE = re.compile(r'Made by `make results PAGES=(?P<page>\w+)` on \S+ at commit '
                  r'(?P<commit>[\w-]+), sources (?P<sources>[0-9a-f]{16}); '
                  r'(?P<machine>[^;]*) \((?P<processor>[\w-]+)\); (?P<versions>[^;\n]*)\.\n')
TOGETHER = re.compile(r'Put together from the parts ([\w, ]+), each of which names its commit\.\n')
OLDER = 'What follows is older than what it measures'
MARK = re.compile(rf'\*\*{OLDER}.*\*\*\n\n')

# parts of the package that a page measures beside those that decide an episode
BAGS = ('bags/', 'environment.py', 'executables.py', 'messages/',
        *(f'nodes/{name}.py' for name in ('connections', 'fast_lane', 'logger', 'process',
                                          'ros_parameters', 'taking')), 'parameters/nodes.py',
        'tools/processes.py', 'topics.py')
LIVE = (*BAGS, 'runtime/', *(f'nodes/{name}.py' for name in (
    'diagnostics', 'messages', 'mpc', 'plant')))
SOAK = (*LIVE, 'tools/demo.py', 'tools/tool_node.py')
SOAKING = 'soak watcher resources echo'
OPERATED = (*LIVE, 'tools/tool_node.py')
LEARNED = ('learning/',)
IN_C = ('peers_acados peers_aligator peers_aligator.cpp peers_casadi peers_cpp peers_crocoddyl '
        'peers_crocoddyl.cpp peers_problem.hpp '   # what peers are given
        + ' '.join(f'../examples/acados_rti/acados_rti/{name}' for name in (
            'expressions.py', 'iteration.c', 'library.py', 'solver.py')))
DEVICE = 'solvers/device.py'   # loaded for samples on a device, and no episode has such


class Measured(NamedTuple):
    """
    What a page measures: by scripts of this folder, parts of the package, and episodes.

    A script with a dot in its name is a file that is none of Python, or from another folder.
    """

    scripts: str = ''
    parts: tuple[str, ...] = ()
    episodes: bool = True

    @property
    def files(self) -> list[str]:
        """Return the files of the scripts."""
        return [name if '.' in name else f'{name}.py' for name in self.scripts.split()]


# what is not named is a part of episodes alone (seeded.py)
MEASURED = {
    'ablation': Measured('ablation'),
    'recordings': Measured('recordings', (
        'identification/', 'pendulum/', 'kernels/', 'estimators/unknowns.py', 'dynamics/',
        *LEARNED), episodes=False),
    'intervals': Measured('intervals', ('identification/', *LEARNED)),
    'rig': Measured(parts=('identification/',)),
    'wrong_models': Measured('wrong_models campaigns rig unmodelled'),
    'live_changes': Measured('live_changes live_operator', OPERATED),
    'live_faults': Measured('live_faults faults live_operator', OPERATED),
    'live_rates': Measured(f'live_rates sizes {SOAKING}', SOAK),
    'live_busy': Measured(f'live_busy live_rates sizes {SOAKING}', SOAK),
    'live_soak': Measured(f'live_soak soak_figures {SOAKING}', SOAK),
    'learned': Measured('learned', LEARNED),
    'durability': Measured('durability numbered readers', (*BAGS, 'recovery/', 'tools/recover.py'),
                           episodes=False),
    'damaged_bags': Measured('mutated_bags mutations', (
        *BAGS, 'identification/recorded.py', 'learning/recorded.py', 'nodes/replay.py',
        'recovery/', 'report/', 'rerun/', 'tools/'), episodes=False),
    'large_logs': Measured('large_logs readers', ('bags/', 'messages/', 'tools/import_log.py'),
                           episodes=False),
    'benchmark': Measured(f'benchmark limit operations peers_gradient peers_hydrax peers_sampling '
                          f'peers_solvers startup timing {IN_C}', (DEVICE,)),
    'closed_loops': Measured(f'closed_loops campaigns peers_gradient peers_hydrax peers_solvers '
                             f'timing {IN_C}')}


class Stamp(NamedTuple):
    """What a page says of the origin of a part."""

    page: str
    commit: str
    sources: str
    processor: str
    versions: str


def made(page: str, sources: str, packages: Iterable[str] = provenance.COMPUTING) -> str:
    """Return the sentence, as a line of Markdown; sources are what decides the page."""
    return (f'Made by `make results PAGES={page}` on {date.today()} at commit {commit()}, '
            f'sources {sources}; {provenance.machine()} ({processor()}); {versions(packages)}.\n')


def together(parts: Iterable[str]) -> str:
    """Return the sentence of a part that only puts others together, as a line of Markdown."""
    return f'Put together from the parts {", ".join(parts)}, each of which names its commit.\n'


def versions(packages: Iterable[str] = provenance.COMPUTING) -> str:
    """Return the versions of Python and of packages in words."""
    return ', '.join(f'{name} {number}'
                     for name, number in provenance.packages(packages).items())


def read(text: str) -> dict[str, Stamp]:
    """Return what a page says of the origin of its parts, by their names."""
    return {found['page']: Stamp(**{name: found[name] for name in Stamp._fields})
            for found in MADE.finditer(text)}


def sources(page: str) -> str:
    """Return a digest of the code that a page measures, and of the scripts that measure it."""
    of = MEASURED.get(page, Measured())
    files = [Path(__file__).parent / file for file in of.files]
    for path in sorted(provenance.PACKAGE.rglob('*')):
        place = path.relative_to(provenance.PACKAGE).as_posix()
        if (path.suffix in ('.py', '.js', '.html', '.css') and place.startswith(of.parts)
                or path.suffix == '.py' and of.episodes
                and not place.startswith((*provenance.AFTERWARDS, DEVICE))):
            files.append(path)
    digest = hashlib.sha256()
    for path in files:
        text = path.read_text(encoding='utf-8')
        digest.update(path.relative_to(path.parents[1]).as_posix().encode()
                      + (meaning(text) if path.suffix == '.py' else text).encode())
    return digest.hexdigest()[:16]


@cache
def meaning(code: str) -> str:
    """Return what a module does: without comments, docstrings and layout, by any Python alike."""
    return repr(_plain(ast.parse(code)))


def _plain(node: Any) -> Any:
    """Return a syntax tree as tuples, without what some versions of Python leave out."""
    if isinstance(node, list):
        return [_plain(one) for one in node if not (
            isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant))]
    if not isinstance(node, ast.AST):
        return node
    fields = ((name, _plain(value)) for name, value in ast.iter_fields(node))
    return (type(node).__name__, *(field for field in fields if field[1] not in (None, [])))


def usual(stamps: Iterable[Stamp]) -> str:
    """Return the processor of most parts."""
    return Counter(of.processor for of in stamps).most_common(1)[0][0]


def marked(text: str, older: Container[str], processor_of_most: str) -> str:
    """Return a page with a line above each part that is older than what it measures."""
    def sentence(made: re.Match[str]) -> str:
        if made['page'] not in older:
            return made[0]
        elsewhere = '' if made['processor'] == processor_of_most else (
            f'; its processor ({made["processor"]}) is also not that of most parts')
        return (f'**{OLDER}, which has changed since commit {made["commit"]}{elsewhere}.**\n\n'
                f'{made[0]}')

    def of_others(put: re.Match[str]) -> str:
        of_older = [part for part in put[1].split(', ') if part in older]
        return f'**{OLDER}: {", ".join(of_older)}.**\n\n{put[0]}' if of_older else put[0]
    return TOGETHER.sub(of_others, MADE.sub(sentence, MARK.sub('', text)))


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
    parser.add_argument('--docs', type=Path, default=TOP / 'results')
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
