# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page of the benchmark, from its results: every target met or missed, then every row."""

import statistics
from typing import Any, NamedTuple

from limit import ITERATION, ITERATIONS_OF, KERNELS, ROLLOUT, SAMPLE
from peers_gradient import ALONE, BOUND, HORIZON, OURS
from peers_solvers import CLOSE

from dp_swing_ros.evaluation.campaign.report import share
from dp_swing_ros.evaluation.comparison import Rate, sign_test
from dp_swing_ros.tables import compact

GPU_PEER = (
    'MPPI-Generic publishes 0.146 ms for an update of 2,048 samples over 100 steps on an RTX 4090 '
    '(Vlahov, Gibson, Gandhi and Theodorou, "MPPI-Generic: A CUDA Library for Stochastic '
    'Trajectory Optimization", 2024), of a model of its own.')

OFTENER = 'gets to the least cost from'
NEXT = (' A next step for it is to let the states of a start be off the model, and to close these '
        'gaps by iterations, as BoxFDDP and multiple shooting do.')


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
    races = {**results.get('gradient', {}), **results.get('sampling', {}), **(
        {'hydrax': results['hydrax']} if 'hydrax' in results else {}), **{
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
            best = max(OURS, key=there.__getitem__)
            if there[name] > there[best]:
                pairs = list(zip(rows[name]['iterations'], rows[best]['iterations'], strict=True))
                p = sign_test(sum(ours is None for its, ours in pairs if its is not None),
                              sum(its is None for its, ours in pairs if ours is not None))
                found.append(f'{name} {OFTENER} {there[name]} of {rows[name]["reached"]["runs"]} '
                             f'starts, of ours {best} from {there[best]} ({kind}; McNemar '
                             f'p {p:.2g})')
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
    return '\n\n'.join([*parts, '![who gets to the least cost, and how soon]'
                        '(../figures/benchmark_solves.png)'])


def typical(row: dict[str, Any]) -> tuple[str, str]:
    """Return the median iterations and time [ms] of a contender that gets to the goal."""
    counts = [count for count in row['iterations'] if count is not None]
    return (f'{statistics.median(counts):g}', f'{1e3 * row["seconds"]["value"]:.3g}') if counts \
        else ('-', '-')


def over_starts(ratio: dict[str, float] | None) -> str:
    """Return a ratio with its interval and the number of starts; there may be none."""
    return '-' if ratio is None else '{value:.3g} ({low:.3g}-{high:.3g}; {starts})'.format(**ratio)


class Reached(NamedTuple):
    """How near the parts of the solvers come to the limit: rows by name and number of links."""

    rows: dict[str, dict[str, dict[str, Any]]]

    def of(self, name: str, links: int = 2) -> dict[str, Any]:
        """Return a row."""
        return self.rows[name][str(links)]

    def seconds(self, name: str, links: int = 2) -> float:
        """Return what was measured [s]."""
        return float(self.of(name, links)['seconds']['value'])

    def share(self, name: str, which: str, links: int = 2) -> float:
        """Return a least time by what was measured."""
        return float(self.of(name, links)[which]) / self.seconds(name, links)

    def part(self, *row: Any) -> str:
        """Return that share in percent."""
        return f'{100 * self.share(*row):.0f} %'

    def line(self, name: str) -> list[str]:
        """Return the line of a table."""
        row = self.of(name)
        return [
            name, f'{row["flops"]:,.0f}', *(f'{row[kind]:.3g}' for kind in ('divide', 'sincos')),
            *(f'{1e6 * row[kind]:.3g}' for kind in ('vector', 'scalar', 'chain')),
            '{:.3g} ({:.3g}-{:.3g})'.format(*(1e6 * row['seconds'][key]
                                              for key in ('value', 'low', 'high'))),
            *(self.part(name, 'vector', links) for links in (2, 1, 3))]


def limit(found: dict[str, Any]) -> str:
    """Return the section about the limit of the processor, and about a whole tick."""
    reached, best = Reached(found['rows']), found['best']

    def rate(which: str) -> str:
        return f'{2e-9 / best[f"{which} fma"]:.3g}'
    return '\n\n'.join([
        "## How near the processor's limit",
        f'Two links, {HORIZON} steps, on one core; the last two columns are shares with one link '
        'and with three. Additions and multiplications (a fused one is two), divisions, and '
        'sines with cosines are [counted](../../benchmarks/operations.py), without what only '
        'fills vectors up. The least times are for the same mix at the best rates measured here: '
        'in vectors, in single numbers, and by the longest chain of results that wait for each '
        f'other. In double precision that is at most {rate("double vector")} Gflop/s in vectors '
        f'and {rate("double scalar")} in single numbers, in single precision '
        f'{rate("single vector")} and {rate("single scalar")}; share is that of the least time '
        'in vectors. No part takes a square root.',
        compact([['what', '+ and *', '/', 'sin', 'vectors [µs]', 'single numbers [µs]',
                  'chain [µs]', 'measured [µs]', 'share', '1 link', '3 links'],
                 *map(reached.line, reached.rows)]),
        why_less(reached, found), *whole_tick(reached, found['tick'])])


def why_less(reached: Reached, found: dict[str, Any]) -> str:
    """Return why the solvers come no nearer, and what would be next."""
    iteration, search, backward, step = (f'ilqr, {what}' for what in (
        ITERATION, 'line_search', 'backward', 'derivatives'))
    ddp, part = 'ddp, backward', reached.part

    def times(key: str, *rows: tuple[str, int]) -> float:
        more, less = (reached.of(*row)[key] for row in rows)
        return float(more / less)

    def longer(*rows: tuple[str, int]) -> float:
        more, less = (reached.seconds(*row) for row in rows)
        return more / less
    directions, of_links = ((ddp, 2), (backward, 2)), ((step, 3), (step, 2))
    next_steps = ['to find second derivatives for all accelerations before the backward pass, '
                  'where steps go side by side, for they are linear in the costate']
    if reached.share(step, 'scalar', 3) < 1:
        next_steps.append('to let the compiler take vectors for the derivatives of three links')
    return 'Why less than half: ' + ' '.join([
        'A rollout is a chain, in which no vector helps: that alone is '
        f'{part(search, "chain")} of a line search and {part(ROLLOUT, "chain")} of a rollout of '
        f'the model; and a line search is {100 * longer((search, 2), (iteration, 2)):.0f} % of an '
        'iteration of `ilqr`.',
        'The matrices of Riccati are small, and each step waits for the one before: of its '
        f'time its arithmetic is {part(backward, "vector")} and its chain '
        f'{part(backward, "chain")}; of three links {found["lanes"][0]} columns take '
        f'{found["lanes"][1]} lanes.',
        f'The backward pass of `ddp` is {times("flops", *directions):.2g} times '
        f'the arithmetic of that of `ilqr` in {longer(*directions):.2g} times the time: '
        f'{found["single"]:,.0f} of the operations are second derivatives at one stage of one '
        'step at a time, in single numbers, whose best rate alone gives that '
        f'{1e6 * found["single"] / 2 * found["best"]["double scalar fma"]:.2g} µs.',
        f'The derivatives of three links are {times("flops", *of_links):.2g} times the arithmetic '
        f'of two in {longer(*of_links):.2g} times the time; least in single numbers is '
        f'{part(step, "scalar", 3)} of it.',
        f'Samples of MPPI go side by side, and reach {part(SAMPLE, "vector")}; a share above '
        'all is of sines that are done beside the rest.',
        f'Next would be {"; and ".join(next_steps)}.'])


def whole_tick(reached: Reached, measured: dict[str, Any]) -> list[str]:
    """Return what a tick consists of."""
    tick, at_once = map(dict, measured.values())
    iterations, again = (of.pop(ITERATIONS_OF)['value'] for of in (tick, at_once))
    together = sum(part['value'] for part in tick.values())
    iteration = f'ilqr, {ITERATION}'
    at_limit = (together - tick[KERNELS]['value']
                + iterations * reached.of(iteration)['vector'])
    return [
        'A tick of the mpc that holds the pendulum by `ilqr`, in one process with who sends the '
        'states, in lockstep: medians, at 20 Hz and where the next state comes at once.',
        compact([['part of a tick', 'at 20 Hz [µs]', '95 % interval [µs]', 'share',
                  'at once [µs]'], *(
            [name, f'{1e6 * t["value"]:.3g}', f'{1e6 * t["low"]:.3g}-{1e6 * t["high"]:.3g}',
             f'{100 * t["value"] / together:.1f} %', f'{1e6 * at_once[name]["value"]:.3g}']
            for name, t in tick.items()),
            ['together', f'{1e6 * together:.4g}', '', '100 %',
             f'{1e6 * sum(part["value"] for part in at_once.values()):.4g}']]),
        f'The kernels take {1e6 * tick[KERNELS]["value"]:.2g} µs for {iterations:g} iterations '
        f'and {1e6 * at_once[KERNELS]["value"]:.2g} µs for {again:g} where ticks come at once; '
        f'an iteration in a loop takes {1e6 * reached.seconds(iteration):.2g} µs: the rest '
        'is the rollout of the last plan, and code and numbers that come from memory after a '
        f'pause. At the limit they would save {100 * (1 - at_limit / together):.1f} % of a tick: '
        'what is left to take is Python of controller and node, and rclpy.']


def page(results: dict[str, Any]) -> str:
    """Return the page as Markdown."""
    peers = ahead(results)
    parts = [
        '# Against peers', results['made'].strip(),
        f'Contenders take turns in one process; medians of up to {results["rounds"]} rounds, in '
        'brackets the 95 % interval (bootstrap over rounds). Ours solve in one thread where '
        'nothing else is said; so do all peers. Of MPPI the faster of one and two threads is '
        'compared, ours and theirs.',
        '**Where a peer is ahead:** ' + ('; '.join(peers) or 'nowhere') + '.'
        + (NEXT if any(OFTENER in one for one in peers) else ''),
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
    if 'limit' in results:
        parts.append(limit(results['limit']))
    if 'growth' in results:
        parts.append(growth(results['growth']))
    if 'solves' in results:
        parts.append(solves(results['solves']))
    for samples, found in results.get('sampling', {}).items():
        parts += [f'## MPPI, {int(samples):,} samples', times(found)]
    if 'hydrax' in results:
        parts += ['## Beside hydrax', 'An update with as many samples as its examples have, '
                  '1,024, of the same problem. Its model is MJX, whose trajectories cost what '
                  'ours do to a share of 1e-12 in double precision, and it takes all cores. It is '
                  'made for GPUs, on which this says nothing.', times(results['hydrax'])]
    if 'gpu' in results:
        parts += [f'## MPPI on {results["gpu"]["device"]}, 100 steps, one update',
                  times(results['gpu']), GPU_PEER]
    if 'sampling' in results:
        parts.append('![time against samples](../figures/benchmark_samples.png)')
    return '\n\n'.join(parts) + '\n'
