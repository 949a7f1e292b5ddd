# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dp_swing_ros soak`: plant and mpc in real time, watched for as long as you like."""

import argparse
from collections.abc import Mapping, Sequence
import json
import math
import os
from pathlib import Path
import time
from types import MappingProxyType
from typing import Any

from tqdm import tqdm

from dp_swing_ros import declarations
from dp_swing_ros.control import controllers
from dp_swing_ros.evaluation.soak import (
    ALLOWED, answers, pendulum, processes, quantiles, SHORTEST as LONG_ENOUGH, Soak, summary,
    ticks, times)
from dp_swing_ros.pendulum.state import DEFAULT_LINKS, LINKS
from dp_swing_ros.provenance import commit, machine, package_version
from dp_swing_ros.simulation import plants
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.tables import aligned
from dp_swing_ros.tools.command_lines import (
    dated, execute, FAILED, new_folder, OK, postponed, program, within)
from dp_swing_ros.tools.demo import refuse_company, SILENCE
from dp_swing_ros.tools.processes import (
    await_ready, Crew, isolated, located, Process, ProcessError)
from dp_swing_ros.tools.resources import burning, Resources
from dp_swing_ros.tools.watcher import Watcher

NAMES = {'plant', 'mpc', 'echo'}
SHORTEST = 1.0   # [s] of a soak
PAUSE = 0.02     # [s] between two looks at what has come
SAMPLE = 1.0     # [s] between two looks at memory and processor time
SETTLE = 0.2     # [s] for the last messages to come


def main(argv: Sequence[str] | None = None) -> int:
    """Do the soak that the command line asks for; return the exit code."""
    return execute(command_line(), _soak, argv, (ProcessError,))


def command_line() -> argparse.ArgumentParser:
    """Return the parser of the arguments."""
    parser = argparse.ArgumentParser(
        prog=program('soak'),
        description='Run plant and mpc as processes in real time, beside a bare echo of the '
                    'states, and report latency, late ticks, memory, processor time and falls. '
                    'Leaves summary.json, a picture and the logs; the exit code is 0 if the '
                    'pendulum stayed up and every force was within its limit. Ctrl-C ends it '
                    'with a report of what there is.')
    parser.add_argument('--duration', type=within(float, SHORTEST), required=True,
                        metavar='SECONDS')
    parser.add_argument('--solver', choices=list(SOLVERS), default='ddp')
    parser.add_argument('--rate', type=within(float, 1, 1000), metavar='HZ',
                        help='of the states (default: as in --params, else 20)')
    parser.add_argument('--links', type=int, choices=LINKS,
                        help=f'of the pendulum (default: as in --params, else {DEFAULT_LINKS})')
    parser.add_argument('--thread-priority', type=within(int, 0, 99), metavar='N',
                        help='of plant, mpc and echo in real time (default: as in --params, '
                             'else 0: none)')
    parser.add_argument('--params', type=Path, metavar='FILE', action='append', default=[],
                        help='YAML file with parameters for plant and mpc; of several, the '
                             'later prevails')
    parser.add_argument('--seed', type=within(int, 0), default=0,
                        help='of noises and solver (default: 0)')
    parser.add_argument('--burn', type=within(int, 0), default=0, metavar='N',
                        help='busy processes beside it (default: 0)')
    parser.add_argument('--output', type=Path, metavar='DIR',
                        help='folder to make (default: runs/soak_SOLVER_TIME)')
    return parser


def _soak(arguments: argparse.Namespace) -> int:
    asked = {name: getattr(arguments, name)
             for name in ('solver', 'duration', 'rate', 'links', 'seed', 'burn',
                          'thread_priority')}
    files = located(arguments.params, {})
    folder = arguments.output or Path('runs', dated(f'soak_{arguments.solver}'))
    shared = os.environ.get('ROS_DOMAIN_ID')
    with isolated() as domain:
        print(f'ROS_DOMAIN_ID={domain}\n{arguments.solver} for {arguments.duration:g} s -> '
              f'{folder}', flush=True)
        if shared:
            refuse_company(NAMES)
        found = soak(folder, **asked, params=files)
    write(found, folder, {**asked, 'params': list(map(str, files))})
    print('', report(found), f'summary, picture and logs: {folder}', sep='\n')
    if found.failure:
        raise ProcessError(found.failure)
    return OK if found.success else FAILED


def soak(folder: Path, solver: str, duration: float, rate: float | None = None,
         links: int | None = None, params: Sequence[Path] = (), seed: int = 0,
         burn: int = 0, thread_priority: int | None = None,
         beside: Mapping[str, int] = MappingProxyType({})) -> Soak:
    """
    Watch a plant and an mpc for a time [s], and return what was found; the logs are in the folder.

    rate [Hz], links and thread_priority may be left to the parameter files; burn is the number of
    busy processes beside them; beside are the numbers of other processes to watch, by name. What
    ends a soak early, a signal or a process that fails, leaves what there is. Raises
    ParameterError, UserError where there is something in the folder, and ProcessError where a
    process does not come up.
    """
    shared = {'seed': seed, **({'links': links} if links else {}),
              **({} if thread_priority is None else {'thread_priority': thread_priority})}
    paced = {'duration': duration, 'lockstep': False, **({'rate': float(rate)} if rate else {})}
    files = declarations.read(params)
    plant_values = plants.PLANT.complete({**files['plant'], **shared, **paced})
    mpc_values = {**files['mpc'], **shared}
    mpc_values = controllers.MPC.complete(mpc_values)
    force_limit = mpc_values['force_limit']
    x_r = controllers.cost(mpc_values).x_r
    new_folder(folder)
    with burning(burn), Crew() as crew, Watcher(x_r, force_limit) as watcher:
        echo = crew.start('echo', {'thread_priority': mpc_values['thread_priority']},
                          folder / 'echo.log')
        mpc = crew.start('mpc', {'solver': solver, **shared}, folder / 'mpc.log', params)
        await_ready([echo, mpc], lambda: {'echo', 'mpc'} - watcher.listeners(), time.sleep)
        plant = crew.start('plant', {**shared, **paced}, folder / 'plant.log', params)
        await_ready([plant], lambda: set() if watcher.take() else {'plant'}, time.sleep)
        resources = Resources({**{each.name: each.pid for each in (plant, mpc, echo)},
                               'watcher': os.getpid(), **beside})
        failure = ''
        try:
            _follow(watcher, resources, plant, [mpc, echo], duration, folder)
            for process in (mpc, echo):
                process.end()   # the mpc sends a last zero
            time.sleep(SETTLE)
        except ProcessError as error:
            failure = str(error)
        watcher.take()
    return watcher.soak(solver, 1 / plant_values['rate'], resources.usage(), failure)


def _follow(watcher: Watcher, resources: Resources, plant: Process, others: Sequence[Process],
            duration: float, folder: Path) -> None:
    """Watch until the plant ends itself, or a signal comes; raises ProcessError."""
    sampled = -math.inf
    with postponed() as signals, tqdm(
            total=duration, bar_format='{n:5.0f}/{total:g} s |{bar}| {desc}',
            disable=None) as bar:
        while plant.running and not signals:
            time.sleep(PAUSE)
            watcher.take()
            now = time.monotonic()
            if now - sampled < SAMPLE:
                continue
            sampled = now
            for process in others:
                process.check()
            if now - watcher.heard > SILENCE:
                raise ProcessError(f'no state for {SILENCE:g} s; the logs are in {folder}')
            if watcher.elapsed < duration - PAUSE:   # then it lets its memory go
                resources.sample(watcher.elapsed)
            bar.set_description_str(in_words(watcher), refresh=False)
            bar.update(min(watcher.elapsed, duration) - bar.n)
        if signals:
            signals.clear()
            plant.end()
        else:
            plant.finish()


def in_words(watcher: Watcher) -> str:
    """Return what was heard last for a line of progress."""
    solved = f'solve {1e3 * watcher.solve_time[-1]:.2f} ms  ' if watcher.solve_time else ''
    return (f'|θ| {watcher.deviation[-1]:.3f} rad  {solved}late {watcher.late_total}  '
            f'skipped {watcher.skipped_ticks}')


def write(found: Soak, folder: Path, about: Mapping[str, Any]) -> None:
    """Write summary and picture of a soak into a folder, with what it was asked for."""
    from dp_swing_ros import figures   # 0.7 s of loading
    made = {'version': package_version(), 'commit': commit(), 'machine': machine()}
    text = json.dumps(_plain({**made, **about, **summary(found)}), indent=2, ensure_ascii=False)
    (folder / 'summary.json').write_text(f'{text}\n', encoding='utf-8')
    figures.soak(found).savefig(folder / 'soak.png')


def _plain(value: Any) -> Any:
    """Return what JSON can hold: NaN, which is none of its numbers, becomes null."""
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    return None if isinstance(value, float) and math.isnan(value) else value


def report(found: Soak) -> str:
    """Return the figures of a soak as tables for a terminal, and lines."""
    growth = [usage.growth for usage in found.usage.values()]
    return '\n\n'.join(filter(None, [
        table('[ms]', times(found)), table('', answers(found)),
        table('process', processes(found)),
        f'memory: too short for its growth, which takes {LONG_ENOUGH:.0f} s'
        if all(map(math.isnan, growth)) else '',
        '\n'.join([line('ticks', ticks(found)), line('forces', found.forces._asdict()),
                   line('pendulum', pendulum(found)), verdict(found)])]))


def table(head: str, rows: Mapping[str, Mapping[str, float]]) -> str:
    """Return a table of rows with the same columns."""
    return aligned([[head, *next(iter(rows.values()))], *(
        [name, *map(_short, row.values())] for name, row in rows.items())], names=1)


def line(what: str, values: Mapping[str, float]) -> str:
    """Return values with their names as a line."""
    return f'{what}: ' + ', '.join(f'{name.replace("_", " ")} {_short(value)}'
                                   for name, value in values.items())


def _short(value: float) -> str:
    return '-' if math.isnan(value) else f'{value}' if isinstance(value, int) else f'{value:.2f}'


def verdict(found: Soak) -> str:
    """Return whether the mpc took longer than echo and solve do."""
    p99, bound = quantiles(found.latency)['p99'], 1e3 * found.bound
    sign = '<=' if p99 <= bound else '>'
    return (f'state to force p99 {_short(p99)} ms {sign} echo p99 + solve p99 + '
            f'{1e3 * ALLOWED:g} ms = {_short(bound)} ms')
