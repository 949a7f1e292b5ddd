# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How large the house is: lines of each room, the largest class and module, what each node loads.

    python scripts/house.py
    python scripts/house.py --docs   # writes the table in docs/architecture.md

Lines are all lines of a file. What a node loads is what importing its module loads, in a process
of its own. Run by `make house`, which CI does after the tests, and by `make docs`.
"""

import argparse
import ast
from collections.abc import Iterable
from functools import cache
import json
from pathlib import Path
import re
import subprocess
import sys
from typing import NamedTuple

TOP = Path(__file__).parents[1]
PACKAGE = TOP / 'dp_swing_ros'
PAGE = TOP / 'docs' / 'architecture.md'
TABLE = re.compile(r'(?<=<!-- rooms -->\n).*?(?=<!-- end of rooms -->)', re.S)
ROW = re.compile(r'^\| (\D+?) \| \d+ \| (\d+) \|$', re.M)   # of a room: its name, its lines
SLACK, SHARE = 100, 0.03   # lines by which the page may be off: not every change is one of it
WEB = ('.js', '.css', '.html')
SOURCES = ('.py', '.cpp', '.hpp')
LOADED = """
import json, resource, sys
import dp_swing_ros.nodes.{}
files = {{name: module.__file__ for name, module in sys.modules.items()
         if name.partition('.')[0] == 'dp_swing_ros'}}
print(json.dumps([files, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024]))
"""


class Contract(NamedTuple):
    """What a node may load of the package."""

    rooms: set[str]
    most: int   # modules


# The lowest layer, which all may load, is not named. What a node does not load it does not wait
# for at its start: to tighten a contract is welcome, to widen one needs a reason.
COMMON = {'environment', 'errors', 'executables', 'provenance', 'streams', 'tables', 'topics'}
CONTRACTS = {
    'plant': Contract({
        'kernels', 'messages', 'nodes', 'parameters', 'pendulum', 'problem', 'runtime',
        'simulation'}, 53),
    'mpc': Contract({
        'control', 'dynamics', 'estimators', 'kernels', 'messages', 'nodes', 'parameters',
        'pendulum', 'problem', 'runtime', 'solvers'}, 89),   # three to learn beside the equations
    'logger': Contract({
        'bags', 'messages', 'nodes', 'parameters', 'pendulum', 'simulation'}, 38)}


MOST = {'class': 275, 'module': 378}   # lines of the largest: what is there may only shrink


class Room(NamedTuple):
    """A part of the house."""

    name: str
    files: int
    lines: int


class Loaded(NamedTuple):
    """What a node loads of the package."""

    modules: dict[str, int]   # lines
    memory: float             # [MB] at most, other packages' included

    def rooms(self) -> set[str]:
        """Return the folders, and the modules beside them, that are not of the lowest layer."""
        return {name.split('.')[1] for name in self.modules if '.' in name} - COMMON


def count(file: str | Path) -> int:
    """Return how many lines a file has."""
    return Path(file).read_bytes().count(b'\n')


def room(name: str, files: Iterable[Path]) -> Room:
    """Return the room of some files."""
    lines = [count(file) for file in files]
    return Room(name, len(lines), sum(lines))


def rooms() -> list[Room]:
    """Return the rooms of the package, the largest first."""
    found = [room(folder.name, folder.rglob('*.py')) for folder in PACKAGE.iterdir()
             if (folder / '__init__.py').exists()]
    return [*sorted(found, key=lambda each: -each.lines),
            room('modules beside them', PACKAGE.glob('*.py')),
            *(room(f'pages of {name}', (file for file in (PACKAGE / name).rglob('*')
                                        if file.suffix in WEB)) for name in ('console', 'report'))]


def around() -> list[Room]:
    """Return what is beside the package."""
    return [*(room(name, (file for file in (TOP / name).rglob('*') if file.suffix in SOURCES))
              for name in ('test', 'benchmarks', 'examples')),
            room('scripts', (file for file in (TOP / 'scripts').iterdir() if file.is_file())),
            room('docs', (TOP / 'docs').glob('*.md')),
            room('docs/results', (TOP / 'docs' / 'results').glob('*.md')),
            room('README', [TOP / 'README.md'])]


def whole(parts: Iterable[Room]) -> Room:
    """Return the sum of rooms."""
    _, files, lines = zip(*parts)
    return Room('dp_swing_ros', sum(files), sum(lines))


def largest() -> tuple[tuple[int, str], tuple[int, str]]:
    """Return the lines and the names of the largest class and of the largest module."""
    classes, modules = [], []
    for file in PACKAGE.rglob('*.py'):
        name, text = str(file.relative_to(PACKAGE)), file.read_text()
        modules.append((text.count('\n'), name))
        classes += [((node.end_lineno or 0) - node.lineno + 1, f'{node.name} of {name}')
                    for node in ast.walk(ast.parse(text)) if isinstance(node, ast.ClassDef)]
    return max(classes), max(modules)


@cache
def loaded(node: str) -> Loaded:
    """Return what a node's module loads."""
    printed = subprocess.run([sys.executable, '-c', LOADED.format(node)], check=True,
                             stdout=subprocess.PIPE, text=True).stdout
    files, memory = json.loads(printed)
    return Loaded({name: count(file) for name, file in files.items() if file}, memory)


def broken(node: str, found: Loaded) -> str:
    """Return in words how a node loads more than its contract says, or nothing."""
    contract, words = CONTRACTS[node], []
    for name in sorted(found.rooms() - contract.rooms):
        modules = [each for each in found.modules if each.split('.')[1:2] == [name]]
        words.append(f'the {node} loads {name}: {", ".join(sorted(modules))}')
    if len(found.modules) > contract.most:
        words.append(f'the {node} loads {len(found.modules)} modules, more than {contract.most}')
    return '; '.join(words)


def table() -> str:
    """Return the tables of docs/architecture.md, lines rounded to hundreds."""
    parts = rooms()
    return '\n| room | files | lines |\n| --- | ---: | ---: |\n' + ''.join(
        f'| {name} | {files} | {round(lines, -2)} |\n'
        for name, files, lines in [*parts, whole(parts), *around()]) + (
        f'\nNo class has more than {MOST["class"]} lines, no module more than {MOST["module"]}.\n'
        '\n| node | modules at most | rooms |\n| --- | ---: | --- |\n') + ''.join(
        f'| {node} | {of.most} | {", ".join(sorted(of.rooms))} |\n'
        for node, of in CONTRACTS.items())


def outdated(page: str) -> list[str]:
    """Return which rooms the table of a page tells otherwise, but for some lines, and nodes."""
    found = TABLE.search(page)
    (told, _, of_nodes), (there, _, now) = (
        text.strip().partition('\n\n') for text in (found[0] if found else '', table()))
    before, after = (dict(ROW.findall(text)) for text in (told, there))
    return [*(name for name in {**before, **after}
              if name not in before or name not in after
              or abs(int(before[name]) - int(after[name])) > max(SLACK, SHARE * int(after[name]))),
            *(['nodes'] if of_nodes != now else [])]


def report() -> str:
    """Return all that is counted, as a text."""
    parts = rooms()
    lines = [f'{name:22}{files:5} files {lines:7} lines'
             for name, files, lines in [*parts, whole(parts), *around()]]
    of_class, of_module = largest()
    lines += ['', f'largest class:  {of_class[1]}, {of_class[0]} lines',
              f'largest module: {of_module[1]}, {of_module[0]} lines', '']
    for node in CONTRACTS:
        found = loaded(node)
        lines.append(f'{node:8}loads {len(found.modules):3} modules, '
                     f'{sum(found.modules.values()):6} lines, {found.memory:4.0f} MB: '
                     f'{", ".join(sorted(found.rooms()))}')
    return '\n'.join(lines)


def main() -> None:
    """Print what is counted, or write the table."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n\n')[0].strip())
    parser.add_argument('--docs', action='store_true', help='write the table of the page')
    if parser.parse_args().docs:
        page = PAGE.read_text()
        if outdated(page):   # else two changes would be two of the page, and in conflict
            PAGE.write_text(TABLE.sub(lambda _: f'{table()}\n', page))
    else:
        print(report())


if __name__ == '__main__':
    main()
