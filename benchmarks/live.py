# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What is asked of the running system, and what the pages of it have measured, on one page.

Run by `make results`; it measures nothing itself, and what no page has measured is not there.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
import json
from pathlib import Path
from typing import NamedTuple

import live_faults
import live_soak
import numpy as np
import pandas as pd
from stamp import made, sources, TOP, verdict

from dp_swing_ros.evaluation.campaign.report import share
from dp_swing_ros.evaluation.campaign.rows import grouped, read
from dp_swing_ros.evaluation.comparison import median, rate
from dp_swing_ros.tables import compact

HELD = 0.99       # of the starts of a way
STAYS = 0.2       # [rad] of an angle through all changes
# another plant, so no figure to be compared with those of this one
PUBLISHED = 'a published plant, another one: 4.0 to 4.4 s, 12 of 12 (Lee, Ju and Lee, Machines ' \
    '13(3):186, 2025)'


class Line(NamedTuple):
    """An aim, and what became of it."""

    aim: str
    measured: str
    is_met: bool


def of_transitions(results: Path) -> Iterator[Line]:
    """Yield what became of the twelve ways in lockstep."""
    rows = read(results / 'transitions.csv.gz')
    for solver, of in grouped(rows, lambda row: row.key.contestant).items():
        ways = grouped(of, lambda row: row.key.parameter)
        shares = [sum(row.metrics.success for row in way) / len(way) for way in ways.values()]
        held = np.array([row.metrics.settling_time for row in of if row.metrics.success])
        yield Line(f'`{solver}`: each of {len(ways)} ways between the equilibria, '
                   f'{100 * HELD:g} % of the seeds held; {PUBLISHED}',
                   f'{share(rate([row.metrics.success for row in of]))} in all, '
                   f'{100 * min(shares):g} % of the worst way; median settling '
                   f'{median(held).value:.2f} s, simulated', min(shares) >= HELD)


def of_changes(results: Path) -> Iterator[Line]:
    """Yield what became of live changes, and of the tour by them."""
    for row in pd.read_csv(results / 'live_changes.csv.gz').itertuples():
        yield Line(f'`{row.solver}` first, {row.asked} changes and as many switches of the solver '
                   f'while it balances: within {STAYS:g} rad, no late tick; {row.asked} wrong '
                   'ones refused',
                   f'{row.changes}, {row.switches} and {row.refused}; {row.largest:.3f} rad, late '
                   f'ticks {row.late}',
                   row.changes == row.switches == row.refused == row.asked
                   and row.largest < STAYS and row.late == 0)
    for solver, of in pd.read_csv(results / 'live_tour.csv.gz').groupby('solver', sort=False):
        held = int(of.settled.notna().sum())
        yield Line(f'`{solver}`: all ways in real time, by live changes of `goal`',
                   f'{held} of {len(of)}, {of.settled.min():.1f} to {of.settled.max():.1f} s, '
                   f'late ticks {of.late.max()}', held == len(of))


def of_rates(results: Path) -> Iterator[Line]:
    """Yield how long answers took, and how many came before the next state."""
    rows = pd.read_csv(results / 'live_rates.csv.gz', keep_default_na=False)
    for row in rows[rows.part == 'long'].itertuples():
        yield Line(f'`{row.solver}`, 20 Hz for {row.duration:g} s: no late tick; state to force '
                   f"p99 at most the echo's, the solve's and 1 ms ({row.bound:.1f} ms)",
                   f'late ticks {row.late_total}; p99 {row.mpc_p99:.1f} ms',
                   row.late_total == 0 and row.mpc_p99 <= row.bound)
    for row in rows[rows.part == 'fast'].itertuples():
        part = row.in_time / row.states
        priority = f' with a real-time priority of {row.thread_priority}' \
            if row.thread_priority else ''
        yield Line(f'`{row.solver}`, {row.rate:g} Hz for {row.duration:g} s{priority}: 99 % of '
                   'the states answered before the next',
                   f'{100 * part:.1f} % (the bare echo {100 * row.echo_in_time / row.states:.1f} '
                   '%)', part >= 0.99)


def of_busy(results: Path) -> Iterator[Line]:
    """Yield what became of it on busy cores."""
    rows = pd.read_csv(results / 'live_busy.csv.gz', keep_default_na=False)
    for solver, of in rows[rows.part == 'busy'].groupby('solver', sort=False):
        yield Line(f'`{solver}`, all cores kept busy by others, {of.duration.max():g} s: up to '
                   'the end in all runs', share(rate(of.success.tolist())),
                   bool(of.success.all()))


def of_faults(results: Path) -> Iterator[Line]:
    """Yield how soon it was up again after faults."""
    rows = pd.read_csv(results / 'live_faults.csv.gz')
    for fault, of in rows.groupby('fault', sort=False):
        in_time = of.again <= live_faults.ALLOWED
        bad = int(of.not_finite.sum() + of.beyond.sum())
        yield Line(f'{fault}, all solvers: up again within {live_faults.ALLOWED:g} s; no force '
                   'beyond the limit or not finite',
                   f'{share(rate(in_time.tolist()))}, {of.again.max():.1f} s at the longest; '
                   f'such forces: {bad}', bool(in_time.all() and bad == 0))


def of_soak(results: Path) -> Iterator[Line]:
    """Yield what became of the long run."""
    of = json.loads((results / 'live_soak.json').read_text(encoding='utf-8'))
    grown = max(of['processes'][name]['growth [MB]'] for name in ('plant', 'mpc'))
    late = of['answers']['mpc']['late by itself']
    yield Line(f'`{live_soak.SOLVER}` for an hour: memory of plant and mpc grows by less than '
               f'{live_soak.GROWTH:g} MB after the first minute; no tick late that the machine '
               'did not cause', f'{grown:+.2f} MB, {late} late',
               grown < live_soak.GROWTH and late == 0)


PARTS: dict[str, Callable[[Path], Iterator[Line]]] = {
    'transitions': of_transitions, 'live_changes': of_changes, 'live_rates': of_rates,
    'live_busy': of_busy, 'live_faults': of_faults, 'live_soak': of_soak}


def page(results: Path, made: str) -> str:
    """Return the page as Markdown, from the pages that there are."""
    parts = [f'## [{name}]({name}.md)\n\n`make results PAGES={name}`\n\n' + compact([
        ('aim', 'measured', ''),
        *((line.aim, line.measured, verdict(line.is_met))
          for line in of(results))]) + '\n'
        for name, of in PARTS.items() if (results / f'{name}.md').exists()]
    return '\n'.join(['# Live: aims and figures\n', made,
                      'What is asked of the running system, and what the pages behind the '
                      'headings measured; each says where and at which commit.\n', *parts])


def main(argv: Sequence[str] | None = None) -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--docs', type=Path, default=TOP / 'docs')
    results = parser.parse_args(argv).docs / 'results'
    text = page(TOP / 'docs' / 'results', made('live', sources('live')))
    results.mkdir(parents=True, exist_ok=True)
    (results / 'live.md').write_text(text, encoding='utf-8')


if __name__ == '__main__':
    main()
