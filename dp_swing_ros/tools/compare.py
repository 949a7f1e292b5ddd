# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dp_swing_ros compare BAG`: what each solver would have done from a tick on."""

import argparse
from collections.abc import Sequence
import math
from pathlib import Path

from tqdm import tqdm

from dp_swing_ros import figures
from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.evaluation.comparison import aligned
from dp_swing_ros.rerun.counterfactual import Fork, fork
from dp_swing_ros.rerun.runs import Run
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.tools import program
from dp_swing_ros.tools.over_bags import add_bag, add_namespace, add_partial, beside, exit_code
from dp_swing_ros.topics import DISTURBANCE

AT = 0.5  # [s] the pendulum moves, and everything is still open


def main(argv: Sequence[str] | None = None) -> int:
    """Compare the solvers on the bag that the command line names; return the exit code."""
    arguments = _parser().parse_args(argv)
    return exit_code('compare', lambda: _compare(arguments))


def _compare(arguments: argparse.Namespace) -> int:
    bag = Bag(arguments.bag, arguments.partial, arguments.namespace)
    run = Run(bag)
    forks = _forks(run, arguments)
    print(table(forks[0]) if arguments.every is None else regrets(forks))
    if bag.incomplete:
        print(bag.incomplete)
    if bag.has(DISTURBANCE):
        print(f'note: pushes ({len(bag.of(DISTURBANCE))} on {DISTURBANCE.name}) are only in '
              'what was recorded')
    print(_draw(forks, run, arguments))
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program('compare'),
        description='Let each solver take over a recorded run at a tick, in simulation: with the '
                    'recorded parameters and seeds, as if it had seen every state until then. '
                    'Tabulates and draws the cost to go: the recorded running cost over the '
                    'states and forces that followed, without a terminal cost, for the rest of '
                    'the run; and the regret, what it is above the least of all. In simulation '
                    'a force acts at once, and no deadline cuts a solve short.')
    add_bag(parser)
    when = parser.add_mutually_exclusive_group()
    when.add_argument('--at', type=_seconds, default=AT, metavar='SECONDS',
                      help=f'take over this long after the first state (default: {AT:g}: the '
                           'pendulum moves, and everything is still open)')
    when.add_argument('--every', type=_period, metavar='SECONDS',
                      help='take over again and again, for the regret over the run')
    parser.add_argument('--solvers', nargs='+', choices=list(SOLVERS), default=list(SOLVERS),
                        help='who takes over (default: all)')
    parser.add_argument('--duration', type=_period, metavar='SECONDS',
                        help='how long each goes on (default: for the rest of the run)')
    parser.add_argument('--output', type=Path, metavar='DIR',
                        help='folder for the picture (default: BAG_analysis, beside the bag)')
    add_partial(parser)
    add_namespace(parser)
    return parser


def _seconds(text: str) -> float:
    value = float(text)
    if not 0 <= value < math.inf:
        raise argparse.ArgumentTypeError(f'{text} is not a time of 0 s or more')
    return value


def _period(text: str) -> float:
    value = _seconds(text)
    if value == 0:
        raise argparse.ArgumentTypeError(f'{text} is not a time above 0 s')
    return value


def _forks(run: Run, arguments: argparse.Namespace) -> list[Fork]:
    solvers = list(dict.fromkeys(arguments.solvers))
    duration = arguments.duration
    ticks = [run.tick_at(arguments.at, duration)] if arguments.every is None \
        else run.ticks_every(arguments.every, duration)
    with tqdm(total=len(ticks) * len(solvers), desc='take-overs', leave=False,
              disable=None) as bar:
        return [fork(run, tick, solvers, duration, bar.update) for tick in ticks]


def _draw(forks: list[Fork], run: Run, arguments: argparse.Namespace) -> Path:
    folder = arguments.output or beside(arguments.bag, 'analysis')
    folder.mkdir(parents=True, exist_ok=True)
    if arguments.every is None:
        path, figure = folder / 'counterfactual.png', figures.counterfactual(
            forks[0], run.limits)
    else:
        path, figure = folder / 'regret.png', figures.regret(forks)
    figures.mark(figure, run.bag.incomplete)
    figure.savefig(path)
    return path


def table(fork: Fork) -> str:
    """Return a Markdown table of one take-over: a row for who went on."""
    rows = [[f'from {fork.at:.2f} s to {fork.recorded.t[-1]:.2f} s', 'cost to go', 'regret',
             'held', 'settled [s]']]
    for name, course in fork.courses().items():
        held = not math.isnan(course.settled)
        rows.append([name, f'{course.cost:.3f}', f'{fork.regret(course):.3f}',
                     'yes' if held else 'no', f'{course.settled:.2f}' if held else '-'])
    return aligned(rows, names=1)


def regrets(forks: Sequence[Fork]) -> str:
    """Return a Markdown table of many take-overs: the least cost to go, and who regrets."""
    rows = [['from [s]', 'least cost to go', *forks[0].courses()]]
    for one in forks:
        rows.append([f'{one.at:.2f}', f'{one.least:.3f}',
                     *(f'{one.regret(course):.3f}' for course in one.courses().values())])
    return aligned(rows, names=1)
