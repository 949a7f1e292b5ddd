# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dp_swing_ros compare BAG`: what each solver would have done from a tick on."""

import argparse
from collections.abc import Sequence
import math
from pathlib import Path

from dp_swing_ros import figures
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.rerun.counterfactual import Counterfactual, counterfactual, Run
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.tables import aligned
from dp_swing_ros.tools.command_lines import bag_parser, beside, execute, OK, progress, within

AT = 0.5         # [s] scaled: the pendulum moves, and everything is still open
SHORTEST = 1e-3  # [s]


def main(argv: Sequence[str] | None = None) -> int:
    """Compare the solvers on the bag that the command line names; return the exit code."""
    parser = bag_parser(
        'compare', 'Let each solver take over a recorded run at a tick, in simulation: with the '
        'recorded parameters and seeds, as if it had seen every state until then. Tabulates and '
        'draws the cost to go: the recorded running cost over the states and forces that '
        'followed, without a terminal cost, for the rest of the run; and the regret, what it is '
        'above the least of all. All are pushed as was recorded, their forces act as late as '
        'the recorded ones did at the median, and no deadline cuts a solve short.')
    when = parser.add_mutually_exclusive_group()
    when.add_argument('--at', type=within(float, 0), metavar='SECONDS',
                      help=f'take over this long after the first state (default: {AT:g} with '
                           'links of 1 m, and as long in own units with others: the pendulum '
                           'moves, and everything is still open)')
    when.add_argument('--every', type=within(float, SHORTEST), metavar='SECONDS',
                      help='take over again and again, for the regret over the run')
    parser.add_argument('--solvers', nargs='+', choices=list(SOLVERS), default=list(SOLVERS),
                        help='who takes over (default: all)')
    parser.add_argument('--duration', type=within(float, SHORTEST), metavar='SECONDS',
                        help='for how long (default: for the rest of the run)')
    parser.add_argument('--output', type=Path, metavar='DIR',
                        help='folder for the picture (default: BAG_analysis, beside the bag)')
    return execute(parser, _compare, argv)


def _compare(arguments: argparse.Namespace) -> int:
    bag = Bag(arguments.bag, arguments.partial, arguments.namespace, arguments.node)
    run, duration = Run(bag), arguments.duration
    solvers = list(dict.fromkeys(arguments.solvers))
    at = run.problem.scale.sized(AT, 's') if arguments.at is None else arguments.at
    ticks = [run.tick_at(at, duration)] if arguments.every is None \
        else run.ticks_every(arguments.every, duration)
    with progress(total=len(ticks) * len(solvers), desc='take-overs') as bar:
        found = [counterfactual(run, tick, solvers, duration, bar.update) for tick in ticks]
    if arguments.every is None:
        name, text = 'counterfactual.png', table(found[0])
        figure = figures.counterfactual(found[0], run.limits, run.problem.scale,
                                        run.problem.physical.drive)
    else:
        name, text, figure = 'regret.png', regrets(found), figures.regret(found)
    print(text)
    if bag.incomplete:
        print(bag.incomplete)
    if run.record.gap:
        print(f'note: {run.record.gap}; whoever takes over after a gap saw the states after it')
    if run.pushes:
        print(f'note: everyone is pushed as was recorded; periods with a push: {len(run.pushes)}')
    path = (arguments.output or beside(arguments.bag, 'analysis')) / name
    path.parent.mkdir(parents=True, exist_ok=True)
    figures.mark(figure, bag.incomplete)
    figure.savefig(path)
    print(path)
    return OK


def table(one: Counterfactual) -> str:
    """Return a Markdown table of one take-over: a row for each trajectory."""
    rows = [[f'from {one.at:.2f} s to {one.recorded.t[-1]:.2f} s', 'cost to go', 'regret',
             'held', 'settled [s]']]
    for name, trajectory in one.trajectories().items():
        held = not math.isnan(trajectory.settled)
        rows.append([name, f'{trajectory.cost:.3f}', f'{one.regret(trajectory):.3f}',
                     'yes' if held else 'no', f'{trajectory.settled:.2f}' if held else '-'])
    return aligned(rows, names=1)


def regrets(many: Sequence[Counterfactual]) -> str:
    """Return a Markdown table of many take-overs: the least cost to go, and all regrets."""
    return aligned([['from [s]', 'least cost to go', *many[0].trajectories()], *(
        [f'{one.at:.2f}', f'{one.least:.3f}',
         *(f'{one.regret(trajectory):.3f}' for trajectory in one.trajectories().values())]
        for one in many)], names=1)
