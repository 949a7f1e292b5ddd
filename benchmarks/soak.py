# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A soak: plant and mpc as processes in real time, watched for as long as is asked.

Beside them runs an echo (echo.py), which only answers each state at once: the time that takes is
what machine and middleware add to any mpc. What is measured:

Latency of both, from the publication of a state to that of its answer by the publishers' own
times, so that the watching process does not count. A force that is ready early waits in real
time, and that counts, too. The mpc's p99 should be within the sum of those of echo and solve and
1 ms.

States that were answered before the next came, late, or never. A late answer is late by itself
unless the machine was to blame: the state was late itself, or the echo, within a period of it,
took so much longer than its median that the answer would have been in time without that. A stall
between two states, which no echo sees, counts against the mpc. The mpc answers the newest state:
where a tick takes longer than a period, as it may at 500 Hz, those in between stay unanswered.

Ticks without a solve, and those that the plant skipped; memory once a second, and its growth;
processor time; forces that were not finite or beyond the limit; and falls of the pendulum since
it has swung up, the largest angle, and the time out of 0.2 rad.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
import math
import os
from pathlib import Path
import time
from types import MappingProxyType
from typing import Any

import echo
import numpy as np
from resources import burning, Resources, Usage
from tqdm import tqdm
from watcher import Forces, Watcher

from dp_swing_ros.control import controllers
from dp_swing_ros.evaluation.metrics import quantile, WITHOUT_SOLVE
from dp_swing_ros.learning.trials import OUT
from dp_swing_ros.messages.fields import BILLION
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.tools.demo import SILENCE
from dp_swing_ros.tools.processes import await_ready, Crew, Process, ProcessError

QUANTILES = {'p50': 0.5, 'p99': 0.99, 'p99.9': 0.999, 'max': 1.0}
ALLOWED = 1e-3      # [s] beyond what the echo and a solve take, for the mpc around a solve
FALLEN = math.pi / 2
HOLD = 1.0          # [s] within OUT: swung up
PAUSE = 0.02        # [s] between two looks at what has come
SAMPLE = 1.0        # [s] between two looks at memory and processor time
SETTLE = 0.2        # [s] for the last messages to come


@dataclass(frozen=True)
class Soak:
    """
    What a soak measured, from the first state that the mpc answered on.

    Shapes, N states and M ticks of the mpc with a solve: t (N,) [s] when the states were
    published, latency and echo (N,) [s] until mpc and echo answered, NaN where they did not,
    deviation (N,) [rad], the largest error of an angle, solve_time (M,) [s].
    """

    solver: str
    period: float               # [s] of the plant
    t: Array
    latency: Array
    echo: Array
    deviation: Array
    solve_time: Array
    statuses: Mapping[str, int]   # ticks of the mpc, by how their solve ended
    late_total: int             # ticks whose solve took longer than a period, as the mpc counts
    skipped_ticks: int          # of the plant
    forces: Forces
    missed: int                 # messages that the watching node did not hear
    usage: Mapping[str, Usage]  # by the name of the process
    failure: str = ''           # why it ended early, if it did

    @property
    def until_next(self) -> Array:
        """Return the time from each state to the next (N,) [s], from the last a period."""
        return np.append(np.diff(self.t), self.period) if len(self.t) else self.t

    @property
    def late(self) -> Array:
        """Return which states (N,) were answered after the next one came."""
        return self.latency > self.until_next

    @property
    def late_by_itself(self) -> Array:
        """
        Return which late answers (N,) the machine did not cause.

        It did where, within a period, the echo took so much longer than its median that without
        that the answer had been in time; and where the state was late, so that the next came
        sooner than a period after it.
        """
        if not self.late.any():
            return self.late
        echo = np.where(np.isnan(self.echo), math.inf, self.echo)   # without an answer
        slowest = np.max([echo, np.append(echo[1:], 0.0), np.append(0.0, echo[:-1])], axis=0)
        lost = slowest - quantile(self.echo, 0.5)
        return self.late & (self.latency - lost > np.maximum(self.until_next, self.period))

    @property
    def swung_up(self) -> float:
        """Return the time [s] since which the angles first stayed within OUT, NaN if never."""
        changes = np.flatnonzero(np.diff(self.deviation <= OUT, prepend=False, append=False))
        return next((float(self.t[begin]) for begin, end in zip(changes[::2], changes[1::2])
                     if self.t[end - 1] - self.t[begin] >= HOLD), math.nan)

    @property
    def held(self) -> Array:
        """Return the deviations since it has swung up."""
        return self.deviation[self.t >= self.swung_up]   # of NaN none is

    @property
    def falls(self) -> int:
        """Return how often it fell, to beyond FALLEN."""
        return int(np.count_nonzero(np.diff((self.held > FALLEN).astype(int)) > 0))

    @property
    def success(self) -> bool:
        """Return whether it stayed up, every force was in its limits and no process failed."""
        return bool(not self.failure and len(self.held) and self.falls == 0
                    and self.held[-1] <= OUT and self.forces.not_finite == 0
                    and self.forces.beyond_limit == 0)

    @property
    def bound(self) -> float:
        """Return what the p99 of the latency should stay below [s]: echo, solve and ALLOWED."""
        return quantile(self.echo, 0.99) + quantile(self.solve_time, 0.99) + ALLOWED


def soak(folder: Path, solver: str, duration: float, rate: float = 20.0, seed: int = 0,
         burn: int = 0, thread_priority: int = 0,
         beside: Mapping[str, int] = MappingProxyType({}),
         told: Mapping[str, Any] = MappingProxyType({}),
         of_plant: Mapping[str, Any] = MappingProxyType({})) -> Soak:
    """
    Watch a plant and an mpc for a time [s], and return what was found; the logs are in the folder.

    rate [Hz] is that of the states; burn is the number of busy processes beside them; beside are
    the numbers of other processes to watch, by name; told are parameters of mpc and plant,
    of_plant of the plant alone. A process that fails ends a soak early, and leaves what there is.
    Raises ProcessError where one does not come up.
    """
    shared = {'seed': seed, 'thread_priority': thread_priority, **told}
    values = controllers.MPC.complete({'solver': solver, **shared})
    folder.mkdir()
    with burning(burn), Crew() as crew, Watcher(
            controllers.cost(values).x_r, values['force_limit']) as watcher:
        echoing = crew.start('echo', {'thread_priority': thread_priority}, folder / 'echo.log',
                             script=Path(echo.__file__))
        mpc = crew.start('mpc', {'solver': solver, **shared}, folder / 'mpc.log')
        await_ready([echoing, mpc], lambda: {'echo', 'mpc'} - watcher.listeners(), time.sleep)
        plant = crew.start('plant', {**shared, **of_plant, 'duration': duration, 'rate': rate,
                                     'lockstep': False}, folder / 'plant.log')
        await_ready([plant], lambda: set() if watcher.take() else {'plant'}, time.sleep)
        resources = Resources({**{each.name: each.pid for each in (plant, mpc, echoing)},
                               'watcher': os.getpid(), **beside})
        failure = ''
        try:
            _follow(watcher, resources, plant, [mpc, echoing], duration, folder)
            for process in (mpc, echoing):
                process.end()   # the mpc sends a last zero
            time.sleep(SETTLE)
        except ProcessError as error:
            failure = str(error)
        watcher.take()
    return _found(watcher, solver, 1 / rate, resources.usage(), failure)


def _follow(watcher: Watcher, resources: Resources, plant: Process, others: Sequence[Process],
            duration: float, folder: Path) -> None:
    """Watch until the plant ends itself; raises ProcessError."""
    sampled = -math.inf
    with tqdm(total=duration, bar_format='{n:5.0f}/{total:g} s |{bar}| {desc}',
              disable=None) as bar:
        while plant.running:
            time.sleep(PAUSE)
            watcher.take()
            now = time.monotonic()
            if now - sampled < SAMPLE:
                continue
            sampled = now
            for process in others:
                process.check()
            if now - watcher.heard > SILENCE:
                raise ProcessError(f'no state for {SILENCE:g} s; the logs are in {folder}')
            if watcher.elapsed < duration - PAUSE:   # then it lets its memory go
                resources.sample(watcher.elapsed)
            bar.set_description_str(in_words(watcher), refresh=False)
            bar.update(min(watcher.elapsed, duration) - bar.n)
        plant.finish()


def in_words(watcher: Watcher) -> str:
    """Return what was heard last for a line of progress."""
    solved = f'solve {1e3 * watcher.solve_time[-1]:.2f} ms  ' if watcher.solve_time else ''
    return (f'|θ| {watcher.deviation[-1]:.3f} rad  {solved}late {watcher.late_total}  '
            f'skipped {watcher.skipped_ticks}')


def _found(watcher: Watcher, solver: str, period: float, usage: Mapping[str, Usage],
           failure: str) -> Soak:
    """Return what was heard of a solver, with the period of the plant [s]."""
    sent = np.array(watcher.sent)
    # the force itself is sent before its stamped copy, by up to some milliseconds
    forces = before(np.array(watcher.answers), np.array(watcher.commands))
    latency = match(np.array(watcher.stamps), sent, np.array(watcher.answered), forces)
    # as the echo divided, which NumPy would round in another way
    seconds = np.array([stamp / BILLION for stamp in watcher.stamps])
    echoed = match(seconds, sent, np.array(watcher.echoed), np.array(watcher.echoes))
    known = np.flatnonzero(np.isfinite(latency))
    begin = known[0] if len(known) else 0   # before, plant and mpc got to know each other
    return Soak(
        solver, period, (sent[begin:] - sent[:1]) / BILLION, latency[begin:], echoed[begin:],
        np.array(watcher.deviation)[begin:], np.array(watcher.solve_time), watcher.statuses,
        watcher.late_total, watcher.skipped_ticks, watcher.forces, watcher.missed, usage, failure)


def match(stamps: Array, sent: Array, answered: Array, answers: Array) -> Array:
    """
    Return how long after each state its first answer was sent [s], NaN where none was.

    Shapes: of states stamps and times of sending (N,) [ns], of answers the stamps that they
    answer and times of sending (M,) [ns] -> (N,).
    """
    latency = np.full(len(stamps), math.nan)
    if len(answered):
        known, first = np.unique(answered, return_index=True)
        place = np.minimum(np.searchsorted(known, stamps), len(known) - 1)
        found = known[place] == stamps
        latency[found] = (answers[first[place[found]]] - sent[found]) / 1e9
    return latency


def before(times: Array, others: Array) -> Array:
    """
    Return the last of the other times before each, or itself where there is none.

    Shapes: times (N,), others (M,), in order -> (N,).
    """
    place = np.searchsorted(others, times, side='right') - 1
    found = times.copy()
    found[place >= 0] = others[place[place >= 0]]
    return found


def quantiles(times: Array) -> dict[str, float]:
    """Return count and quantiles [ms] of times [s]; those that are NaN do not count."""
    known = times[np.isfinite(times)]
    return {'count': len(known),
            **{name: 1e3 * quantile(known, share) for name, share in QUANTILES.items()}}


def times(soak: Soak) -> dict[str, dict[str, float]]:
    """Return the quantiles [ms] of all that was timed, by its name."""
    return {'mpc, state to force': quantiles(soak.latency),
            'echo, state to answer': quantiles(soak.echo),
            'mpc, solve': quantiles(soak.solve_time)}


def answers(soak: Soak) -> dict[str, dict[str, float]]:
    """Return how many states mpc and echo answered, and when, by who it is."""
    return {name: {'states': len(soak.t),
                   'answered in time': int(np.sum(times <= soak.until_next)),
                   'late': int(np.sum(times > soak.until_next)),
                   'late by itself': by_itself,
                   'unanswered': int(np.sum(np.isnan(times)))}
            for name, times, by_itself in (
                ('mpc', soak.latency, int(soak.late_by_itself.sum())),
                ('echo', soak.echo, math.nan))}


def ticks(soak: Soak) -> dict[str, float]:
    """Return what became of the ticks of mpc and plant."""
    return {'of the mpc': sum(soak.statuses.values()),
            'without a solve': sum(soak.statuses.get(name, 0) for name in WITHOUT_SOLVE),
            'longer than a period': soak.late_total,
            'skipped by the plant': soak.skipped_ticks,
            'messages not heard': soak.missed}


def pendulum(soak: Soak) -> dict[str, float]:
    """Return how the pendulum was held since it has swung up."""
    held, last = soak.held, len(soak.t) - len(soak.held)
    return {'up after [s]': soak.swung_up,
            'largest angle since [rad]': float(held.max()) if len(held) else math.nan,
            f'out of {OUT:g} rad [s]': float(soak.until_next[last:][held > OUT].sum())
            if len(held) else math.nan, 'falls': soak.falls}


def processes(soak: Soak) -> dict[str, dict[str, float]]:
    """Return by the name of a process: its share of a processor, and memory [MB]."""
    found = {}
    for name, usage in soak.usage.items():
        resident, private = (float(each[-1]) / 1e6 if len(each) else math.nan
                             for each in (usage.resident, usage.private))
        found[name] = {'processor [%]': 100 * usage.share, 'resident [MB]': resident,
                       'private [MB]': private, 'growth [MB]': usage.growth / 1e6}
    return found


def summary(soak: Soak) -> dict[str, Any]:
    """Return all figures of a soak by their names."""
    return {'success': soak.success, 'failure': soak.failure, 'times [ms]': times(soak),
            'bound of p99 [ms]': 1e3 * soak.bound, 'answers': answers(soak),
            'ticks': ticks(soak), 'statuses': dict(soak.statuses),
            'forces': soak.forces._asdict(), 'pendulum': pendulum(soak),
            'processes': processes(soak)}
