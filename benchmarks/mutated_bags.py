# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Damage a bag in many ways, give it to the tools, and write damaged_bags.md.

A tool passes if it ends soon, with exit code 2 and one line, or with a result that is that of the
undamaged bag or comes with the notice "Incomplete: N of M messages". What failed is printed, and
stands on the page.
"""

import argparse
from collections import Counter
from collections.abc import Callable, Iterator
import contextlib
import io
from pathlib import Path
import shutil
import signal
import subprocess
import sys
import tempfile
import traceback
from types import ModuleType
from typing import NamedTuple
import warnings

from mutations import MUTATIONS
import numpy as np
from stamp import made, sources, TOP
from tqdm import tqdm

from dp_swing_ros.bags import read_episode
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.errors import UserError
from dp_swing_ros.evaluation.comparison import table
from dp_swing_ros.evaluation.metrics import measure
from dp_swing_ros.nodes import replay
from dp_swing_ros.tables import compact
from dp_swing_ros.tools import analyse as analysis, recover, verify
from dp_swing_ros.tools.processes import isolated

PATIENCE = 20  # [s] for a tool
INCOMPLETE = 'Incomplete: '  # begins what a tool says of a bag that lacks messages
ERROR, RESULT, PARTIAL = 'error', 'result', 'reported as partial'


class Whole(NamedTuple):
    """What the undamaged bag holds."""

    folder: Path
    table: str
    messages: set[tuple[str, int, int, int, bytes]]


class Failure(Exception):
    """A tool did what it must not do."""


class Hang(BaseException):
    """A tool takes too long."""


def analyse(bag: Path, whole: Whole) -> str:
    """Read a bag as `analyse` does."""
    try:
        return _same(shown(bag), whole)
    except UserError as error:
        return _one_line(str(error))


def analyse_partial(bag: Path, whole: Whole) -> str:
    """Call `analyse --partial`: the user said that a part will do, and learns that it is one."""
    try:
        text = shown(bag, partial=True)
    except UserError as error:
        return _one_line(str(error))
    if text == whole.table:
        return RESULT
    with replaced(analysis, 'write', lambda *_: []):    # pictures take long, and are tested
        _, text, _ = called(analysis.main, [str(bag), '--partial'])
    if INCOMPLETE not in text:
        raise Failure('another table than that of the undamaged bag, and no notice')
    return PARTIAL


def recovered(bag: Path, whole: Whole) -> str:
    """Recover a bag; nothing is in the new one that was not in the undamaged one."""
    output = bag.with_name('recovered')
    code, text, complaint = called(recover.main, [str(bag), '--output', str(output)])
    if code == 2:
        return _one_line(complaint)
    if code != 0:
        raise Failure(f'exit code {code}')
    if 'is whole' in text:
        return _same(shown(bag), whole)
    found = messages(output)
    if not found <= whole.messages:
        raise Failure(f'{len(found - whole.messages)} messages were never recorded')
    with contextlib.suppress(UserError):
        shown(output)
    if found != whole.messages and not (
            INCOMPLETE in text and Bag(output).incomplete):
        raise Failure('messages are gone, and neither the tool nor the new bag says so')
    return PARTIAL


def verified(bag: Path, whole: Whole) -> str:
    """Verify a bag; no force may come out another."""
    code, _, complaint = called(verify.main, [str(bag)])
    if code == 2:
        return _one_line(complaint)
    if code != 0:
        raise Failure(f'exit code {code}')
    return RESULT


def replayed(bag: Path, whole: Whole) -> str:
    """Play a bag, a thousand times as fast, with all its messages or none."""
    code, text, complaint = called(replay.main, [
        'replay', '--ros-args', '--log-level', 'fatal', '-p', f'bag:={bag}', '-p', 'rate:=1000.0',
        '-p', 'wait:=0.0', '-p', 'playback_duration:=60.0'])
    if code == 2:
        return _one_line(complaint)
    if code != 0 or f': {len(whole.messages)} messages' not in text:
        raise Failure(f'exit code {code}: {text}{complaint}')
    return RESULT


@contextlib.contextmanager
def replaced(module: ModuleType, name: str, value: object) -> Iterator[None]:
    """Let a name of a module be another."""
    before = getattr(module, name)
    setattr(module, name, value)
    try:
        yield
    finally:
        setattr(module, name, before)


def called(main: Callable[[list[str]], int], arguments: list[str]) -> tuple[int, str, str]:
    """Return exit code, output and complaints of a tool."""
    text, complaint = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(text), contextlib.redirect_stderr(complaint):
        code = main(arguments)
    return code, text.getvalue(), complaint.getvalue()


TOOLS: dict[str, Callable[[Path, Whole], str]] = {
    'analyse': analyse, 'analyse --partial': analyse_partial, 'recover': recovered,
    'verify': verified, 'replay': replayed}


def shown(bag: Path, partial: bool = False) -> str:
    """Return the table that `analyse` prints."""
    episode = read_episode(bag, partial)
    with warnings.catch_warnings(), np.errstate(all='ignore'):
        warnings.simplefilter('ignore')
        return table({episode.solver or 'no controller': measure(episode)})


def messages(bag: Path) -> set[tuple[str, int, int, int, bytes]]:
    """Return all that a bag holds."""
    return {(entry.topic, entry.received, entry.sent, entry.sequence, entry.data)
            for entry in Bag(bag).entries}


def _same(text: str, whole: Whole) -> str:
    if text != whole.table:
        raise Failure('another table than that of the undamaged bag')
    return RESULT


def _one_line(error: str) -> str:
    if not error.strip() or '\n' in error.strip():
        raise Failure(f'not one line: {error!r}')
    return ERROR


def outcome(tool: str, bag: Path, whole: Whole) -> str:
    """Return what came of a tool; raises Failure."""
    with within(PATIENCE):
        try:
            return TOOLS[tool](bag, whole)
        except Hang:
            raise Failure(f'not done after {PATIENCE} s') from None
        except Failure:
            raise
        except Exception:  # that is what is looked for
            raise Failure(traceback.format_exc()) from None


@contextlib.contextmanager
def within(seconds: int) -> Iterator[None]:
    """Interrupt what takes longer."""
    def stop(*_: object) -> None:
        raise Hang

    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def play(bag: Path, seeds: range) -> tuple[Counter[tuple[str, str, str]], list[str]]:
    """Try all tools on a mutation per seed; return counts by kind, tool and outcome, and fails."""
    whole = Whole(bag, shown(bag), messages(bag))
    counts: Counter[tuple[str, str, str]] = Counter()
    fails = []
    for seed in tqdm(seeds, desc='mutations', leave=False, disable=None):
        kind = list(MUTATIONS)[seed % len(MUTATIONS)]
        for tool in TOOLS:
            with tempfile.TemporaryDirectory(prefix='mutated_bags_') as place:
                mutated = Path(place, 'bag')
                shutil.copytree(bag, mutated)
                MUTATIONS[kind](mutated, np.random.default_rng(seed))
                try:
                    counts[kind, tool, outcome(tool, mutated, whole)] += 1
                except Failure as failure:
                    counts[kind, tool, 'FAILED'] += 1
                    fails.append(f'seed {seed}, {kind}, {tool}: {failure}')
    return counts, fails


def run(folder: Path) -> Path:
    """Record a run, and return its bag."""
    command = ['ros2', 'run', 'dp_swing_ros', 'demo', '--lockstep', '--no-figures', '--output',
               str(folder)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode not in (0, 1):
        raise SystemExit(f'{" ".join(command)} failed:\n{done.stdout}{done.stderr}')
    return folder / 'bag'


def page(counts: Counter[tuple[str, str, str]], seeds: range) -> str:
    """Return the page as Markdown."""
    lines = ['# Damaged bags\n',
             made('damaged_bags', sources('damaged_bags')),
             'A recorded run is damaged and given to each tool, with the seeds '
             f'{seeds.start} to {seeds[-1]}. error: exit code 2 and one line; '
             'result: the table of the undamaged bag; reported as partial: a part of it, with '
             'that notice; FAILED: a traceback, a wrong table or message, or no end after '
             f'{PATIENCE} s.\n']
    rows = [['damage', *TOOLS]]
    for kind in MUTATIONS:
        cells = []
        for tool in TOOLS:
            found = {name: count for (one, other, name), count in sorted(counts.items())
                     if (one, other) == (kind, tool)}
            cells.append(', '.join(f'{count} {name}' for name, count in found.items()) or '-')
        rows.append([kind, *cells])
    return '\n'.join([*lines, compact(rows)])


def main(argv: list[str] | None = None) -> None:
    """Do all mutations."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--bag', type=Path, help='folder of a recorded run (default: a new one)')
    parser.add_argument('--count', type=int, default=240)
    parser.add_argument('--seed', type=int, default=0, help='the first one')
    parser.add_argument('--docs', type=Path, default=TOP / 'results')
    arguments = parser.parse_args(argv)
    seeds = range(arguments.seed, arguments.seed + arguments.count)
    with tempfile.TemporaryDirectory(prefix='mutated_bags_') as place, isolated():
        counts, fails = play(arguments.bag or run(Path(place, 'run')), seeds)
    results = arguments.docs / 'results'
    results.mkdir(parents=True, exist_ok=True)
    (results / 'damaged_bags.md').write_text(page(counts, seeds) + '\n', encoding='utf-8')
    print(*fails, sep='\n', end='\n' if fails else '', file=sys.stderr)


if __name__ == '__main__':
    main()
