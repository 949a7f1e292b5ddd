# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dp_swing_ros demo`: plant, mpc and logger swing the pendulum up; a bag stays."""

import argparse
from collections.abc import Callable, Mapping, Sequence
import dataclasses
from pathlib import Path
import re
import time

from tqdm import tqdm
import yaml

from dp_swing_ros.configuration import locate
from dp_swing_ros.errors import UserError
from dp_swing_ros.evaluation.comparison import spread, summary, table
from dp_swing_ros.evaluation.metrics import measure, Metrics
from dp_swing_ros.pendulum.state import (
    angles, Array, DEFAULT_LINKS, LINKS, links_of, symbols, wrapped)
from dp_swing_ros.report.recording import named, recording
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.tools.command_lines import dated, execute, FAILED, OK, program, progress, within
from dp_swing_ros.tools.isolation import domain_of_user, isolated
from dp_swing_ros.tools.observer import Observer
from dp_swing_ros.tools.processes import Crew, interrupt_on_signals, Process, ProcessError
from dp_swing_ros.topics import DIAGNOSTICS, FORCE_COMMAND, JOINT_STATES, PLAN

READY = 180.0   # [s] for logger and mpc to come up; the first start of the mpc compiles
MEETING = 3.0   # [s] to find the nodes that are there already, however they announce themselves
KEPT = 1000     # messages of a topic: the logger may find it late
COLUMNS = 5     # of more runs than this the table shows the spread
SILENCE = 20.0  # [s] without a state: something hangs
SHORTEST = 1e-3  # [s] of a run


@dataclasses.dataclass(frozen=True)
class Run:
    """What one run is to be, and the folder for its bag, logs and pictures."""

    solver: str
    seed: int
    links: int | None   # None: as in the parameter files
    duration: float  # [s]
    lockstep: bool
    parameter_files: tuple[Path, ...]
    folder: Path


def main(argv: Sequence[str] | None = None) -> int:
    """Do the runs that the command line asks for; return the exit code."""
    return execute(command_line(), _demo, argv, (ProcessError,))


def _demo(arguments: argparse.Namespace) -> int:
    interrupt_on_signals()
    runs = runs_of(arguments)
    shared = domain_of_user()
    with isolated() as domain:
        print(f'ROS_DOMAIN_ID={domain}', flush=True)
        if shared:
            _refuse_company()
        results = [_result(run, arguments.figures) for run in runs]
    _report(runs, results, arguments.spread or len(runs) > COLUMNS)
    return OK if all(result.success for result in results) else FAILED


def command_line() -> argparse.ArgumentParser:
    """Return the parser of the arguments."""
    parser = argparse.ArgumentParser(
        prog=program('demo'),
        description='Swing the pendulum up with three ROS processes: plant, mpc and logger. '
                    'Leaves a bag, pictures, a report and the logs; the exit code is 0 if '
                    'every run ended upright.')
    parser.add_argument('--solver', choices=list(SOLVERS), default='ilqr')
    parser.add_argument('--links', type=int, choices=LINKS,
                        help=f'of the pendulum (default: as in --params, else {DEFAULT_LINKS})')
    parser.add_argument('--duration', type=within(float, SHORTEST), default=10.0,
                        metavar='SECONDS')
    parser.add_argument('--seed', type=int, default=0, help='of noises and solver (default: 0)')
    parser.add_argument('--runs', type=within(int, 1), default=1, metavar='N',
                        help='number of runs, with seeds from --seed on (default: 1)')
    parser.add_argument('--spread', action='store_true',
                        help=f'tabulate the spread of the runs (of more than {COLUMNS}, always)')
    parser.add_argument('--lockstep', action='store_true',
                        help='as fast as the solver, and repeatable to the bit')
    parser.add_argument('--params', type=Path, metavar='FILE', action='append', default=[],
                        help='YAML file with parameters for plant and mpc; of several, the '
                             'later prevails')
    parser.add_argument('--output', type=Path, metavar='DIR',
                        help='folder to make (default: runs/SOLVER_TIME)')
    parser.add_argument('--figures', action=argparse.BooleanOptionalAction, default=True,
                        help='draw the pictures of each run, and write its report')
    return parser


def runs_of(arguments: argparse.Namespace) -> list[Run]:
    """
    Return what to do, the folders made.

    Raises UserError for what cannot work.
    """
    files = tuple(map(locate, arguments.params))
    for file in files:
        if not file.is_file():
            raise UserError(f'--params {file} is not a file')
    folder = arguments.output or Path('runs', dated(arguments.solver))
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise UserError(f'{folder} exists already; give another --output')
    runs = []
    for seed in range(arguments.seed, arguments.seed + arguments.runs):
        own = folder / f'seed_{seed}' if arguments.runs > 1 else folder
        own.mkdir(parents=True, exist_ok=True)
        runs.append(Run(arguments.solver, seed, arguments.links, arguments.duration,
                        arguments.lockstep, files, own))
    return runs


def _result(run: Run, figures: bool) -> Metrics:
    """Do one run, draw its pictures, write its report, and return its metrics."""
    print(f'{run.solver}, seed {run.seed} -> {run.folder}', flush=True)
    recorded = recording(perform(run))
    if figures:
        from dp_swing_ros.tools.analyse import write   # 0.7 s of loading
        write(named([recorded]), run.folder)
    return measure(recorded.episode)


def perform(run: Run) -> Path:
    """
    Do one run and return its bag; the logger starts first and ends last, to record all.

    Raises ProcessError if a process fails.
    """
    bag = run.folder / 'bag'
    shared = {'seed': run.seed, **({'links': run.links} if run.links else {})}
    files = (*run.parameter_files, kept(run.folder / 'qos.yaml'))
    with Crew() as crew, Observer() as observer:
        logger = crew.start('logger', {'output': str(bag), 'progress_period': 0.0},
                            run.folder / 'logger.log')
        mpc = crew.start('mpc', {'solver': run.solver, **shared}, run.folder / 'mpc.log', files)
        # the mpc subscribes once it has compiled; the logger, only to what somebody publishes
        _await({logger: observer.nodes, mpc: observer.listeners}, observer, crew)
        plant = crew.start(
            'plant', {'duration': run.duration, 'lockstep': run.lockstep, **shared},
            run.folder / 'plant.log', files)
        _follow(observer, plant, [mpc, logger], run.duration)
        plant.finish()
        mpc.end()  # it sends a last zero force, which belongs into the bag
        logger.end()
    return bag


def kept(file: Path) -> Path:
    """Write parameters by which plant and mpc keep what they publish for a logger to come."""
    overrides = {f'qos_overrides./{topic.name.lstrip("/")}.publisher':
                 {'durability': 'transient_local', 'depth': KEPT}
                 for topic in (JOINT_STATES, FORCE_COMMAND, PLAN, DIAGNOSTICS)}
    file.write_text(yaml.safe_dump({'/**': {'ros__parameters': overrides}}), encoding='utf-8')
    return file


def _refuse_company() -> None:
    """Raise UserError where nodes like ours are in the domain that the user has set."""
    end, others = time.monotonic() + MEETING, set[str]()
    with Observer() as observer:
        # a state may come before the name of who sent it
        while not others and time.monotonic() < end:
            observer.wait(0.1)
            others = observer.nodes() & {'plant', 'mpc', 'logger'}
    if others:
        raise UserError(f'{" and ".join(sorted(others))} already in this ROS domain; end them, '
                        'or unset ROS_DOMAIN_ID for the demo to find a free one')


def _await(ready: Mapping[Process, Callable[[], set[str]]], observer: Observer,
           crew: Crew) -> None:
    """Wait until each process is among the names it looks for, and show their logs."""
    end = time.monotonic() + READY
    waiting = list(ready)
    with progress(bar_format='{desc} ({elapsed})') as line:
        while waiting:
            names = ' and '.join(process.name for process in waiting)
            line.set_description_str(f'waiting for {names}')
            if time.monotonic() > end:
                raise ProcessError(f'{names} not ready after {READY:g} s')
            crew.check()
            for process in ready:
                for text in process.new_lines():
                    line.write(f'  {process.name}: {without_prefix(text)}')
            observer.wait(0.1)
            waiting = [process for process in waiting if process.name not in ready[process]()]


def without_prefix(line: str) -> str:
    """Return a line of a log without level, time and name."""
    return re.sub(r'^\[\w+\] \[[\d.]+\] \[[^]]*\]: ', '', line)


def _follow(observer: Observer, plant: Process, others: Sequence[Process],
            duration: float) -> None:
    """Show the pendulum until the plant ends itself."""
    start = time.monotonic()
    with tqdm(total=duration, bar_format='{n:5.2f}/{total:g} s |{bar}| {desc}',
              disable=None) as bar:
        while plant.running:
            for process in others:
                process.check()
            if min(observer.silence, time.monotonic() - start) > SILENCE:
                raise ProcessError(f'no state for {SILENCE:g} s; the logs are beside the bag')
            observer.wait(0.1)
            if observer.x is not None and observer.t is not None:
                bar.set_description_str(in_words(observer.x, observer.u), refresh=False)
                bar.update(min(observer.t, duration) - bar.n)


def in_words(x: Array, u: float) -> str:
    """Return a state (2n + 2,) and a force [N] for a line of progress."""
    of_angles = angles(x)
    turned = ' '.join(f'{symbol} {angle:+5.2f}' for symbol, angle in zip(
        symbols(links_of(x))[of_angles], wrapped(x)[of_angles]))
    return f'{turned} rad  x {x[0]:+5.2f} m  u {u:+6.1f} N'


def _report(runs: Sequence[Run], results: Sequence[Metrics], spread_only: bool) -> None:
    names = [run.solver if len(runs) == 1 else f'seed {run.seed}' for run in runs]
    columns = spread(results) if spread_only else dict(zip(names, results))
    print('', table(columns), '', sep='\n')
    if len(runs) > 1:
        print(summary(runs[0].solver, results))
    for run in runs:
        print(f'bag, logs and pictures: {run.folder}')
