# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One link and three links: the same solvers on pendulums shorter and longer than the default."""

from collections.abc import Sequence
from typing import NamedTuple

from campaigns import METHODS
import numpy as np

from dp_swing_ros.evaluation.campaign.contestants import Contestant, key
from dp_swing_ros.evaluation.campaign.report import share
from dp_swing_ros.evaluation.campaign.rows import Row, solves
from dp_swing_ros.evaluation.comparison import rate
from dp_swing_ros.evaluation.scenarios import Case, SCENARIOS
from dp_swing_ros.simulation import plants
from dp_swing_ros.tables import compact


OUTCOME = ('upright to the end', 'median settling [s]', 'longest settling [s]',
           'largest position [m]', 'track strikes')


class Group(NamedTuple):
    """Some episodes of all solvers with one pendulum."""

    links: int
    force_limit: float  # [N]
    scenario: str
    seeds: int
    duration: float     # [s]


GROUPS = [Group(1, 20.0, 'random', 200, 10.0), Group(3, 40.0, 'hanging', 20, 15.0),
          Group(3, 20.0, 'hanging', 20, 15.0), Group(3, 40.0, 'random', 20, 15.0)]


def contestant(group: Group, solver: str) -> Contestant:
    """Return a solver with the pendulum and the limit of a group, else with the defaults."""
    values = {'links': group.links, 'force_limit': group.force_limit}
    links = 'one link' if group.links == 1 else f'{group.links} links'
    return Contestant(f'{solver}, {links}, {group.force_limit:g} N', solver, values, values)


def of_group(group: Group, solver: str) -> list[tuple[Contestant, Case]]:
    """Return the episodes of a line of the page."""
    cases = SCENARIOS[group.scenario].cases(
        group.scenario, range(group.seeds), None, group.duration, group.links)
    return [(contestant(group, solver), case) for case in cases]


def episodes() -> list[tuple[Contestant, Case]]:
    """Return the episodes of all lines."""
    return [episode for group in GROUPS for solver in METHODS
            for episode in of_group(group, solver)]


def is_timed(case: Case) -> bool:
    """Return whether solve times are those of this case: those of hanging starts."""
    return case.scenario == 'hanging'


def outcome(rows: Sequence[Row]) -> tuple[str, ...]:
    """Return how runs ended, as OUTCOME is headed."""
    runs = [row.metrics for row in rows]
    settled = [run.settling_time for run in runs if run.success]
    return (share(rate([run.success for run in runs])),
            f'{np.median(settled):.2f}' if settled else '-',
            f'{max(settled):.2f}' if settled else '-',
            f'{max(run.largest_position for run in runs):.2f}',
            str(sum(run.strikes for run in runs)))


def line(group: Group, solver: str, rows: Sequence[Row]) -> tuple[str, ...]:
    """Return a line of the page."""
    timed = is_timed(of_group(group, solver)[0][1])
    return (str(group.links), f'{group.force_limit:g}', group.scenario, f'`{solver}`',
            *outcome(rows),
            f'{1e3 * np.quantile(solves(rows), 0.99):.1f}' if timed else '-',
            f'{1e3 * solves(rows).max():.0f}' if timed else '-')


def page(rows: Sequence[Row], made: str) -> str:
    """Return the page from the rows of all runs."""
    found = {row.key: row for row in rows}
    lines = [line(group, solver, [found[key(*one)] for one in of_group(group, solver)])
             for group in GROUPS for solver in METHODS]
    limit = plants.plant({}).limits.track_limit
    return '\n'.join([
        '# With one link and three\n', made,
        'Without ROS, in lockstep at 20 Hz, from the first seed of each scenario of [evaluate]'
        f'(../evaluation.md) on, ±{limit:g} m of track, links of 0.5 kg and 1 m; horizon, step '
        'and weights are the defaults for that number of links. One link is played for '
        f'{GROUPS[0].duration:g} s, three for {GROUPS[1].duration:g} s; the rows: '
        '`results/links.csv.gz`. In brackets the 95 % interval (Wilson); settling times are '
        'those of the successes; solve times those of all ticks from hanging, played by one '
        'process alone.\n',
        compact([('links', 'force limit [N]', 'scenario', 'solver', *OUTCOME,
                  'solve, p99 [ms]', 'longest solve [ms]'), *lines]), ''])
