# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Plays what is left of a campaign, on all cores or on a Dask cluster."""

from collections.abc import Iterator, Sequence
import contextlib
import functools
import os
import signal
import sys
import threading
import time
import warnings

from joblib import delayed, Parallel, parallel_config
from joblib.externals.loky.process_executor import TerminatedWorkerError
from tqdm import tqdm

from dp_swing_ros.evaluation.campaign.contestants import Contestant, key, play, ready
from dp_swing_ros.evaluation.campaign.rows import CampaignError, ERROR, Row, Table
from dp_swing_ros.evaluation.scenarios import Case
from dp_swing_ros.provenance import sources
from dp_swing_ros.simulation import plants

CONNECTION = 10.0  # [s] at most to reach a scheduler
GO_ON = 'call again with the same --output to go on'
TOLD = 30.0  # [s] between two lines of progress where there is no terminal, at least
WATCH = 1.0  # [s] between two looks of a worker for its campaign


def run(episodes: Sequence[tuple[Contestant, Case]], table: Table, jobs: int,
        dask: str = '') -> None:
    """
    Play every episode that the table lacks, in their order.

    Raises ParameterError for a contestant that is none, CampaignError where it cannot go on.
    """
    done = {row.key for row in table.rows}
    todo = [(contestant, case) for contestant, case in episodes
            if key(contestant, case) not in done]
    if not todo:
        return
    for contestant in {one.label: one for one, _ in todo}.values():
        ready(contestant)  # compiles once for all workers, and refuses what cannot work
    for engine in {case.plant['engine'] for _, case in todo if 'engine' in case.plant}:
        plants.plant({'engine': engine})   # it may not be installed
    progress = _Progress(len(episodes), len(episodes) - len(todo),
                         sum(not row.metrics.success for row in table.rows))
    with _workers(jobs, dask), progress.bar:
        with _unreached(signal.SIGINT):
            rows = Parallel(return_as='generator', batch_size=1)(
                delayed(_work)(os.getpid(), contestant, case) for contestant, case in todo)
        try:
            for row in rows:
                table.append(row)
                progress.count(row)
        except TerminatedWorkerError:
            raise CampaignError('a worker process was killed, perhaps for want of memory; '
                                f'{GO_ON}') from None
        finally:
            with warnings.catch_warnings():
                warnings.simplefilter('ignore')   # joblib's, about episodes that an end cuts off
                rows.close()


class _Progress:
    """A bar on a terminal, a line now and then in a file."""

    def __init__(self, total: int, done: int, failures: int) -> None:
        self.bar = tqdm(total=total, initial=done, unit='episode', smoothing=0.05, disable=None)
        self.total, self.left, self.failures = total, total - done, failures
        self.todo, self.began = self.left, time.monotonic()
        self.told = self.began

    def count(self, row: Row) -> None:
        """Show that one more was played."""
        if row.outcome == ERROR:
            self.bar.write(f'{" ".join(map(str, row.key))}: {row.detail}', file=sys.stderr)
        self.left -= 1
        self.failures += not row.metrics.success
        self.bar.set_postfix(failed=self.failures, refresh=False)
        self.bar.update()
        now = time.monotonic()
        passed = now - self.began
        # a night's log is no longer than one can read
        if self.bar.disable and now - self.told > max(TOLD, passed / 20):
            self.told = now
            rest = passed * self.left / (self.todo - self.left)
            print(f'{self.total - self.left} of {self.total} episodes, {self.failures} not held; '
                  f'{tqdm.format_interval(passed)} gone, about {tqdm.format_interval(rest)} left',
                  file=sys.stderr, flush=True)


@contextlib.contextmanager
def _unreached(number: signal.Signals) -> Iterator[None]:
    """Start processes that a signal to all of them does not reach: this one is to end them."""
    signal.pthread_sigmask(signal.SIG_BLOCK, {number})   # which they inherit
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {number})


def _work(campaign: int, contestant: Contestant, case: Case) -> Row:
    """Play in a worker, which is not to outlive a campaign that is killed."""
    if os.getppid() == campaign:
        _watch(campaign)
    return play(contestant, case)


@functools.cache
def _watch(campaign: int) -> None:
    def watch() -> None:
        while os.getppid() == campaign:
            time.sleep(WATCH)
        os._exit(1)
    threading.Thread(target=watch, daemon=True).start()


@contextlib.contextmanager
def _workers(jobs: int, dask: str) -> Iterator[None]:
    """Let joblib use that many processes, or the workers of a Dask scheduler."""
    if not dask:
        with parallel_config(backend='loky', n_jobs=jobs, inner_max_num_threads=1):
            yield
        return
    try:   # slow, and few have a cluster
        from distributed import CancelledError, Client, KilledWorker
    except ModuleNotFoundError:
        raise CampaignError('--dask needs the Python package distributed, which is not '
                            'installed; pip install distributed') from None
    try:
        with Client(dask, timeout=CONNECTION) as client:
            _check(client.run(sources), dask)
            with parallel_config(backend='dask'):
                yield
    except (CancelledError, KilledWorker, OSError, ValueError) as error:
        raise CampaignError(f'the Dask scheduler at {dask} does not answer or lost its workers: '
                            f'{type(error).__name__} {error}; {GO_ON}') from None


def _check(found: dict[str, str], dask: str) -> None:
    """Raise CampaignError where workers are missing or would play by other rules."""
    if not found:
        raise CampaignError(f'the Dask scheduler at {dask} has no workers')
    other = [worker for worker, digest in found.items() if digest != sources()]
    if other:
        raise CampaignError(f'the Dask workers {", ".join(other)} have another dp_swing_ros; '
                            'install this one there')
