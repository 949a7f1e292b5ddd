# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A summary as Markdown."""

from collections.abc import Collection, Iterable, Sequence
import itertools
import math

from dp_swing_ros.evaluation.campaign.rows import grouped
from dp_swing_ros.evaluation.campaign.summary import (
    CRITERIA, DROP, Duel, Failure, Level, NEAR_GOAL, Standing, Summary)
from dp_swing_ros.evaluation.comparison import (
    Median, Paired, Rate, Ratio, SAME_COST, SAME_HELD)
from dp_swing_ros.evaluation.metrics import named
from dp_swing_ros.evaluation.scenarios import PROFILE, SCENARIOS
from dp_swing_ros.pendulum.parameters import FORCE
from dp_swing_ros.tables import compact

NOTES = """\
An episode is held when all angles are within 0.1 rad and all speeds below 1 over its last second
and the cart met no end stop; it has settled where that last stay begins, with the cart off the
centre as in the column, and with the cart where it is within 0.1 m of it, too: with links of 1 m,
and for other bodies the same in their own units. In
brackets are Wilson's 95 % intervals; nothing is run twice. Medians are over the held episodes,
what is largest over all; force steps are the standard deviation of Δu over the last 2 s (hold) and
over all of the run. A strike is the cart's meeting an end stop; counted are those of all episodes.
Up is the mean share of all episodes' time that was spent upright.
Σℓ is the running cost over the episode, by the default weights for everybody. A miss is a solve
over the time limit of the mpc."""

DUELS = f"""\
On the same cases: what one held and the other did not, with the p of McNemar's exact test, and
where both held, the median difference (first less second) with its 95 % interval (bootstrap) and
the p of the sign test, and the ratio of the closed-loop costs Σℓ (first over second, geometric
mean of the cases) with its 95 % interval (bootstrap). A large p shows no equality; that two are
equivalent is a test of its own: that they hold the same cases but for less than
{100 * SAME_HELD:.0f} % either way (exact binomial tests), and that the costs differ by less than
{100 * (SAME_COST - 1):.0f} % (two one-sided t tests of the logarithms), each at 0.05. The p are of
one test each: among twenty of them one below 0.05 is to be expected by chance."""

AGAINST = f"""\
Pairs are the episodes of the same contestant, scenario, level and seed; identical are those whose
rows are equal to the bit, the clock apart. The first of two is now, the second as stored.

{DUELS}"""

SHOWN = 0.05   # the p below which a test shows what it is for

SCORES = ('Performance is the mean over `hanging`; robustness the mean of the six fractions of '
          'levels that pass, with more than half of their runs.')


def markdown(summary: Summary) -> str:
    """Return the page."""
    parts = ['# Campaign', '\n'.join(made(summary)), NOTES]
    for scenario in summary.campaign['scenarios']:
        found = [one for one in summary.standings if one.scenario == scenario]
        if found:
            parts += [f'## {scenario}', f'{SCENARIOS[scenario].about}.',
                      standings(found, summary.drives)]
        if any(one.ways for one in found):
            parts.append(ways(found))
        if scenario == NEAR_GOAL:
            parts.append(f'Went beyond ±{DROP:g} rad: {_dropped(found)}.')
    if any(one.criteria or not math.isnan(one.performance) for one in summary.scores):
        parts += ['## Scores', SCORES, scores(summary)]
    if any(one.sweeps for one in summary.standings):
        parts += ['## Where each breaks', 'Levels that pass, and those that fail.',
                  breaks(summary)]
    if summary.duels:
        parts += ['## Against each other', DUELS, _duels(summary)]
    parts += ['## What was not held, and why', failures(summary.failures)]
    return '\n\n'.join(parts) + '\n'


def in_short(summary: Summary) -> list[str]:
    """Return a line on the campaign and one on each contestant, for a terminal."""
    return [made(summary)[-1], *(
        _verdict(name, [one for one in summary.standings if one.contestant == name])
        for name in summary.campaign['contestants'])]


def _verdict(name: str, standings: Sequence[Standing]) -> str:
    if not standings:
        return f'{name}: not run yet'
    held, runs = (sum(of) for of in zip(*(one.held[:2] for one in standings)))
    text = f'{name}: held {held} of {runs}'
    worst = min(standings, key=lambda one: one.held.successes / one.held.runs)
    if len(standings) > 1 and held < runs:
        text += f' (least in {worst.scenario}, {worst.held.successes} of {worst.held.runs})'
    settling = [one.medians['settling_time'] for one in standings if one.held.successes]
    if settling:
        ends = dict.fromkeys(number(end) for end in (min(settling), max(settling)))
        text += f', median settling {" to ".join(ends)} s'
    slowest = max((one.solve_time['p99'] for one in standings if one.solves), default=math.nan)
    return text + (f', solves p99 {number(slowest, 1, 1e3)} ms' if slowest == slowest else '')


def made(summary: Summary) -> list[str]:
    """Return the lines on where a campaign comes from, and on how many episodes it has."""
    campaign, about = summary.campaign, summary.campaign['made']
    longer = ''.join(f', of {name} of {SCENARIOS[name].times * campaign["duration"]:g} s'
                     for name in campaign['scenarios'] if SCENARIOS[name].times != 1)
    missing = f', {summary.missing} not run yet' if summary.missing else ''
    return [f'Made by `{about["command"]}` on {about["date"]}, version {campaign["version"]}, '
            f'commit {campaign["commit"]}; {about["machine"]}; {about["packages"]}.',
            f'{summary.episodes} episodes of {campaign["duration"]:g} s{longer}{missing}.']


def number(value: float, digits: int = 2, scale: float = 1.0) -> str:
    """Return a number for a cell."""
    return '-' if math.isnan(value) else f'{scale * value:.{digits}f}'


def share(rate: Rate, digits: int = 1) -> str:
    """Return successes of runs with their interval."""
    return (f'{rate.successes} of {rate.runs} '
            f'({100 * rate.low:.{digits}f}-{100 * rate.high:.{digits}f} %)')


def head(label: str, unit: str, drives: Collection[str]) -> str:
    """Return the head of a column with some drives; without a unit where it makes no sense."""
    label, of_drives = named(label, unit, drives)
    return label if of_drives is None else f'{label} [{of_drives}]'


def standings(found: list[Standing], drives: Collection[str] = (FORCE,)) -> str:
    """Return how contestants with some drives did in a scenario, as a table."""
    return compact([
        ('contestant', 'held', 'settling, with the cart [s]', 'off [m]', 'hold error [mrad]',
         head('force step: hold, run', 'N', drives),
         f'{head("largest u", "N", drives)}, x [m], θ [rad]', 'strikes', 'up [%]', 'Σℓ',
         head('Σabs(Δx u)', 'J', drives), head('∫abs(u)', 'N s', drives),
         head('∫u²', 'N² s', drives), 'solve: median, p99, largest [ms]', 'misses', 'stand-ins'),
        *((f'`{one.contestant}`', share(one.held),
           ', '.join(number(one.medians[name]) for name in (
               'settling_time', 'settling_time_with_cart')),
           number(one.medians['settling_offset']), number(one.medians['hold_error'], 2, 1e3),
           ', '.join(number(one.medians[name], 3) for name in ('smoothness', 'roughness')),
           ', '.join(number(value) for value in one.extremes.values()), str(one.strikes),
           number(one.uptime, 1, 100.0),
           number(one.medians['closed_loop_cost'], 0),
           number(one.medians['energy'], 1), number(one.medians['impulse'], 1),
           number(one.medians['squared_force'], 0),
           ', '.join(number(value, 2, 1e3) for value in one.solve_time.values()),
           str(one.deadline_misses), str(one.stand_ins)) for one in found)])


def ways(standings: list[Standing]) -> str:
    """Return what contestants held from where to where, as a table."""
    return compact([('way', *(f'`{one.contestant}`: held, settling [s]' for one in standings)), *(
        (way, *(f'{share(one.ways[way].held)}, {number(one.ways[way].settling_time)}'
                if way in one.ways else '-' for one in standings))
        for way in dict.fromkeys(way for one in standings for way in one.ways))])


def _dropped(standings: list[Standing]) -> str:
    return '; '.join(
        f'`{one.contestant}` {len(one.dropped)} of {one.held.runs}'
        + (f' (seeds {spans(one.dropped)})' if one.dropped else '') for one in standings)


def scores(summary: Summary) -> str:
    """Return the scores of contestants, as a table."""
    return compact([('contestant', 'performance', 'robustness', *CRITERIA), *(
        (f'`{one.contestant}`', number(one.performance, 3), number(one.robustness, 3),
         *(number(one.criteria.get(name, math.nan), 3) for name in CRITERIA))
        for one in summary.scores)])


def breaks(summary: Summary) -> str:
    """Return which levels contestants pass, as a table."""
    names = list(summary.campaign['contestants'])
    cells: dict[tuple[str, str], dict[str, str]] = {}
    for one in summary.standings:
        for parameter, levels in one.sweeps.items():
            cells.setdefault((one.scenario, parameter), {})[one.contestant] = (
                f'{sum(level.passed for level in levels)} of {len(levels)}' + failing(levels))
    return compact([('scenario', 'swept', *(f'`{name}`' for name in names)), *(
        (scenario, parameter, *(row.get(name, '-') for name in names))
        for (scenario, parameter), row in cells.items())])


def failing(levels: Sequence[Level]) -> str:
    """Return the levels that fail, neighbours as ranges."""
    ranges = []
    for passed, run in itertools.groupby(levels, key=lambda level: level.passed):
        values = [level.value for level in run]
        if not passed:
            ranges.append(f'{values[0]:.3g}' if len(values) == 1 else
                          f'{values[0]:.3g} to {values[-1]:.3g}')
    return f'; fails at {", ".join(ranges)}' if ranges else ''


def _duels(summary: Summary) -> str:
    return compact([
        ('scenario', 'first', 'second', 'cases', 'only first held', 'only second held', 'p',
         'the same held', 'settling [s]', head('force step at hold', 'N', summary.drives),
         head('force step over the run', 'N', summary.drives), 'Σℓ, ratio', 'equivalent'),
        *((one.scenario, f'`{one.first}`', f'`{one.second}`', str(one.cases),
           str(one.first_only), str(one.second_only), probability(one.p), verdict(one.same),
           *(difference(of) for of in one.differences.values()), ratio(one.cost),
           verdict(one.cost.same)) for one in summary.duels)])


def probability(p: float) -> str:
    """Return a p for a cell."""
    return '-' if math.isnan(p) else '< 0.001' if p < 0.001 else f'{p:.3f}'


def difference(of: Paired) -> str:
    """Return a paired difference for a cell."""
    return '-' if math.isnan(of.low) else (
        f'{of.median:+.2g} ({of.low:+.2g} to {of.high:+.2g}), p {probability(of.p)}')


def verdict(p: float) -> str:
    """Return what an equivalence test of this p shows, for a cell."""
    return f'{"yes" if p < SHOWN else "not shown"}, p {probability(p)}' if p == p else '-'


def ratio(of: Ratio) -> str:
    """Return a paired ratio for a cell."""
    return '-' if math.isnan(of.low) else interval(of, '.3f')


def interval(of: Median | Ratio, form: str) -> str:
    """Return a figure and its interval for a cell; of one run there is none."""
    if math.isnan(of.low):
        return '-' if math.isnan(of.value) else f'{of.value:{form}}'
    return f'{of.value:{form}} ({of.low:{form}} to {of.high:{form}})'


def failures(found: Sequence[Failure]) -> str:
    """Return what was not held, and why, as a table."""
    if not found:
        return 'Everything was held.'
    groups = grouped(found, lambda one: (one.scenario, one.contestant, one.why))
    return compact([('scenario', 'contestant', 'why', 'episodes', 'which'), *(
        (scenario, f'`{contestant}`', reason, str(len(group)), which(group))
        for (scenario, contestant, reason), group in groups.items())])


def which(failures: Sequence[Failure]) -> str:
    """Return the seeds of failures, level by level where something is swept."""
    def place(one: Failure) -> str:
        swept = one.level is not None and one.parameter != PROFILE
        return f'{one.parameter} {one.level:.3g}: ' if swept else ''

    return '; '.join(
        f'{where}{"seeds" if len(group) > 1 else "seed"} {spans(one.seed for one in group)}'
        for where, group in grouped(failures, place).items())


def spans(seeds: Iterable[int]) -> str:
    """Return whole numbers, neighbours as ranges."""
    runs = itertools.groupby(enumerate(sorted(seeds)), key=lambda pair: pair[1] - pair[0])
    ends = [[number for _, number in run] for _, run in runs]
    return ', '.join(str(run[0]) if len(run) == 1 else f'{run[0]}-{run[-1]}' for run in ends)


def compared_in_short(place: str, found: Sequence[tuple[Duel, int]]) -> str:
    """Return the comparison with what is stored in a place, in a line."""
    pairs, same, now, before = (sum(of) for of in zip(*(
        (one.cases, same, one.first_only, one.second_only) for one, same in found)))
    return (f'against {place}: {same} of {pairs} episodes are identical; {now} held only now, '
            f'{before} only as stored')


def compared(place: str, found: Sequence[tuple[Duel, int]]) -> str:
    """Return the comparison with what is stored in a place, as Markdown."""
    lines = compact([
        ('scenario', 'contestant', 'pairs', 'identical', 'held only now', 'held only as stored',
         'p', 'settling [s]', 'Σℓ, ratio'),
        *((one.scenario, f'`{one.first}`', str(one.cases), str(same), str(one.first_only),
           str(one.second_only), probability(one.p), difference(one.differences['settling_time']),
           ratio(one.cost)) for one, same in found)])
    return f'## Against {place}\n\n{AGAINST}\n\n{lines}\n'
