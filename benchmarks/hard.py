# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What no method holds: the cases of the stored campaigns, each tried again with remedies.

Where the plant is known exactly, the oracle of oracle.py says whether the case can be held at all,
from hanging in place of near the goal.
"""

import argparse
from collections.abc import Sequence
import dataclasses
import hashlib
from operator import attrgetter
from pathlib import Path
from typing import NamedTuple

from campaigns import DURATION, METHODS
from joblib import delayed, Parallel
import numpy as np
import oracle
import pandas as pd
import stamp
from tqdm import tqdm

from dp_swing_ros.control import controllers
from dp_swing_ros.evaluation.campaign.contestants import Contestant, key, parse_all
from dp_swing_ros.evaluation.campaign.report import share
from dp_swing_ros.evaluation.campaign.rows import grouped, Key, read, Row, store, Table, untimed
from dp_swing_ros.evaluation.campaign.runner import run
from dp_swing_ros.evaluation.comparison import rate
from dp_swing_ros.evaluation.scenarios import Case, PROFILE, SCENARIOS
from dp_swing_ros.pendulum.parameters import DriveParameters
from dp_swing_ros.pendulum.state import angles, Array
from dp_swing_ros.simulation.plant import PlantParameters
from dp_swing_ros.tables import compact

STORED = [stamp.TOP / 'docs' / 'results' / f'{name}.csv.gz'
          for name in ('robustness', 'random', 'stress')]
KEPT = stamp.TOP / 'runs'
# first, one more start at the first tick: no remedy, but other random numbers for each later draw
REMEDIES = tuple(f'{name}:{remedy}' for remedy in (
    'first_starts=7', 'horizon=80', 'other_starts=8') for name in METHODS)
MOST = 3                   # cases of a group that are tried
NOBODY = Contestant('', '', {}, {})   # whose key is that of a case
SWING_UP = oracle.Aim(steps=160, angle=np.inf, to_centre=True, share=0.95, iterations=400)
# how long [s] an angle swings in a guess before it is upright, and how fast [rad/s]
SWINGS = (6.0, 4.0), (7.5, 4.0), (4.0, 4.0), (2.5, 4.0)


class Group(NamedTuple):
    """What is swept, and the level of it."""

    scenario: str
    parameter: str
    level: float | None


class Verdict(NamedTuple):
    """What the oracle found of a case that no method holds."""

    scenario: str
    parameter: str
    level: float | None
    seed: int
    held: bool
    guesses: int              # that were tried
    iterations: int           # of IPOPT in all of them
    position: float           # [m] the largest on the way; not a number where nothing was found


def sources() -> str:
    """Return a digest of all that decides the page: code and rows."""
    digest = hashlib.sha256(stamp.sources('hard').encode())
    for path in filter(Path.exists, STORED):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def stored() -> list[Row]:
    """Return the rows of the methods in all campaigns that are there."""
    return [row for path in STORED if path.exists() for row in read(path)
            if row.key.contestant in METHODS]


def held_by_none(rows: Sequence[Row]) -> dict[Group, list[Case]]:
    """Return the cases that all methods were given and none held, by groups."""
    of_cases = grouped(rows, lambda row: row.key[1:])
    cases = {key(NOBODY, case)[1:]: case for name in {row.key.scenario for row in rows}
             for case in SCENARIOS[name].cases(name, None, None, DURATION)}
    return grouped([cases[name] for name, of in of_cases.items() if len(of) == len(METHODS)
                    and not any(row.metrics.success for row in of)],
                   lambda case: group_of(key(NOBODY, case)))


def group_of(episode: Key) -> Group:
    """Return the group of an episode; profiles of pushes, each a level of its own, are one."""
    _, scenario, parameter, level, _ = episode
    return Group(scenario, '', None) if parameter == PROFILE else Group(scenario, parameter, level)


def drawn(cases: Sequence[Case]) -> list[Case]:
    """Return as many cases of a group as are tried, in their order."""
    chosen = np.random.default_rng(0).permutation(len(cases))[:MOST]
    return [cases[n] for n in sorted(chosen)]


def played(episodes: Sequence[tuple[Contestant, Case]]) -> list[Row]:
    """Play episodes but for those that an earlier call from the same sources played."""
    KEPT.mkdir(parents=True, exist_ok=True)
    table = Table(KEPT / f'hard_{sources()}.csv')
    run(episodes, table, jobs=-1)
    found = {row.key: untimed(row) for row in table.rows}
    return [found[key(*episode)] for episode in episodes]


def is_exact(case: Case) -> bool:
    """Return whether the plant is the oracle's: moved by forces and known pushes alone."""
    plant = oracle.plant_of(case)
    usual = PlantParameters()
    given = dataclasses.replace(plant.parameters, initial_state=usual.initial_state)
    return (given == usual and plant.drive == DriveParameters()
            and not any(plant.physical.dry_frictions) and not case.resets)


def swinging(x_0: Array, seconds: float, speed: float) -> Array:
    """
    Return a guess of the states: angles that swing ever higher about where they hang.

    Shapes: x_0 (6,) -> (N + 1, 6).
    """
    t = oracle.PERIOD * np.arange(SWING_UP.steps + 1)
    X = np.zeros((len(t), len(x_0)))
    X[:, angles(x_0)] = np.where(
        t < seconds, 1 - t / seconds * np.cos(speed * (t - seconds)), 0)[:, None] * x_0[
            angles(x_0)]
    X[0] = x_0
    return X


def judged(case: Case) -> Verdict:
    """Search for a trajectory that holds a case, and try it on the plant."""
    plant = oracle.plant_of(case)
    problem = controllers.problem(dataclasses.asdict(plant.limits)).with_physical(plant.physical)
    program = oracle.Program(problem, plant, SWING_UP)
    name, iterations = (*key(NOBODY, case)[1:],), 0
    for guesses, swing in enumerate(SWINGS, 1):
        X, U, count = program.solve(plant.x, swinging(plant.x, *swing), case.pushes)
        iterations += count
        metrics = oracle.tried(problem, case, X, U, attrgetter('success'))
        if metrics is not None:
            return Verdict(*name, True, guesses, iterations, metrics.largest_position)
    return Verdict(*name, False, len(SWINGS), iterations, np.nan)


def alike(cases: Sequence[Case]) -> list[list[Case]]:
    """Return the cases whose plant is known exactly, together what differs by the seed alone."""
    return list(grouped(filter(is_exact, cases),
                        lambda case: repr(dataclasses.replace(case, seed=0))).values())


def verdicts(cases: Sequence[Case]) -> list[Verdict]:
    """Judge the cases whose plant is known exactly."""
    groups = alike(cases)
    if not groups:
        return []
    found = Parallel(-1, return_as='generator')(delayed(judged)(one[0]) for one in groups)
    shown = tqdm(found, total=len(groups), unit='case', desc='oracle', disable=None)
    return [verdict._replace(seed=case.seed) for one, verdict in zip(groups, shown)
            for case in one]


def page(rows: Sequence[Row], groups: dict[Group, list[Case]], again: Sequence[Row],
         found: Sequence[Verdict], made: str) -> str:
    """Return the page, from the stored rows, what none of them holds, and the trials."""
    given = grouped({row.key._replace(contestant='') for row in rows}, group_of)
    trials = grouped(again, lambda row: (row.key.contestant, group_of(row.key)))
    oracles = grouped(found, lambda one: group_of(Key('', *one[:4])))
    lines = []
    for group, cases in groups.items():
        names = {key(NOBODY, case) for case in cases}
        lines.append((
            group.scenario,
            '-' if group.level is None else f'{group.parameter} {group.level:.3g}',
            share(rate([name in names for name in given[group]])), str(len(drawn(cases))),
            *(counted([row.metrics.success for row in trials[name, group]])
              for name in REMEDIES),
            counted([one.held for one in oracles.get(group, [])])))
    return '\n'.join([
        '# What no method holds\n', made,
        f'Of the stored campaigns, {links_to_campaigns()}: the cases that '
        f'{", ".join(f"`{name}`" for name in METHODS)} were all given and of which none held one '
        'upright to the end without a track strike, by scenario and level. In brackets 95 % '
        f'intervals (Wilson). Of each group up to {MOST}, drawn by a seed, are played again with '
        'remedies: a horizon of 80 steps for 30, and eight other starts a tick for one. '
        'A case stands here for its random numbers, too, so some would be held '
        'with others: with `first_starts=7`, one more start at the first tick, they are drawn '
        'anew, and little else is changed. A remedy is worth what it holds beyond that.\n',
        f'Where the plant is known exactly, without noise, loss or drive, IPOPT seeks '
        f'{SWING_UP.steps} forces of 50 ms, with {100 * SWING_UP.share:g} % of what the drive '
        f'can, on the steps of the plant, from {len(SWINGS)} guesses, as for [the oracle]'
        '(oracle.md) near the goal, but that it knows the pushes beforehand. What it finds is '
        'played on the plant, and counts only where that is held. Where it finds nothing, that '
        'is no proof. A case that differs from another by its seed alone has the same verdict. '
        'The rows: [hard.csv.gz](hard.csv.gz), [hard_oracle.csv.gz](hard_oracle.csv.gz).\n',
        compact([('scenario', 'level', 'held by none', 'tried',
                  *(f'`{name}`' for name in REMEDIES), 'the oracle'), *lines])
        if lines else 'There is none.', ''])


def counted(held: Sequence[bool]) -> str:
    """Return how many are held for a cell."""
    return share(rate(held), 0) if held else '-'


def links_to_campaigns() -> str:
    """Return the pages of the campaigns that are there, as links."""
    stems = [path.name.removesuffix('.csv.gz') for path in STORED if path.exists()]
    return ', '.join(f'[{stem}]({stem}.md)' for stem in stems)


def main() -> None:
    """Find what no method holds, try it again, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--docs', type=Path, default=stamp.TOP / 'docs')
    results = parser.parse_args().docs / 'results'
    rows = stored()
    groups = held_by_none(rows)
    chosen = [case for cases in groups.values() for case in drawn(cases)]
    again = played([(contestant, case) for case in chosen for contestant in parse_all(REMEDIES)])
    found = verdicts(chosen)
    store(results / 'hard.csv.gz', again)
    stamp.store_table(pd.DataFrame(found, columns=Verdict._fields),
                      results / 'hard_oracle.csv.gz')
    (results / 'hard.md').write_text(page(rows, groups, again, found, stamp.made(
        'hard', sources(), ('numpy', 'numba', 'scipy', 'casadi'))),
        encoding='utf-8')


if __name__ == '__main__':
    main()
