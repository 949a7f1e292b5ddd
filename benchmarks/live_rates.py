# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Plant and mpc in real time beside a bare echo: long, fast, on busy cores, with shadows.

Run by `make results`, on a machine that must do nothing else.
"""

import argparse
from collections.abc import Iterator, Sequence
import os
from pathlib import Path
import tempfile
from typing import Any, NamedTuple

from campaigns import METHODS
import pandas as pd
from stamp import made, sources_with, store_table, TOP
import yaml

from dp_swing_ros.evaluation.campaign.report import share
from dp_swing_ros.evaluation.comparison import rate
from dp_swing_ros.evaluation.soak import answers, OUT, pendulum, processes, Soak, times
from dp_swing_ros.tables import compact
from dp_swing_ros.tools.processes import isolated
from dp_swing_ros.tools.soak import soak

FILES = ('live_rates.py', 'campaigns.py')
LONG = 600.0      # [s] at 20 Hz
RATES = (20.0, 100.0, 200.0, 300.0, 400.0, 500.0)   # [Hz]
SHORT = 20.0      # [s] at each
FAST, FASTEST = 'ddp', 500.0    # who is to keep up at which rate [Hz], for BUSY
BUSY = 60.0       # [s] on busy cores, and with shadows
RUNS = 10         # on busy cores
PAIRS = 3         # with and without shadows


class Run(NamedTuple):
    """A soak that is to be done."""

    part: str
    solver: str
    duration: float   # [s]
    rate: float       # [Hz]
    burn: int = 0     # busy processes
    shadow: tuple[str, ...] = ()
    seed: int = 0


def runs(long: float = LONG) -> Iterator[Run]:
    """Yield all that are done."""
    for solver in METHODS:
        yield Run('long', solver, long, 20.0)
    yield Run('fast', FAST, BUSY, FASTEST)
    for solver in METHODS:
        for each in RATES:
            yield Run('rates', solver, SHORT, each)
    for solver in METHODS:
        for seed in range(RUNS):
            yield Run('busy', solver, BUSY, 20.0, os.cpu_count() or 1, seed=seed)
    for solver in METHODS:
        others = tuple(other for other in METHODS if other != solver)
        for seed in range(PAIRS):
            yield Run('shadow', solver, BUSY, 20.0, shadow=others, seed=seed)
            yield Run('shadow', solver, BUSY, 20.0, seed=seed)


def play(run: Run, folder: Path) -> dict[str, Any]:
    """Do a run, and return its figures; raises ProcessError where a process does not come up."""
    folder.mkdir()
    file = folder / 'shadow.yaml'
    file.write_text(yaml.safe_dump(
        {'mpc': {'ros__parameters': {'shadow': list(run.shadow) or ['']}}}))
    found = soak(folder / 'soak', run.solver, run.duration, run.rate, params=[file],
                 seed=run.seed, burn=run.burn)
    return {**run._asdict(), 'shadow': ' '.join(run.shadow), **figures(found)}


def figures(found: Soak) -> dict[str, Any]:
    """Return the figures of a soak by the names of columns."""
    timed, answered, used = times(found), answers(found)['mpc'], processes(found)
    mpc, echo, solve = timed.values()
    return {
        'failure': found.failure, 'success': found.success, 'states': answered['states'],
        'in_time': answered['answered in time'], 'late': answered['late'],
        'late_by_itself': answered['late by itself'], 'unanswered': answered['unanswered'],
        'late_total': found.late_total, 'skipped': found.skipped_ticks,
        **{f'{of}_{name}': values[name] for of, values in (
            ('mpc', mpc), ('echo', echo), ('solve', solve)) for name in ('p50', 'p99', 'max')},
        'bound': 1e3 * found.bound, 'not_finite': found.forces.not_finite,
        'beyond': found.forces.beyond_limit, 'largest': float(found.held.max())
        if len(found.held) else float('nan'), 'out': pendulum(found)[f'out of {OUT:g} rad [s]'],
        **{f'{name}_share': used[name]['processor [%]'] for name in ('mpc', 'plant', 'echo')},
        'growth': used['mpc']['growth [MB]']}


def page(rows: pd.DataFrame, made: str) -> str:
    """Return the page as Markdown."""
    def of(part: str) -> pd.DataFrame:
        return rows[rows.part == part]

    def answered(frame: pd.DataFrame) -> str:
        return f'{100 * frame.in_time.sum() / max(frame.states.sum(), 1):.2f} %'
    long = [(f'`{row.solver}`', f'{row.duration:g}', str(row.states), str(row.late_total),
             f'{row.late}, {row.late_by_itself}', str(row.unanswered), f'{row.mpc_p50:.2f}',
             f'{row.mpc_p99:.2f}', f'{row.echo_p99:.2f}', f'{row.solve_p99:.2f}',
             f'{row.bound:.2f}: {"met" if row.mpc_p99 <= row.bound else "**missed**"}')
            for row in of('long').itertuples()]
    fast = [(f'`{solver}`', f'{frequency:g}', answered(frame), f'{frame.mpc_p50.iloc[0]:.2f}',
             f'{frame.mpc_p99.iloc[0]:.2f}', f'{frame.mpc_share.iloc[0]:.0f}',
             f'{frame.plant_share.iloc[0]:.0f}', f'{frame.echo_share.iloc[0]:.0f}')
            for (solver, frequency), frame in rows[rows.part.isin(['rates', 'fast'])].groupby(
                ['solver', 'rate'], sort=False)]
    busy = [(f'`{solver}`', share(rate(frame.success.tolist())), str(frame.late_total.sum()),
             answered(frame), f'{frame.mpc_p99.max():.1f}', f'{frame.largest.max():.2f}')
            for solver, frame in of('busy').groupby('solver', sort=False)]
    shadows = [(f'`{solver}`', shadow.replace(' ', ', ') or 'none', str(frame.late_total.sum()),
                answered(frame), f'{frame.mpc_p50.median():.2f}', f'{frame.mpc_p99.median():.2f}')
               for (solver, shadow), frame in of('shadow').groupby(
                   ['solver', 'shadow'], sort=False)]
    return '\n'.join([
        '# Rates and latencies\n', made,
        'Each line is of [soaks](../nodes.md#soak): plant and mpc as processes in real time, with '
        'their defaults, beside a bare echo. State to force is from the publication of a state to '
        'that of its force; late are answers after the next state, and of these those by itself '
        'that the machine did not cause, as the echo tells. The rows: '
        '[live_rates.csv.gz](live_rates.csv.gz).\n',
        '## Long, at 20 Hz\n',
        compact([('solver', 'time [s]', 'states', 'late ticks', 'late, by itself', 'unanswered',
                  'state to force p50 [ms]', 'p99', 'echo p99', 'solve p99',
                  'echo p99 + solve p99 + 1 ms'), *long]), '',
        '## Fast\n',
        f'{SHORT:g} s each, but for `{FAST}` at {FASTEST:g} Hz {BUSY:g} s more. Processor in '
        'hundredths of one core.\n',
        compact([('solver', 'rate [Hz]', 'answered before the next', 'state to force p50 [ms]',
                  'p99', 'mpc [%]', 'plant [%]', 'echo [%]'), *fast]), '',
        '## Busy cores\n',
        f'{BUSY:g} s beside as many busy processes as there are cores, {RUNS} runs each.\n',
        compact([('solver', 'up to the end', 'late ticks', 'answered before the next',
                  'worst state to force p99 [ms]', 'largest angle once up [rad]'), *busy]), '',
        '## With shadows\n',
        f'{BUSY:g} s, {PAIRS} runs each; medians of the runs.\n',
        compact([('solver', 'in its shadow', 'late ticks', 'answered before the next',
                  'state to force p50 [ms]', 'p99'), *shadows]), ''])


def main(argv: Sequence[str] | None = None) -> None:
    """Do all runs, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--long', type=float, default=LONG, help='time of a long run [s]')
    parser.add_argument('--parts', nargs='+', default=['long', 'fast', 'rates', 'busy', 'shadow'])
    parser.add_argument('--docs', type=Path, default=TOP / 'docs')
    arguments = parser.parse_args(argv)
    results = arguments.docs / 'results'
    results.mkdir(parents=True, exist_ok=True)
    found = []
    with tempfile.TemporaryDirectory() as folder:
        for n, run in enumerate(runs(arguments.long)):
            if run.part in arguments.parts:
                print(run, flush=True)
                with isolated():
                    found.append(play(run, Path(folder, str(n))))
    rows = pd.DataFrame(found)
    store_table(rows, results / 'live_rates.csv.gz')
    (results / 'live_rates.md').write_text(
        page(rows, made('live_rates', sources_with(*FILES))), encoding='utf-8')


if __name__ == '__main__':
    main()
