# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Parameters and solvers changed by the hundred while the pendulum is balanced, in real time.

And the tour: all ways from each equilibrium to each other, by live changes of the goal. Run by
`make results`, on a machine that must do nothing else.
"""

import argparse
from collections.abc import Sequence
import math
from pathlib import Path
import tempfile
import time
from typing import Any, NamedTuple

from campaigns import METHODS
from live_operator import Operator
from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator
import numpy as np
import pandas as pd
from stamp import made, sources, store_table, TOP
from tqdm import tqdm

from dp_swing_ros.bags import read_episode
from dp_swing_ros.evaluation.metrics import HOLD, settling_time
from dp_swing_ros.figures.curves import mark_turns, unwrapped
from dp_swing_ros.figures.style import CART, FAINT, FORCE, formulas, LINKS, solver_name, styled
from dp_swing_ros.pendulum.geometry import joint_positions
from dp_swing_ros.pendulum.state import Array, deviation, equilibria, errors, upright
from dp_swing_ros.simulation.episode import Episode
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.tables import compact
from dp_swing_ros.tools.processes import Crew, isolated

BALANCED = 4.0    # [s] before the first change
PAUSE = 0.2       # [s] after each
LOADING = 60.0    # [s] at most until a change counts: another solver may have to be compiled
COUNT = 100       # of each kind
LEG = 10.0        # [s] of the tour for each way; in lockstep the slowest takes 8.6 s
METRE = 2.4       # [s] of the time axis, of a picture in which neither is distorted

# by random numbers, what may be asked of an mpc that balances
CHANGES = {
    'state_weights': lambda rng: [float(w) for w in
                                  np.array([10, 100, 100, 2, 6, 0.1]) * rng.uniform(0.7, 1.4, 6)],
    'force_weight': lambda rng: float(10 ** rng.uniform(-3.5, -2)),
    'track_weight': lambda rng: float(rng.uniform(1000, 10_000)),
    'track_margin': lambda rng: float(rng.uniform(0.2, 0.6)),
    'horizon': lambda rng: int(rng.integers(20, 61)),
    'step': lambda rng: float(rng.uniform(0.03, 0.06)),
    'force_limit': lambda rng: float(rng.uniform(12, 20)),
    'reference': lambda rng: [float(rng.uniform(-0.15, 0.15)), *[0.0] * 5],
    'time_limit': lambda rng: float(rng.uniform(0.02, 0.04)),
    'other_starts': lambda rng: int(rng.integers(0, 4)),
    'estimator': lambda rng: str(rng.choice(['ekf', 'none'])),
    'ekf__position_noise': lambda rng: float(10 ** rng.uniform(-4, -3)),
    'carry_over': lambda rng: float(rng.uniform(0.1, 0.3)),
    'seed': lambda rng: int(rng.integers(1000)),
    'ilqr__iterations': lambda rng: int(rng.integers(5, 60)),
    'mppi__samples': lambda rng: int(rng.integers(256, 1024)),
    'mppi__elite': lambda rng: bool(rng.integers(2)),
    'shown_tries': lambda rng: int(rng.integers(0, 20)),
    'solver': lambda rng: str(rng.choice(sorted(SOLVERS)))}
NOISES = {'velocity_noise': 0.02, 'force_noise': 0.2}   # of the plant, that there is to balance
# each is wrong in a way of its own
WRONG: Sequence[dict[str, Any]] = (
    {'force_weight': -1.0}, {'force_weight': float('nan')}, {'horizon': 0}, {'horizon': 2.5},
    {'solver': 'lqr'}, {'solver': 3}, {'step': 0.0}, {'step': 'fast'}, {'goal': 'up'},
    {'state_weights': [1.0, 2.0]}, {'state_weights': [1.0, 1.0, 1.0, 1.0, 1.0, -1.0]},
    {'state_weights': [0.0, 100.0, 100.0, 2.0, 6.0, 0.1]}, {'reference': [0.0] * 5},
    {'reference': [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]}, {'force_limit': 0.0}, {'force_limit': -5.0},
    {'links': 3}, {'clock': 'stamps'}, {'smaples': 3}, {'estimator': 'kalman'},
    {'time_limit': 0.0}, {'seed': -1}, {'mppi__samples': 1}, {'warm_start': 'none'},
    {'horizon': 30, 'solver': 'lqr'})


class Changed(NamedTuple):
    """What came of the changes of a solver that was first."""

    solver: str
    changes: int        # of parameters that were taken
    switches: int       # of solvers
    refused: int        # of those that are wrong
    largest: float      # [rad] of an angle, from the first change on
    late: int           # ticks
    skipped: int        # by the plant
    revisions: int      # that the mpc counted
    slowest: float      # [s] until a change counted
    seconds: float      # from the first change on


def changes(solver: str, folder: Path, count: int = COUNT, seed: int = 0) -> Changed:
    """Change a running mpc so many times each way; raises TimeoutError or ProcessError."""
    rng = np.random.default_rng([seed, sorted(SOLVERS).index(solver)])
    kinds = rng.permutation(['change', 'switch', 'wrong'] * count)
    folder.mkdir(parents=True, exist_ok=True)
    with Crew() as crew, Operator() as operator:
        mpc = crew.start('mpc', {'solver': solver}, folder / 'mpc.log')
        operator.meet('mpc')
        crew.start('plant', {'start': 'up_up', **NOISES}, folder / 'plant.log')
        if not operator.until(lambda: operator.states):
            raise TimeoutError('the plant sends no state')
        operator.wait(BALANCED)
        began, late = operator.states[-1], operator.counted('mpc', 'late_total')
        taken, slowest = dict.fromkeys(('change', 'switch', 'wrong'), 0), 0.0
        for kind in tqdm(kinds, desc=solver, disable=None):
            before, asked = operator.counted('mpc', 'revision'), time.monotonic()
            if kind == 'wrong':
                reason = operator.put('mpc', **WRONG[rng.integers(len(WRONG))])
                operator.wait(PAUSE)
                taken[kind] += bool(reason) and operator.counted('mpc', 'revision') == before
                continue
            name = 'solver' if kind == 'switch' else str(
                rng.choice([each for each in CHANGES if each != 'solver']))
            draw, now = CHANGES[name], operator.value('mpc', name)
            value = next(value for value in iter(lambda: draw(rng), None) if value != now)
            taken[kind] += not operator.put('mpc', **{name: value}) and operator.until(
                lambda: operator.counted('mpc', 'revision') == before + 1, LOADING)
            slowest = max(slowest, time.monotonic() - asked)
            operator.wait(PAUSE)
        operator.wait(2.0)
        mpc.check()
        since = [state for state in operator.states if state.at >= began.at]
        largest = max(float(deviation(state.x, upright(operator.links))) for state in since)
        return Changed(solver, taken['change'], taken['switch'], taken['wrong'], largest,
                       operator.counted('mpc', 'late_total') - late,
                       operator.counted('plant', 'skipped_ticks'),
                       operator.counted('mpc', 'revision'), slowest, since[-1].at - began.at)


class Leg(NamedTuple):
    """A way of the tour, and how it went."""

    way: str
    began: float      # [s] from the first state
    settled: float    # [s] after that, NaN where it was not held at the end


def circuit(names: Sequence[str]) -> list[str]:
    """Return places such that each way between two of them is gone once (Hierholzer, 1873)."""
    left = {name: [other for other in names if other != name] for name in names}
    path, found = [names[0]], list[str]()
    while path:
        if left[path[-1]]:
            path.append(left[path[-1]].pop(0))
        else:
            found.append(path.pop())
    return found[::-1]


def tour(solver: str, folder: Path) -> tuple[Path, list[Leg], dict[str, int]]:
    """
    Go all ways in real time; return the bag, the ways, and what mpc and plant counted.

    Raises TimeoutError or ProcessError.
    """
    folder.mkdir(parents=True, exist_ok=True)
    places, bag = circuit(list(equilibria())), folder / 'bag'
    with Crew() as crew, Operator() as operator:
        logger = crew.start('logger', {'output': str(bag), 'progress_period': 0.0},
                            folder / 'logger.log')
        mpc = crew.start('mpc', {'solver': solver, 'goal': places[0]}, folder / 'mpc.log')
        operator.meet('mpc')
        plant = crew.start('plant', {'start': places[0]}, folder / 'plant.log')
        if not operator.until(lambda: operator.states):
            raise TimeoutError('the plant sends no state')
        operator.wait(1.0)
        legs = []
        for start, goal in zip(places, tqdm(places[1:], desc=solver, disable=None)):
            begin = operator.states[-1].stamp
            if reason := operator.put('mpc', goal=goal):
                raise RuntimeError(f'the goal {goal} was refused: {reason}')
            operator.wait(LEG)
            leg = [state for state in operator.states if state.stamp >= begin]
            legs.append(Leg(f'{start} to {goal}', begin - operator.states[0].stamp,
                            settled(np.array([state.stamp for state in leg]) - begin,
                                    np.array([state.x for state in leg]), goal)))
        for process in (plant, mpc, logger):
            process.end()
        return bag, legs, {'late': operator.counted('mpc', 'late_total'),
                           'skipped': operator.counted('plant', 'skipped_ticks')}


def settled(t: Array, X: Array, goal: str) -> float:
    """Return when the last stay at a goal began [s], NaN where it was not held at the end."""
    return settling_time(t, errors(X, equilibria()[goal]))


@styled
def picture(episode: Episode, legs: Sequence[Leg]) -> Figure:
    """Show a tour: the pendulum where each way ends, and its angles and force."""
    figure = Figure((9.0, 4.6), layout='constrained')
    places, curves, force = figure.subplots(
        3, sharex=True, height_ratios=(2.2, 1.6, 1.0))
    ends = [leg.began + LEG for leg in legs]
    lengths = episode.physical.lengths
    for end in [legs[0].began, *ends]:
        x = episode.X[np.searchsorted(episode.t, end) - 1]
        # the cart is drawn where the way ends, and a metre as many seconds
        points = joint_positions(np.array([0.0, *x[1:]]), lengths) * (METRE, 1.0) + (end, 0.0)
        for link, (colour, width) in enumerate(zip(LINKS, (6.0, 2.5))):   # folded, both show
            places.plot(*points[link:link + 2].T, color=colour, linewidth=width,
                        solid_capstyle='round')
        places.plot(*points[0], marker='s', color=CART, markersize=7)
    for axes in (places, curves, force):
        for leg in legs:
            axes.axvline(leg.began, color=FAINT, linewidth=0.7)
    reach = 1.15 * sum(lengths)
    places.set(ylim=(-reach, reach), yticks=[], ylabel='after each way')
    for angle, colour, name in zip(unwrapped(episode.X).T, LINKS, formulas(len(lengths))[1:]):
        curves.plot(episode.t, angle, color=colour, label=name)
    mark_turns(curves.yaxis)
    curves.yaxis.set_major_locator(MultipleLocator(2 * np.pi))
    curves.set(ylabel='angle')
    curves.legend(loc='upper left', ncols=2, fontsize='small')
    force.plot(episode.t[1:], episode.U, color=FORCE, linewidth=0.9, drawstyle='steps-post')
    force.set(xlabel='time [s]', ylabel='force [N]')
    places.set_title(f'{solver_name(episode.solver)}: all twelve ways between the four '
                     'equilibria, by live changes of the goal')
    return figure


def page(changed: pd.DataFrame, legs: pd.DataFrame, made: str) -> str:
    """Return the page as Markdown."""
    lines = [(f'`{of.solver}`', f'{of.changes} of {of.asked}', f'{of.switches} of {of.asked}',
              f'{of.refused} of {of.asked}', f'{of.largest:.4f}', str(of.late), str(of.skipped),
              f'{of.slowest:.1f}', f'{of.seconds:.0f}') for of in changed.itertuples()]
    ways = [(way, *('-' if math.isnan(settled) else f'{settled:.2f}'
                    for settled in of.set_index('solver').settled))
            for way, of in legs.groupby('way', sort=False)]
    solvers = list(dict.fromkeys(legs.solver))
    held = [f'`{solver}` {of.settled.notna().sum()} of {len(of)}, late ticks '
            f'{of.late.max()}, ticks skipped by the plant {of.skipped.max()}'
            for solver, of in legs.groupby('solver', sort=False)]
    return '\n'.join([
        '# Changes of what runs\n', made,
        'Plant and mpc as processes in real time at 20 Hz, and a node that asks for changes as '
        f'any user may. The pendulum has been balanced for {BALANCED:g} s, under noise ('
        f'{", ".join(f"`{name}` {value:g}" for name, value in NOISES.items())}); then in random '
        'order come changes of one parameter each, drawn of those that '
        f'[live_changes.py](../../benchmarks/live_changes.py) lists ({len(CHANGES) - 1} names), '
        'switches to another solver, and requests that are wrong, of which none may change '
        'anything. A change is taken when the mpc reports another revision; the next comes '
        f'{PAUSE:g} s later. The solver that stands first is that of the start.\n',
        compact([('solver', 'changes taken', 'switches taken', 'wrong ones refused',
                  'largest angle [rad]', 'late ticks', 'ticks skipped by the plant',
                  'slowest until it counts [s]', 'time [s]'), *lines]), '',
        '## The tour\n',
        '![All twelve ways](../figures/live_tour.png)\n',
        'From each of the four equilibria to each other by live changes of `goal`, one every '
        f'{LEG:g} s, with the defaults, recorded by a logger. Times until '
        'the last stay at the goal began [s] (all angles within 0.1 rad and all speeds '
        f'under 1, for {HOLD:g} s at least): {"; ".join(held)}. '
        'In lockstep: [reliability](reliability.md#from-each-equilibrium-to-each-other).\n',
        compact([('way', *(f'`{solver}`' for solver in solvers)), *ways]), ''])


def main(argv: Sequence[str] | None = None) -> None:
    """Change, tour, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--count', type=int, default=COUNT, help='of changes of each kind')
    parser.add_argument('--solvers', nargs='+', default=METHODS[:1])
    parser.add_argument('--docs', type=Path, default=TOP / 'results')
    arguments = parser.parse_args(argv)
    results, figures = arguments.docs / 'results', arguments.docs / 'figures'
    for made_here in (results, figures):
        made_here.mkdir(parents=True, exist_ok=True)
    with isolated(), tempfile.TemporaryDirectory() as folder:
        changed = [{'asked': arguments.count, **changes(
            solver, Path(folder, solver), arguments.count)._asdict()}
            for solver in arguments.solvers]
        ways = []
        for solver in arguments.solvers:
            bag, legs, counts = tour(solver, Path(folder, f'tour_{solver}'))
            ways += [{'solver': solver, **leg._asdict(), **counts} for leg in legs]
            if solver == arguments.solvers[0]:
                picture(read_episode(bag), legs).savefig(figures / 'live_tour.png')
    frames = {'live_changes': pd.DataFrame(changed), 'live_tour': pd.DataFrame(ways)}
    for name, frame in frames.items():
        store_table(frame, results / f'{name}.csv.gz')
    (results / 'live_changes.md').write_text(
        page(*frames.values(), made('live_changes', sources('live_changes'))), encoding='utf-8')


if __name__ == '__main__':
    main()
