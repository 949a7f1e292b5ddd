# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""README's figures: from what docs/results stores, written between two markers."""

from collections.abc import Sequence
import json
import math
from pathlib import Path

import benchmark_page
import campaigns
import methods
import numpy as np
import stamp

from dp_swing_ros.evaluation.campaign.report import number, share, SHOWN
from dp_swing_ros.evaluation.campaign.rows import read, Row, solves
from dp_swing_ros.evaluation.campaign.summary import summarise
from dp_swing_ros.evaluation.comparison import rate, Ratio
from dp_swing_ros.tables import compact

BEGIN, END = '<!-- made by make results -->\n', '<!-- as far as here -->\n'
STORED = ('random', 'robustness', 'real_time', 'paper')
TITLES = {'model': 'bodies 25 % off', 'velocity_noise': 'noisy velocities',
          'force_noise': 'noisy forces', 'response': 'slow or overshooting drive',
          'delay': 'known delay of the states', 'pushes': 'pushes'}   # by the criterion


def write(readme: Path, results: Path) -> None:
    """Write the figures into README, where all of them are stored."""
    missing = [name for name in STORED if not (results / f'{name}.csv.gz').exists()]
    if missing:
        print(f'README.md stays: no rows of {", ".join(missing)} yet')
        return
    text = readme.read_text(encoding='utf-8')
    readme.write_text(replaced(text, block(results)), encoding='utf-8')


def replaced(text: str, new: str) -> str:
    """Return the text with what stands between the markers replaced."""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f'{before}{BEGIN}{new}{END}{after}'


def block(results: Path) -> str:
    """Return what stands between the markers."""
    rows = {name: read(results / f'{name}.csv.gz') for name in STORED}
    parts = [solvers(rows), offsets(rows['random']), costs(rows['random']), robustness(rows),
             paper(rows['paper'])]
    benchmark = json.loads((results / 'benchmark.json').read_text(encoding='utf-8'))
    if 'gradient' in benchmark and 'sampling' in benchmark and 'limit' in benchmark:
        parts.append(peers(benchmark))
    if older := [f'[{page}](docs/results/{page}.md)' for page in (*STORED, 'benchmark')
                 if stamp.is_marked(results / f'{page}.md')]:
        parts.append('Of the pages behind these figures, older than the code that they measure '
                     f'are {", ".join(older)};\nothers say so themselves.')
    return '\n' + '\n\n'.join(parts) + '\n\n'


def solvers(rows: dict[str, list[Row]]) -> str:
    """Return the table of the solvers."""
    return compact([
        ('solver', 'random starts held', 'median settling',
         f'cost over that of `{methods.FIRST}`, median (5-95 %)', 'solve, p99 of 50 ms',
         'real time, from hanging'),
        *((f'`{name}`', *of_solver(rows['random'], name),
           live([row for row in rows['real_time'] if row.key[:2] == (name, 'real_time')]))
          for name in campaigns.METHODS)])


def of_solver(starts: Sequence[Row], name: str) -> tuple[str, ...]:
    """Return what a solver did from random starts."""
    rows = methods.of(starts, name)
    settled = [row.metrics.settling_time for row in rows if row.metrics.success]
    return (share(rate([row.metrics.success for row in rows])), f'{np.median(settled):.2f} s',
            methods.typical(starts, name) if name != methods.FIRST else '1',
            f'{1e3 * np.quantile(solves(rows), 0.99):.1f} ms')


def beside(cost: Ratio) -> str:
    """Return a ratio of costs, and whether an equivalence test shows that it is about one."""
    same = ', equivalent' if cost.same < SHOWN else ''
    return f'{cost.value:.2f} ({cost.low:.2f}-{cost.high:.2f}){same}'


def live(rows: Sequence[Row]) -> str:
    """Return what a solver did in real time."""
    settled = [row.metrics.settling_time for row in rows if row.metrics.success]
    median = f', {np.median(settled):.2f} s' if settled else ''
    return f'{sum(row.metrics.success for row in rows)} of {len(rows)}{median}'


def offsets(rows: Sequence[Row]) -> str:
    """Return what settled leaves open."""
    offset = [row.metrics.settling_offset for row in rows if row.metrics.success]
    return ('Held: both angles within 0.1 rad and all speeds below 1 over the last second of 10, '
            'and no track strike; settled\nwhere that last stay begins. The cart may still be off '
            f'the centre then: {np.median(offset):.2f} m in the median, {max(offset):.2f} m at '
            'most.')


def costs(rows: Sequence[Row]) -> str:
    """Return what the median of the costs hides."""
    lines = []
    for name in campaigns.METHODS[1:]:
        less, more, later = methods.tails(rows, name)
        lines.append(f'* `{name}`: below {1 / methods.APART:g} times in {100 * less:.0f} % of the '
                     f'starts, above {methods.APART:g} times in {100 * more:.0f} %; whichever is '
                     f'dearer settles {later:.2f} s later there (median).\n  Geometric mean '
                     f'{beside(methods.cost(rows, name))}.')
    return ('Cost: that of the closed loop, Σℓ by the default weights, over that of '
            f'`{methods.FIRST}` from the same start. They differ in the tails\n(in brackets the '
            '95 % interval; equivalent: within 5 %, by a test):\n\n' + '\n'.join(lines))


def robustness(rows: dict[str, list[Row]]) -> str:
    """Return the table of who is robust to what, and what is no part of the solvers."""
    shown = {**{name: f'`{name}`' for name in campaigns.METHODS},
             'told': '`ilqr`, told the truth, filter of the state alone',
             'state_alone': '`ilqr`, told nothing, filter of the state alone',
             'no_estimator': '`ilqr`, told nothing, no filter',
             campaigns.BASELINE: 'strongest baseline that does not plan anew: TVLQR about '
                                 'one offline swing-up, our filter'}
    found = {one.contestant: one for one in summary('robustness', rows).scores}
    return ("Robustness is the mean of the leaderboards' six criteria, each the share of levels "
            'at which more than half of the runs\nare held:\n\n' + compact([
                ('', 'robustness', *TITLES.values()),
                *((title, *(number(value, 3) for value in (
                    found[name].robustness,
                    *(found[name].criteria.get(one, math.nan) for one in TITLES))))
                  for name, title in shown.items())]) +
            '\n\nAll know the delay of the states. The truth is that of bodies and drive; of '
            'noise, pushes and a drive that overshoots\nthere is nothing to tell.')


def paper(rows: Sequence[Row]) -> str:
    """Return what the paper's set-up holds, and what it lacks."""
    runs: dict[str, list[bool]] = {}
    for row in rows:
        if row.key.scenario == 'swing-up':
            runs.setdefault(row.key.contestant, []).append(row.metrics.success)

    def held(setup: str, *solvers: str) -> str:
        return ' / '.join(f"{sum(runs[f'{name}, {setup}'])}" for name in solvers)

    every, mppi = campaigns.METHODS, 'paper, fine plant, 20 N, our'
    return (f"The paper's own set-up holds, of {len(runs['mppi, paper'])} starts near hanging "
            f'on an endless track ({" / ".join(every)}): on its authors\'\nEuler plant '
            f'{held("paper", *every)} with a force without a bound (MPPI: 75 N), '
            f'{held("paper, 20 N", *every)} with 20 N;\non a plant of RK4 steps of 50 ms, as the '
            f'model, {held("paper, RK4 plant", *every)} and '
            f'{held("paper, RK4 plant, 20 N", *every)};\non a plant that is integrated finely '
            f'{held("paper, Euler model, fine plant", *every)} and '
            f'{held("paper, Euler model, fine plant, 20 N", *every)}, with RK4 in the model '
            f'{held("paper, fine plant", *every)} and {held("paper, fine plant, 20 N", *every)}.\n'
            'So where the plant is not the model, its iLQR and DDP lack two things: the bound, '
            'and a model better than Euler.\nIts MPPI lacks more: in the last of these it holds '
            f'{held(f"{mppi} sampling and cost", "mppi")} with our sampling and cost, '
            f'{held(f"{mppi} gains and sampling", "mppi")} with our sampling and the gains of '
            'a\nRiccati pass, and '
            f'{held(f"{mppi} gains, sampling and cost", "mppi")} with all three '
            '([the paper anew](docs/paper.md)).')


def peers(results: dict) -> str:
    """Return how we compare with peers: whole solves first, for that is what a tick takes."""
    near, ours = results['gradient'][benchmark_page.NEAR], ('ddp', 'ilqr')
    steps = {kind: ' and '.join(
        f'{benchmark_page.over_crocoddyl(near, name, kind, "C++"):.2g}' for name in ours)
        for kind in ('rk4', 'euler')}
    contests = {start: results['solves'][f'crocoddyl, {start}'] for start in ('cold', 'warm')}
    ratios = {start: [over_whole(contest, name) for name in ours]
              for start, contest in contests.items()}
    whole = {start: ' and '.join(f'{each["value"]:.2g}' for each in of)
             for start, of in ratios.items()}
    pairs = {start: ' and '.join(str(each['starts']) for each in of)
             for start, of in ratios.items()}
    ticks = results['sampling']['1024']['ticks']
    fastest = benchmark_page.fastest(ticks, 'mppi, ')
    compiled, twin = (benchmark_page.over(ticks, fastest, kind) for kind in ('compiled', 'twin'))
    return ('[In one run with its peers](docs/results/benchmark.md), which acados is not among, a '
            f'whole solve of DDP and iLQR to the\nsame cost takes {whole["cold"]} times less time '
            f"than crocoddyl's from cold starts, {whole['warm']} times from warm ones\n(medians "
            f'over the {pairs["cold"]} and the {pairs["warm"]} of 20 from which both get there); '
            f'an iteration {steps["rk4"]} times less\nwith the same RK4 model, {steps["euler"]} '
            f"where theirs takes Euler's steps. An update of MPPI with 1,024 samples takes\n"
            f"{compiled:.0f} (compiled) to {twin:.0f} times less than pytorch_mppi's; the "
            f'rollouts use {100 * results["limit"]["share"]["value"]:.0f} % of the most '
            'multiply-adds a second\nthat were measured on the machine.')


def over_whole(contest: dict, ours: str) -> dict:
    """Return how many times faster we get there than the fastest of crocoddyl's, and how often."""
    return min((row['ratios'][ours] for name, row in contest.items()
                if name.startswith('crocoddyl') and row['ratios'].get(ours)),
               key=lambda ratio: ratio['value'])


def summary(name: str, rows: dict[str, list[Row]]):
    """Return the summary of a stored campaign."""
    return summarise(campaigns.CAMPAIGNS[name].description(), rows[name], len(rows[name]))
