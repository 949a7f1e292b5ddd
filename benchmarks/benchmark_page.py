# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page of the benchmark, from its results: every target met or missed, then every row."""

import statistics
from typing import Any, NamedTuple

from peers_solvers import CLOSE, OURS

from dp_swing_ros.evaluation.campaign.report import share
from dp_swing_ros.evaluation.comparison import Rate
from dp_swing_ros.tables import compact

# by the results of `benchmark.py`
NEAR = 'near the goal'
GPU_PEER = (
    'MPPI-Generic publishes 0.146 ms for an update of 2,048 samples over 100 steps on an RTX 4090 '
    '(Vlahov, Gibson, Gandhi and Theodorou, "MPPI-Generic: A CUDA Library for Stochastic '
    'Trajectory Optimization", 2024), of a model of its own.')
MODELS = {'rk4', 'euler'}
KINDS = {'unbounded': (' DDP', ' FDDP'), '20 N': ('BoxDDP', 'BoxFDDP')}   # ours: crocoddyl's


class Target(NamedTuple):
    """What was aimed at, what was measured, and whether more is better."""

    what: str
    aim: float
    found: float
    more: bool

    @property
    def met(self) -> bool:
        """Return whether it was met."""
        return self.found >= self.aim if self.more else self.found <= self.aim


def fastest(race: dict[str, Any], *words: str) -> str:
    """Return the fastest contender with all these words in its name."""
    names = [name for name in race['seconds'] if all(word in name for word in words)]
    return min(names, key=lambda name: race['seconds'][name]['value'])


def over(race: dict[str, Any], ours: str, *words: str) -> float:
    """Return how many times faster we are than the fastest peer of this kind."""
    return float(race['ratios'][fastest(race, *words)][ours]['value'])


def over_crocoddyl(race: dict[str, Any], ours: str, *words: str) -> float:
    """Return how many times faster we are, with a bound or without it, where that is less."""
    return min(over(race, f'{ours} rk4 {kind}', 'crocoddyl', *words, solver)
               for kind, solvers in KINDS.items() for solver in solvers)


def targets(results: dict[str, Any]) -> list[Target]:
    """Return the targets of what was measured."""
    found = []
    if 'gradient' in results:
        near = results['gradient'][NEAR]
        for name, aims in (('ddp', (30, 8)), ('ilqr', (45, 12))):
            for (model, theirs), aim in zip((('rk4', 'RK4'), ('euler', 'Euler')), aims):
                for actuation in ('python', 'C++'):
                    found.append(Target(
                        f"{name} with RK4 per iteration against crocoddyl's with {theirs}, "
                        f'actuation in {actuation}', aim,
                        over_crocoddyl(near, name, model, actuation), True))
    if 'sampling' in results:
        for samples, aim in (('1024', 100), ('8192', 40)):
            for kind in ('closed', 'compiled'):
                ticks = results['sampling'][samples]
                found.append(Target(
                    f'mppi per update against pytorch_mppi {kind}, {samples} samples', aim,
                    over(ticks, fastest(ticks, 'mppi, '), kind), True))
    for name, kinds in results.get('startup', {}).items():
        for kind, aim in (('warm', 2.5), ('cold', 25.0)):
            found.append(Target(f'{name}: start of the mpc to its first force, {kind} [s]', aim,
                                statistics.median(kinds[kind]), False))
    return found


def ahead(results: dict[str, Any]) -> list[str]:
    """Return where a peer is ahead of all of ours, by its time or by how often it gets there."""
    found = []
    for family in ('gradient', 'sampling'):
        for where, race in results.get(family, {}).items():
            for name, ratios in race['ratios'].items():
                model = MODELS & {*name.split()}
                most = max(ratio['value'] for our, ratio in ratios.items()
                           if model <= {*our.split()})
                if name not in ratios and most < 1:
                    found.append(f'{name} takes {most:.3g} times as long as ours ({where})')
    for contest, rows in results.get('solves', {}).items():
        there = {name: row['reached']['successes'] for name, row in rows.items()}
        for name in set(rows) - {*OURS}:
            most = max((ratio['value'] for ratio in rows[name]['ratios'].values()), default=1)
            if most < 1:
                found.append(f'{name} takes {most:.3g} times as long as ours ({contest})')
            if there[name] > max(there[our] for our in OURS):
                found.append(f'{name} gets to the least cost from {there[name]} of '
                             f'{rows[name]["reached"]["runs"]} starts, of ours the best from '
                             f'{max(there[our] for our in OURS)} ({contest})')
    return sorted(found)


def times(race: dict[str, Any]) -> str:
    """Return the rows of a comparison; the ratio is to the fastest of ours."""
    ours = fastest({'seconds': {name: race['seconds'][name] for name in
                                next(iter(race['ratios'].values()))}})
    return compact([['contender', 'median [ms]', '95 % interval [ms]', f'times {ours}'], *(
        [name, f'{1e3 * t["value"]:.4g}', f'{1e3 * t["low"]:.4g}-{1e3 * t["high"]:.4g}',
         '{value:.3g} ({low:.3g}-{high:.3g})'.format(**race['ratios'][name][ours])]
        for name, t in race['seconds'].items())])


def solves(contests: dict[str, Any]) -> str:
    """Return the section about whole solves."""
    parts = [
        '## Whole solves to the same cost',
        'From the same state and trajectory, each is timed until it is within '
        f'{100 * CLOSE:g} % of the least cost that any of them ends at, or counts as one that '
        'ends elsewhere. Ratios are medians over the starts from which both get there, in '
        'brackets the 95 % interval (bootstrap over starts) and how many these are. Cold starts '
        'are hanging and random states, with random forces; warm ones lie along a closed loop, '
        'disturbed, with the last plan. With CasADi it is the default problem, by multiple '
        "shooting and exact Hessians, its functions compiled from CasADi's C code where there is "
        'a C compiler; with crocoddyl one of its own step (semi-implicit Euler) and cost, which '
        'we then take. acados and aligator solve both, by C code of our own step and cost.']
    for contest, rows in contests.items():
        parts += [f'{contest}:', compact([
            ['contender', 'gets there', 'iterations', 'median [ms]',
             *(f'times {our}' for our in OURS)],
            *([name, share(Rate(**row['reached']), 0), *typical(row),
               *(over_starts(row['ratios'].get(our)) for our in OURS)]
              for name, row in rows.items())])]
    return '\n\n'.join(parts)


def typical(row: dict[str, Any]) -> tuple[str, str]:
    """Return the median iterations and time [ms] of a contender that gets to the goal."""
    counts = [count for count in row['iterations'] if count is not None]
    return (f'{statistics.median(counts):g}', f'{1e3 * row["seconds"]["value"]:.3g}') if counts \
        else ('-', '-')


def over_starts(ratio: dict[str, float] | None) -> str:
    """Return a ratio with its interval and the number of starts; there may be none."""
    return '-' if ratio is None else '{value:.3g} ({low:.3g}-{high:.3g}; {starts})'.format(**ratio)


def page(results: dict[str, Any]) -> str:
    """Return the page as Markdown."""
    parts = [
        '# Against peers', results['made'].strip(),
        f'Contenders take turns in one process; medians of up to {results["rounds"]} rounds, in '
        'brackets the 95 % interval (bootstrap over rounds). Ours solve in one thread where '
        'nothing else is said; so do all peers. Of MPPI the faster of one and two threads is '
        'compared, ours and theirs.',
        '**Where a peer is ahead:** ' + ('; '.join(ahead(results)) or 'nowhere') + '.',
        '## Targets', compact([['target', 'aim', 'measured', ''], *(
            [one.what, f'{"at least" if one.more else "at most"} {one.aim:g}',
             f'{one.found:.3g}', 'met' if one.met else '**missed**']
            for one in targets(results))])]
    if results['missing']:
        parts.append('Not measured: ' + '; '.join(
            f'{name}, for {why}' for name, why in results['missing'].items()) + '.')
    if 'sampling' in results:
        parts.append('pytorch_mppi runs on our equations (`closed`), and on these through '
                     'torch.compile (`compiled`).')
    if 'gradient' in results:
        parts += ['## One iteration, N = 30, 50 ms, double precision']
        for start, race in results['gradient'].items():
            parts += [f'From {start}:', times(race)]
    if 'solves' in results:
        parts.append(solves(results['solves']))
    for samples, found in results.get('sampling', {}).items():
        parts += [f'## MPPI, {int(samples):,} samples', times(found)]
    if 'gpu' in results:
        parts += [f'## MPPI on {results["gpu"]["device"]}, 100 steps, one update',
                  times(results['gpu']), GPU_PEER]
    if 'sampling' in results:
        parts.append('![time against samples](../figures/benchmark_samples.png)')
    return '\n\n'.join(parts) + '\n'
