# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dp_swing_ros demo`: plant, mpc and logger swing the pendulum up; a bag stays."""

import argparse
from collections.abc import Collection, Mapping, Sequence
import contextlib
from itertools import chain
import os
from pathlib import Path
import time
from typing import Any

from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import String
from tqdm import tqdm

from dp_swing_ros.control.receding_horizon import DESCRIPTION
from dp_swing_ros.declarations import DECLARATIONS
from dp_swing_ros.errors import UserError
from dp_swing_ros.evaluation.comparison import spread, summary, table
from dp_swing_ros.evaluation.metrics import Metrics
from dp_swing_ros.messages.fields import links_in, seconds, to_state
from dp_swing_ros.nodes.connections import publish, subscribe
from dp_swing_ros.parameters.files import for_node, is_of_rclpy, locate, sections
from dp_swing_ros.pendulum.parameters import acting_unit, FORCE
from dp_swing_ros.pendulum.state import (
    angles, Array, DEFAULT_LINKS, LINKS, links_of, symbols, wrapped)
from dp_swing_ros.pendulum.urdf import urdf
from dp_swing_ros.report.recording import named, recording
from dp_swing_ros.simulation import plants
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.tools.command_lines import (
    dated, ELSE, execute, FAILED, given, new_folder, OK, program, within)
from dp_swing_ros.tools.processes import (
    await_ready, Crew, isolated, located, Process, ProcessError, READY)
from dp_swing_ros.tools.tool_node import listeners, tool_node
from dp_swing_ros.topics import (
    COMMANDS, DIAGNOSTICS, JOINT_STATES, PLAN, ROBOT_DESCRIPTION, STAMPED_COMMANDS, Topic)

DISCOVERY = 3.0   # [s] to find the nodes that are there already, however they announce themselves
COLUMNS = 5     # of more runs than this the table shows the spread
SILENCE = 20.0  # [s] after the first state without another: something hangs
SHORTEST = 1e-3  # [s] of a run
# what options and parameter files may say of each node, and where neither does
OPTIONS = {'mpc': ('solver', 'seed', 'links'),
           'plant': ('seed', 'links', 'duration', 'lockstep')}
DEFAULTS: dict[str, dict[str, Any]] = {
    'mpc': {'solver': 'ilqr', 'seed': 0},
    'plant': {'seed': 0, 'duration': 10.0, 'lockstep': False}}

Parameters = Mapping[str, Mapping[str, Any]]   # of each node, by name


class Observer:
    """
    A node that hears the states: the last, its time and force; used as a context manager.

    t [s] from the first state, x (2n + 2,), None at first, u [N] applied over the period before;
    heard [s] is when it came, by the monotonic clock.
    """

    t, u, heard = 0.0, 0.0, 0.0
    x: Array | None = None
    first: float | None = None    # stamp of the first state [s]

    def __enter__(self) -> 'Observer':
        self._exit = contextlib.ExitStack()
        self._node = self._exit.enter_context(tool_node('demo'))
        self._executor = SingleThreadedExecutor(context=self._node.context)
        self._exit.callback(self._executor.shutdown)
        self._executor.add_node(self._node)
        subscribe(self._node, JOINT_STATES, self._receive)
        return self

    def __exit__(self, *error: object) -> None:
        self._exit.close()

    def nodes(self) -> set[str]:
        """Return the names of the nodes that are there."""
        return set(self._node.get_node_names())

    def listeners(self) -> set[str]:
        """Return the names of the nodes that subscribe to the states."""
        return listeners(self._node)

    def describe(self, text: str) -> None:
        """Publish a robot description, for who joins late, too."""
        publish(self._node, ROBOT_DESCRIPTION).publish(String(data=text))

    def wait(self, timeout: float) -> None:
        """Wait for the next state, at most for a time [s]."""
        self._executor.spin_once(timeout_sec=timeout)

    def _receive(self, message: Any) -> None:
        try:
            x = to_state(message, links_in(message))
        except ValueError:
            return  # of another robot
        stamp = seconds(message.header.stamp)
        self.first = stamp if self.first is None else self.first
        self.t, self.x, self.heard = stamp - self.first, x, time.monotonic()
        self.u = float(message.effort[0]) if message.effort else 0.0


def main(argv: Sequence[str] | None = None) -> int:
    """Do the runs that the command line asks for; return the exit code."""
    return execute(command_line(), _demo, argv, (ProcessError,))


def _demo(arguments: argparse.Namespace) -> int:
    files = list(map(locate, arguments.params))
    parameters = asked(arguments, {node: given_in(files, node) for node in OPTIONS})
    located(files, parameters)
    if parameters['plant']['duration'] < SHORTEST:
        raise UserError('with a duration of 0 the plant would never end; give --duration')
    solver, runs, results = parameters['mpc']['solver'], runs_of(parameters, arguments.runs), []
    folders = folders_of(arguments.output, solver, runs)
    domain_is_given = bool(os.environ.get('ROS_DOMAIN_ID'))
    try:
        with isolated() as domain:
            print(f'ROS_DOMAIN_ID={domain}', flush=True)
            if domain_is_given:
                refuse_company({'plant', 'mpc', 'logger'})
            for seed, folder in folders.items():
                print(f'{solver}, seed {seed} -> {folder}', flush=True)
                recorded = recording(perform(folder, runs[seed], files))
                results.append(recorded.metrics)
                if arguments.figures:
                    from dp_swing_ros.tools.analyse import write   # 0.7 s of loading
                    write(named([recorded]), folder)
    finally:   # a run that fails takes no other with it
        if results:
            _report(solver, folders, results, drive_in(files))
    return OK if all(result.success for result in results) else FAILED


def command_line() -> argparse.ArgumentParser:
    """Return the parser of the arguments."""
    parser = argparse.ArgumentParser(
        prog=program('demo'),
        description='Swing the pendulum up with three ROS processes: plant, mpc and logger. '
                    'Leaves a bag, pictures, a report and the logs; the exit code is 0 if '
                    'every run ended upright.')
    default = ELSE.format
    parser.add_argument('--solver', choices=list(SOLVERS),
                        help=default(DEFAULTS['mpc']['solver']))
    parser.add_argument('--links', type=int, choices=LINKS,
                        help=f'of the pendulum {default(DEFAULT_LINKS)}')
    parser.add_argument('--duration', type=within(float, SHORTEST), metavar='SECONDS',
                        help=default(f'{DEFAULTS["plant"]["duration"]:g}'))
    parser.add_argument('--seed', type=int, help=f'of noises and solver {default(0)}')
    parser.add_argument('--runs', type=within(int, 1), default=1, metavar='N',
                        help='number of runs, with seeds from --seed on (default: 1); of more '
                             f'than {COLUMNS} the spread is tabulated')
    parser.add_argument('--lockstep', action=argparse.BooleanOptionalAction,
                        help='as fast as the solver, and repeatable to the bit '
                             f'{default("not")}')
    parser.add_argument('--params', type=Path, metavar='FILE', action='append', default=[],
                        help='YAML file with parameters for plant and mpc; of several, the '
                             'later prevails')
    parser.add_argument('--output', type=Path, metavar='DIR',
                        help='folder to make (default: runs/SOLVER_TIME)')
    parser.add_argument('--figures', action=argparse.BooleanOptionalAction, default=True,
                        help='draw the pictures of each run, and write its report')
    return parser


def asked(arguments: argparse.Namespace, of_files: Parameters) -> dict[str, dict[str, Any]]:
    """Return what nodes are started with: what options say, else files, else DEFAULTS."""
    return {node: {**DEFAULTS[node],
                   **{name: of_files[node][name] for name in names if name in of_files[node]},
                   **given(arguments, *names)} for node, names in OPTIONS.items()}


def runs_of(parameters: Parameters, count: int) -> dict[str, dict[str, dict[str, Any]]]:
    """Return what the nodes of each run are started with, by their seeds, mostly the same."""
    runs = [{node: {**own, 'seed': own['seed'] + n} for node, own in parameters.items()}
            for n in range(count)]
    return {','.join(dict.fromkeys(str(own['seed']) for own in run.values())): run for run in runs}


def folders_of(output: Path | None, solver: str, seeds: Collection[str]) -> dict[str, Path]:
    """
    Make a folder for the bag, logs and pictures of each run, and return them by their seeds.

    Raises UserError where there is something already.
    """
    folder = new_folder(output or Path('runs', dated(solver)))
    folders = {seed: folder / f'seed_{seed}' if len(seeds) > 1 else folder for seed in seeds}
    for own in folders.values():
        own.mkdir(exist_ok=True)
    return folders


def perform(folder: Path, parameters: Parameters, parameter_files: Sequence[Path] = ()) -> Path:
    """
    Do one run and return its bag; the logger starts first and ends last, to record all.

    The parameters of mpc and plant prevail over the files. Raises ProcessError if a process fails.
    """
    bag, drive = folder / 'bag', drive_in(parameter_files)
    told = given_in(parameter_files, 'mpc')
    with Crew() as crew, Observer() as observer:
        if told.get('bodies') == DESCRIPTION:   # the plant, which has one, is to come last
            of_plant = plants.plant({
                **given_in(parameter_files, 'plant'), **parameters['plant']})
            observer.describe(urdf(of_plant.physical, of_plant.limits))
        logger = crew.start(
            'logger', {'output': str(bag), 'progress_period': 0.0}, folder / 'logger.log')
        mpc = crew.start(
            'mpc', {**parameters['mpc'], **keeping(*(
                topics[drive] for topics in (COMMANDS, STAMPED_COMMANDS) if drive in topics),
                PLAN, DIAGNOSTICS)},
            folder / 'mpc.log', parameter_files)
        # the mpc subscribes once it has compiled; the logger, only to what somebody publishes
        await_ready([logger, mpc], lambda: {'logger'} - observer.nodes()
                    | {'mpc'} - observer.listeners(), observer.wait)
        plant = crew.start(
            'plant', {**parameters['plant'], **keeping(JOINT_STATES, DIAGNOSTICS)},
            folder / 'plant.log', parameter_files)
        _follow(observer, plant, [mpc, logger], parameters['plant']['duration'], drive)
        plant.finish()
        mpc.end()  # it sends a last zero force, which belongs into the bag
        logger.end()
    return bag


def given_in(parameter_files: Sequence[Path], node: str) -> dict[str, Any]:
    """Return what files have for a node of ours, but for what is rclpy's; the later prevails."""
    found = for_node(chain.from_iterable(map(sections, parameter_files)), f'/{node}',
                     DECLARATIONS[node].fields(max(LINKS)))
    return {name: value for name, value in found.items() if not is_of_rclpy(name)}


def drive_in(parameter_files: Sequence[Path]) -> str:
    """Return the drive that an mpc with these parameters commands, or the one described to it."""
    told = given_in(parameter_files, 'mpc')
    if told.get('bodies') == DESCRIPTION:
        told = {**given_in(parameter_files, 'plant'), **told}
    return str(told.get('drive', FORCE))


def keeping(*topics: Topic) -> dict[str, object]:
    """Return the parameters by which a node keeps what it publishes for a logger to come."""
    return {f'qos_overrides./{topic.name.lstrip("/")}.publisher.durability': 'transient_local'
            for topic in topics}


def refuse_company(names: set[str]) -> None:
    """Raise UserError where nodes of these names are in the domain that the user has set."""
    end, others = time.monotonic() + DISCOVERY, set[str]()
    with Observer() as observer:
        # a state may come before the name of who sent it
        while not others and time.monotonic() < end:
            observer.wait(0.1)
            others = observer.nodes() & names
    if others:
        raise UserError(f'{" and ".join(sorted(others))} already in this ROS domain; end them, '
                        'or unset ROS_DOMAIN_ID for a free one to be found')


def _follow(observer: Observer, plant: Process, others: Sequence[Process], duration: float,
            drive: str) -> None:
    """Show the pendulum until the plant ends itself."""
    start = time.monotonic()
    with tqdm(total=duration, bar_format='{n:5.2f}/{total:g} s |{bar}| {desc}',
              disable=None) as bar:
        while plant.running:
            for process in others:
                process.check()
            last, patience = (observer.heard, SILENCE) if observer.heard else (start, READY)
            if time.monotonic() - last > patience:
                raise ProcessError(f'no state for {patience:g} s; the logs are beside the bag')
            observer.wait(0.1)
            if observer.x is not None:
                bar.set_description_str(in_words(observer.x, observer.u, drive), refresh=False)
                bar.update(min(observer.t, duration) - bar.n)


def in_words(x: Array, u: float, drive: str = FORCE) -> str:
    """Return a state (2n + 2,) and what acts by a drive [N], for a line of progress."""
    of_angles = angles(x)
    turned = ' '.join(f'{symbol} {angle:+5.2f}' for symbol, angle in zip(
        symbols(links_of(x))[of_angles], wrapped(x)[of_angles]))
    return f'{turned} rad  x {x[0]:+5.2f} m  u {u:+6.1f} {acting_unit(drive)}'


def _report(solver: str, folders: Mapping[str, Path], results: Sequence[Metrics],
            drive: str) -> None:
    names = [f'seed {seed}' for seed in folders] if len(folders) > 1 else [solver]
    columns = spread(results) if len(results) > COLUMNS else dict(zip(names, results))
    print('', table(columns, [drive]), '', sep='\n')
    if len(names) > 1:
        print(summary(solver, results))
    for folder, _ in zip(folders.values(), results):
        print(f'bag, logs and pictures: {folder}')
