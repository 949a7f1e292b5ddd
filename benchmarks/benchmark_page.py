# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page of the benchmark, from its results: every target met or missed, then every row."""

import statistics
from typing import Any, NamedTuple

from peers_gradient import ALONE, BOUND, HORIZON, OURS
from peers_solvers import CLOSE

from dp_swing_ros.evaluation.campaign.report import share
from dp_swing_ros.evaluation.comparison import Rate
from dp_swing_ros.tables import compact

GPU_PEER = (
    'MPPI-Generic publishes 0.146 ms for an update of 2,048 samples over 100 steps on an RTX 4090 '
    '(Vlahov, Gibson, Gandhi and Theodorou, "MPPI-Generic: A CUDA Library for Stochastic '
    'Trajectory Optimization", 2024), of a model of its own.')


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


def targets(results: dict[str, Any]) -> list[Target]:
    """Return the targets of what was measured."""
    found = []
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
    races = {**results.get('gradient', {}), **results.get('sampling', {}), **{
        f'{by} {count}': race for by, of in results.get('growth', {}).items()
        for count, race in of.items()}}
    for where, race in races.items():
        for name, ratios in race['ratios'].items():
            most = max(ratio['value'] for ratio in ratios.values())
            if name not in ratios and name != ALONE and most < 1:
                found.append(f'{name} takes {most:.3g} times as long as ours ({where})')
    for kind, rows in results.get('solves', {}).items():
        there = {name: row['reached']['successes'] for name, row in rows.items()}
        for name in set(rows) - {*OURS}:
            most = max((ratio['value'] for ratio in rows[name]['ratios'].values()), default=1)
            if most < 1:
                found.append(f'{name} takes {most:.3g} times as long as ours ({kind})')
            if there[name] > max(there[our] for our in OURS):
                found.append(f'{name} gets to the least cost from {there[name]} of '
                             f'{rows[name]["reached"]["runs"]} starts, of ours the best from '
                             f'{max(there[our] for our in OURS)} ({kind})')
    return sorted(found)


def times(race: dict[str, Any]) -> str:
    """Return the rows of a comparison; the ratio is to the fastest of ours."""
    ours = fastest({'seconds': {name: race['seconds'][name] for name in
                                next(iter(race['ratios'].values()))}})
    return compact([['contender', 'median [ms]', '95 % interval [ms]', f'times {ours}'], *(
        [name, f'{1e3 * t["value"]:.4g}', f'{1e3 * t["low"]:.4g}-{1e3 * t["high"]:.4g}',
         '{value:.3g} ({low:.3g}-{high:.3g})'.format(**race['ratios'][name][ours])]
        for name, t in race['seconds'].items())])


def growth(races: dict[str, dict[str, Any]]) -> str:
    """Return the section about longer horizons and more links."""
    parts = [
        '## How an iteration grows',
        f'As above with rk4 and {BOUND:g} N: microseconds of an iteration, in brackets how many '
        f'times that of `ilqr` it is; with two links over the horizons, over {HORIZON} steps with '
        'the links.']
    for by, of in races.items():
        names = {name: None for race in of.values() for name in race['seconds']}
        parts.append(compact([[by, *of], *(
            [name, *(f'{1e6 * race["seconds"][name]["value"]:.3g} '
                     f'({race["ratios"][name][OURS[0]]["value"]:.3g})' for race in of.values())]
            for name in names)]))
    return '\n\n'.join([*parts, '![an iteration over horizon and links]'
                        '(../figures/benchmark_growth.png)'])


def solves(kinds: dict[str, Any]) -> str:
    """Return the section about whole solves."""
    parts = [
        '## Whole solves to the same cost',
        'The default problem. From the same state and trajectory, each is timed until it is '
        f'within a share of {CLOSE:g} of the least cost that any of them ends at, or counts as '
        'one that ends elsewhere. Ratios are medians over the starts from which both get there, '
        'in brackets the 95 % interval (bootstrap over starts) and how many these are. Cold '
        'starts are hanging and random states, with random forces; warm ones lie along closed '
        'loops, disturbed, with the last plan. CasADi has multiple shooting and exact Hessians, '
        'its functions compiled from its own C code where there is a C compiler.']
    for kind, rows in kinds.items():
        parts += [f'From {kind} starts:', compact([
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
        parts += [
            f'## One iteration, N = {HORIZON}, 50 ms, double precision',
            'All solve the same problem, number for number: the default one, whose step, cost and '
            'derivatives the peers get as C code that CasADi has written. It is near the goal, '
            'where every step is taken whole; a call is of two iterations, and half of what it '
            'costs beside them counts. What that C code takes of an iteration stands as CasADi '
            '*alone*. Our own derivatives '
            'are vectorised for this processor and made for one number of links, and so is our '
            'Riccati pass; the peers take any problem, and their wheels are for any processor of '
            'x86-64.']
        for contest, race in results['gradient'].items():
            parts += [f'{contest}:', times(race)]
    if 'growth' in results:
        parts.append(growth(results['growth']))
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
