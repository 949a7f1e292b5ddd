# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How long the import of a large log takes, in how much memory, and whether others read its bag.

Run by `make results`, for docs/results/bags.md; takes a minute on a machine that must do nothing
else.
"""

import argparse
from collections import Counter
from collections.abc import Callable
from pathlib import Path
import re
import subprocess
import sys
import tempfile
import time

import numpy as np
import pandas as pd
from readers import Messages, OTHERS
from stamp import folders, made, sources, TOP, verdict

from dp_swing_ros.tables import compact

ROWS, RATE = 1_000_000, 1000.0
AIM = 60.0, 1e9          # [s], [B]
POLL = 0.02              # [s] between looks at the memory
EVERY = 1000             # of messages is compared with the log
# of these topics: what of a message is in which columns
EXPECTED = {'/joint_states': ('position', ['x', 'theta1', 'theta2']),
            '/force_command': ('data', ['u'])}
COLUMNS = {'t': 'time', 'cart': 'x', 'joint1': 'theta1', 'joint2': 'theta2', 'force': 'u'}
WRITERS: dict[str, Callable[[pd.DataFrame, Path], object]] = {
    'csv': lambda log, path: log.to_csv(path, index=False),
    'parquet': lambda log, path: log.to_parquet(path)}


def main() -> None:
    """Import a log of each kind and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--rows', type=int, default=ROWS)
    parser.add_argument('--docs', type=Path, default=TOP / 'results')
    arguments = parser.parse_args()
    log = swaying(arguments.rows)
    with tempfile.TemporaryDirectory() as name:
        rows = [imported(log, Path(name), kind) for kind in WRITERS]
    results, _ = folders(arguments.docs)
    (results / 'large_logs.md').write_text('\n'.join([
        '# Large logs\n', made('large_logs', sources('large_logs')),
        f'Two links that sway, {len(log):,} rows, {RATE:g} in a second: `ros2 run '
        'dp_swing_ros import`, from start to end. Under a minute and 1 GB is the aim. Others read '
        f'it where they find a state and a command of each row, and every {EVERY}th is that of '
        'the log.\n', compact([list(rows[0]), *(list(each.values()) for each in rows)])]),
        encoding='utf-8')


def swaying(rows: int) -> pd.DataFrame:
    """Return a log of two links that sway."""
    t = np.arange(rows) / RATE
    return pd.DataFrame({
        'time': t, 'x': 0.1 * np.sin(t), 'theta1': 0.3 * np.sin(3 * t),
        'theta2': -0.4 * np.sin(5 * t), 'u': 2 * np.cos(t)}).round(6)


def imported(log: pd.DataFrame, folder: Path, kind: str) -> dict[str, str]:
    """Return the cells of a table about the import of a file of a kind."""
    path, bag = folder / f'log.{kind}', folder / f'bag_{kind}'
    WRITERS[kind](log, path)
    began = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, '-m', 'dp_swing_ros', 'import', path, '-o', bag, '--columns',
         *(f'{name}={column}' for name, column in COLUMNS.items())], stdout=subprocess.DEVNULL)
    memory = 0
    while process.poll() is None:   # what wait4 tells may be the memory of who started it
        memory = max(memory, peak_of(process.pid))
        time.sleep(POLL)
    taken = time.perf_counter() - began
    if process.returncode:
        raise SystemExit(f'the import of {path.name} failed; what it wrote stands above')
    return {
        'log': kind, 'size [MB]': f'{path.stat().st_size / 1e6:.0f}', 'time [s]': f'{taken:.1f}',
        'memory, most [MB]': f'{memory / 1e6:.0f}',
        'aim': verdict(taken < AIM[0] and memory < AIM[1]),
        **{f'read by {name}': 'yes' if agrees(log, read, bag) else 'NO'
           for name, read in OTHERS.items()}}


def peak_of(pid: int) -> int:
    """Return the most memory that a process has had [B], 0 where it has ended."""
    try:
        status = Path(f'/proc/{pid}/status').read_text(encoding='ascii')
    except ProcessLookupError:
        return 0
    found = re.search(r'VmHWM:\s+(\d+) kB', status)
    return 1024 * int(found[1]) if found else 0


def agrees(log: pd.DataFrame, read: Callable[[Path], Messages], bag: Path) -> bool:
    """Return whether a reader finds the rows of a log; how it fails is for people to see."""
    counts = Counter[str]()
    try:
        for topic, decode in read(bag):
            if topic in EXPECTED and counts[topic] % EVERY == 0:
                field, columns = EXPECTED[topic]
                np.testing.assert_allclose(np.ravel(getattr(decode(), field)),
                                           log.iloc[counts[topic]][columns], rtol=0, atol=1e-9)
            counts[topic] += 1
    except Exception as error:
        print(f'{bag}: {type(error).__name__}: {error}', file=sys.stderr)
        return False
    return all(counts[topic] == len(log) for topic in EXPECTED)


if __name__ == '__main__':
    main()
