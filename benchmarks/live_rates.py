# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Plant and mpc in real time beside a bare echo, as fast as they can.

Run by `make results`, on a machine that must do nothing else.
"""

import argparse
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
import tempfile
from typing import Any, NamedTuple

from campaigns import METHODS
import pandas as pd
from sizes import LAB_RIG, two
from soak import answers, pendulum, processes, Soak, soak, times
from stamp import made, sources, store_page, TOP

from dp_swing_ros.learning.trials import OUT
from dp_swing_ros.tables import compact
from dp_swing_ros.tools.processes import isolated

RATES = (100.0, 200.0, 300.0, 400.0)   # [Hz]
LONG = 10.0       # [s] at each
FASTEST = 500.0   # [Hz]
OF_RIG = (50.0, 100.0, 200.0)   # [Hz]
SHORT = 6.0       # [s] of a run from hanging
PRIORITY = 50     # of real time, where they have one
KEPT_UP = 0.95    # of the states are answered before the next: a rate that is held
ABOUT = (
    'Each line is of [soaks](../../benchmarks/soak.py): plant and mpc as processes in real time, '
    'with their defaults, beside a bare echo. State to force is from the publication of a state '
    'to that of its force; late are answers after the next state, and of these those by itself '
    'that the machine did not cause, as the echo tells. Rows: `results/{0}.csv.gz`.\n')


class Run(NamedTuple):
    """A soak that is to be done."""

    part: str
    solver: str
    duration: float   # [s]
    rate: float = 20.0       # [Hz]
    burn: int = 0     # busy processes
    seed: int = 0
    thread_priority: int = 0
    bodies: str = '1 m'   # of BODIES


class Bodies(NamedTuple):
    """A pendulum by what plant and mpc are told, and the plant alone."""

    told: Mapping[str, Any] = {}
    of_plant: Mapping[str, Any] = {}


SMALL, LAB = '0.2 m', 'config/lab_rig.yaml'
BODIES = {'1 m': Bodies(), SMALL: Bodies(two(0.2, 0.2)), LAB: Bodies(LAB_RIG.mpc, LAB_RIG.plant)}


def runs() -> Iterator[Run]:
    """Yield all that are done."""
    for solver in METHODS:
        for each in RATES:
            yield Run('rates', solver, LONG, each, bodies=SMALL)
        for priority, count in ((0, 5), (PRIORITY, 3)):
            for seed in range(count):
                yield Run('fast', solver, SHORT, FASTEST, 0, seed, priority, SMALL)
        for each in OF_RIG:
            for seed in range(3):
                yield Run('rig', solver, SHORT, each, seed=seed, bodies=LAB)


def play(run: Run, folder: Path) -> dict[str, Any]:
    """Do a run, and return its figures; raises ProcessError where a process does not come up."""
    found = soak(folder, run.solver, run.duration, run.rate, seed=run.seed, burn=run.burn,
                 thread_priority=run.thread_priority, **BODIES[run.bodies]._asdict())
    return {**run._asdict(), **figures(found)}


def figures(found: Soak) -> dict[str, Any]:
    """Return the figures of a soak by the names of columns."""
    timed, used = times(found), processes(found)
    answered, echoed = answers(found)['mpc'], answers(found)['echo']
    mpc, echo, solve = timed.values()
    return {
        'failure': found.failure, 'success': found.success, 'states': answered['states'],
        'in_time': answered['answered in time'], 'late': answered['late'],
        'late_by_itself': answered['late by itself'], 'unanswered': answered['unanswered'],
        'echo_in_time': echoed['answered in time'],
        'late_total': found.late_total, 'skipped': found.skipped_ticks,
        **{f'{of}_{name}': values[name] for of, values in (
            ('mpc', mpc), ('echo', echo), ('solve', solve)) for name in ('p50', 'p99', 'max')},
        'bound': 1e3 * found.bound, 'not_finite': found.forces.not_finite,
        'beyond': found.forces.beyond_limit, 'largest': float(found.held.max())
        if len(found.held) else float('nan'), 'out': pendulum(found)[f'out of {OUT:g} rad [s]'],
        **{f'{name}_share': used[name]['processor [%]'] for name in ('mpc', 'plant', 'echo')},
        'growth': used['mpc']['growth [MB]']}


def played(what: Iterable[Run]) -> pd.DataFrame:
    """Do runs, one after the other, and return a row of each; raises ProcessError."""
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for n, run in enumerate(what):
            print(run, flush=True)
            with isolated():
                found.append(play(run, Path(folder, str(n))))
    return pd.DataFrame(found)


def answered(rows: pd.DataFrame) -> str:
    """Return the share of the states that were answered before the next."""
    return f'{100 * rows.in_time.sum() / max(rows.states.sum(), 1):.2f} %'


def prioritised(priority: int) -> str:
    """Return a real-time priority as the tables have it."""
    return f'{priority}' if priority else 'none'


def of_rates(rows: pd.DataFrame) -> str:
    """Return the table of the rates: of several runs the median p50, and the largest p99."""
    return compact([
        ('solver', 'rate [Hz]', 'priority', 'up to the end', 'answered before the next',
         'echo, too', 'state to force p50 [ms]', 'p99', 'mpc [%]', 'plant [%]', 'echo [%]'),
        *((f'`{solver}`', f'{rate:g}', prioritised(priority), f'{of.success.sum()} of {len(of)}',
           answered(of), f'{100 * of.echo_in_time.sum() / max(of.states.sum(), 1):.2f} %',
           f'{of.mpc_p50.median():.2f}', f'{of.mpc_p99.max():.2f}', f'{of.mpc_share.mean():.0f}',
           f'{of.plant_share.mean():.0f}', f'{of.echo_share.mean():.0f}')
          for (solver, rate, priority), of in rows.groupby(
              ['solver', 'rate', 'thread_priority'], sort=False))])


def held(rows: pd.DataFrame) -> str:
    """Return the highest rate that each solver holds, as a sentence."""
    counted = rows.groupby(['solver', 'rate'], sort=False)[['in_time', 'states']].sum()
    kept = counted.in_time >= KEPT_UP * counted.states
    highest = {solver: max((rate for rate in rows.rate if kept.get((solver, rate))), default=None)
               for solver in rows.solver.unique()}
    return (f'The highest of these rates at which {100 * KEPT_UP:g} % of the states are answered '
            'before the next, without a priority: ' + ', '.join(
                f'`{solver}` {"none" if rate is None else f"{rate:g} Hz"}'
                for solver, rate in highest.items()) + '.')


def page(rows: pd.DataFrame, made: str) -> str:
    """Return the page as Markdown."""
    of = dict(list(rows.groupby('part')))
    small = pd.concat([of['rates'], of['fast'].sort_values('thread_priority', kind='stable')])
    return '\n'.join([
        '# Rates and latencies\n', made, ABOUT.format('live_rates'),
        f'Links of {SMALL}, of which nothing but the length is told: {LONG:g} s at each rate, at '
        f'{FASTEST:g} Hz {SHORT:g} s from hanging with each seed; some with [a real-time priority]'
        '(../nodes.md#time) of plant, mpc and echo. Of several runs p50 is the median, p99 the '
        'largest. Processor in hundredths of one core.\n',
        of_rates(small), '', held(small[small.thread_priority == 0]), '',
        f'The rig of laboratory size of `{LAB}`, {SHORT:g} s from hanging with each seed:\n',
        of_rates(of['rig']), ''])


def main(argv: Sequence[str] | None = None) -> None:
    """Do all runs, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--docs', type=Path, default=TOP / 'results')
    arguments = parser.parse_args(argv)
    rows = played(runs())
    store_page('live_rates', rows, page(rows, made('live_rates', sources('live_rates'))),
               arguments.docs)


if __name__ == '__main__':
    main()
