# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What a bag keeps when its logger is killed, when the disk is full, and at high rates.

Run by `make results`, for docs/results/durability.md; takes minutes on a machine that must do
nothing else. The full disk needs the right to mount one.
"""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
import resource
import subprocess
import sys
import tempfile
import time
from typing import NamedTuple

import numpy as np
from readers import read, Verdicts, whole
from stamp import made, sources, TOP
from tqdm import tqdm
import yaml

from dp_swing_ros.tables import compact
from dp_swing_ros.tools.processes import Crew, isolated, Process

TOPICS = 2                 # of the runs that are killed
LIFE = 0.5, 2.0            # [s] a logger lives on once it writes
SLOW, FAST = 20.0, 1000.0  # [1/s] on each topic
LOAD = 5, 1000.0           # topics and their rate [1/s] at full load
DISK = '1m'
PATIENCE = 60.0            # [s] for what should take one


class Kill(NamedTuple):
    """What a bag held after its logger was killed and the bag recovered."""

    lost: int           # messages that had gone out and were not in the bag
    oldest: float       # [ms] before the kill that the first of them went out, 0 without one
    newest: float       # [ms] before the kill that the last message in the bag went out
    whole: bool         # no number missing in between
    readers: Verdicts


def main() -> None:
    """Do it all and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument('--kills', type=int, default=30, help=f'at {SLOW:g} messages/s')
    parser.add_argument('--kills-fast', type=int, default=10, help=f'at {FAST:g} messages/s')
    parser.add_argument('--seconds', type=float, default=60.0, help='of full load')
    parser.add_argument('--seed', type=int, default=0, help='of the moments of the kills')
    parser.add_argument('--docs', type=Path, default=TOP / 'results')
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    with isolated(), tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rows = [row(rate, kills(folder / f'{rate:g}', rate, count, rng))
                for rate, count in ((SLOW, arguments.kills), (FAST, arguments.kills_fast))]
        text = page(rows, full_disk(folder / 'disk'), load(folder / 'load', arguments.seconds))
    results = arguments.docs / 'results'
    results.mkdir(parents=True, exist_ok=True)
    (results / 'durability.md').write_text(text, encoding='utf-8')


def kills(folder: Path, rate: float, count: int, rng: np.random.Generator) -> list[Kill]:
    """
    Kill one logger after another at random moments.

    Each has a publisher of its own: for the 20 s of its lease a reliable publisher goes on to
    serve a logger that was killed, which takes more of it with every one.
    """
    found = []
    for n in tqdm(range(count), f'kills at {rate:g}/s', disable=None):
        own = folder / str(n)
        own.mkdir(parents=True)
        with publisher(own, rate, TOPICS), Crew() as crew:
            logger = start_logger(crew, own / 'bag', TOPICS)
            time.sleep(rng.uniform(*LIFE))
            moment = time.time_ns()
            logger.kill()
        found.append(examined(own / 'bag', np.load(own / 'times.npy'), moment))
    return found


def examined(bag: Path, times: np.ndarray, killed: int) -> Kill:
    """Recover a bag and compare it with the times [ns] at which its messages went out."""
    done = subprocess.run(['ros2', 'run', 'dp_swing_ros', 'recover', bag], capture_output=True,
                          text=True)
    if done.returncode:
        raise SystemExit(f'recover {bag} failed:\n{done.stdout}{done.stderr}')
    numbers, readers = read(bag.with_name(f'{bag.name}_recovered'))
    lost: list[int] = []    # [ns] when they went out
    newest: list[int] = []
    for n in range(times.shape[1]):
        last = numbers[f'/number_{n}'][-1]
        newest.append(times[last, n])
        lost += [sent for sent in times[last + 1:, n] if sent < killed]
    return Kill(len(lost), (killed - min(lost, default=killed)) / 1e6,
                (killed - max(newest)) / 1e6, whole(numbers), readers)


def full_disk(folder: Path) -> str:
    """Log onto a small disk until it is full, and say in Markdown what is left."""
    folder.mkdir()
    place = folder / 'mounted'
    place.mkdir()
    if subprocess.run(['mount', '-t', 'tmpfs', '-o', f'size={DISK}', 'tmpfs', place],
                      capture_output=True).returncode:
        return 'Not measured: no disk could be mounted here.'
    try:
        topics, rate = LOAD
        with publisher(folder, rate, topics), Crew() as crew:
            logger = start_logger(crew, place / 'bag', topics)
            wait_for(lambda: not logger.running)
        said = (folder / 'mounted.log').read_text().splitlines()[-1]
        numbers, readers = read(place / 'bag')
        kept = sum(map(len, numbers.values()))
        return '\n'.join([
            f'The logger onto a tmpfs of size={DISK} at {topics} x {rate:g} messages/s, in its '
            'own words but for the place:\n', f'> {said.replace(str(place) + "/", "")}\n',
            f'{kept} messages are in the bag as it was left, '
            f'{"without" if whole(numbers) else "WITH"} gaps; read by {listed(readers)}.'])
    finally:
        subprocess.run(['umount', place], check=True)


def load(folder: Path, seconds: float) -> str:
    """Log many messages and say in Markdown how many came."""
    folder.mkdir()
    topics, rate = LOAD
    with publisher(folder, rate, topics, '--duration', str(seconds)), Crew() as crew:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        logger = start_logger(crew, folder / 'bag', topics)
        wait_for((folder / 'times.npy').exists, PATIENCE + 2 * seconds)
        logger.end()
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    times = np.load(folder / 'times.npy')
    numbers, _ = read(folder / 'bag')
    kept = sum(map(len, numbers.values()))
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    about = yaml.safe_load((folder / 'bag' / 'metadata.yaml').read_text())
    custom = about['rosbag2_bagfile_information']['custom_data']
    counted = sum(int(count) for key, count in custom.items() if key.startswith('lost:'))
    return (f'{times.size} messages on {topics} topics in '
            f'{(times[-1, -1] - times[0, 0]) / 1e9:.1f} s: {kept} in the bag, '
            f'{times.size - kept} lost; the logger itself counted {counted} lost. It took '
            f'{spent:.1f} s of processor time, start and end included.')


@contextmanager
def publisher(folder: Path, rate: float, topics: int, *more: str) -> Iterator[None]:
    """Publish numbered messages; afterwards their times are in times.npy."""
    with subprocess.Popen([sys.executable, Path(__file__).with_name('numbered.py'),
                           folder / 'times.npy', '--rate', str(rate), '--topics', str(topics),
                           *more]) as process:
        try:
            yield
        finally:
            process.terminate()


def start_logger(crew: Crew, bag: Path, topics: int) -> Process:
    """Start a logger and wait until it writes messages."""
    logger = crew.start(
        'logger', {'output': str(bag), 'progress_period': 0.0,
                   'topics': [f'number_{n}' for n in range(topics)]},
        bag.parent.with_suffix('.log'))
    file = bag / f'{bag.name}_0.mcap'
    wait_for(lambda: not logger.running or file.exists() and file.stat().st_size > 100)
    return logger


def wait_for(condition: Callable[[], bool], timeout: float = PATIENCE) -> None:
    """Wait until a condition holds."""
    end = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > end:
            raise SystemExit(f'nothing happened for {timeout:g} s')
        time.sleep(0.01)


def row(rate: float, results: list[Kill]) -> dict[str, str]:
    """Return the cells of a table about the kills at a rate."""
    count = len(results)
    oldest = [each.oldest for each in results]
    newest = [each.newest for each in results]
    return {
        'messages/s on each topic': f'{rate:g}', 'kills': str(count),
        'most lost': str(max(each.lost for each in results)),
        'oldest lost, median [ms]': f'{np.median(oldest):.0f}',
        'oldest lost, most [ms]': f'{max(oldest):.0f}',
        'newest kept, most [ms]': f'{max(newest):.0f}',
        'complete in between': f'{sum(each.whole for each in results)} of {count}',
        **{f'read by {name}': f'{sum(each.readers[name] for each in results)} of {count}'
           for name in results[0].readers}}


def listed(readers: Verdicts) -> str:
    """Return readers and verdicts in words."""
    return ', '.join(f'{name} ({"yes" if verdict else "NO"})' for name, verdict in readers.items())


def page(rows: list[dict[str, str]], disk: str, loaded: str) -> str:
    """Return the page as Markdown."""
    return '\n'.join([
        '# Durability\n',
        made('durability', sources('durability')),
        '## SIGKILL of the logger\n',
        f'At random moments, with {TOPICS} topics of numbered messages; then '
        '`ros2 run dp_swing_ros recover`. Lost are all messages that had gone out before the kill '
        'and are not in the recovered bag, even if the logger had not received them yet; the '
        'times count back from the kill.\n',
        compact([list(rows[0]), *(list(each.values()) for each in rows)]),
        '\n## A full disk\n', disk, f'\n## {LOAD[0] * LOAD[1]:,.0f} messages/s\n', loaded])


if __name__ == '__main__':
    main()
