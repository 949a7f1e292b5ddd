# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Measure the mpc on a rig that shares no code with it: the page docs/results/foreign.md.

Runs go in real time, one on each core, on a machine that must do nothing else. Each is kept in a
file, so that a second start goes on where the first was stopped.
"""

import argparse
from collections.abc import Iterable
import json
from pathlib import Path
import subprocess
import sys
import tempfile
import time
from typing import Any, NamedTuple

from joblib import delayed, Parallel
import numpy as np
import pandas as pd
from stamp import made, sources as digest, TOP

from dp_swing_ros.evaluation import comparison
from dp_swing_ros.evaluation.campaign.report import share
from dp_swing_ros.tables import compact
from dp_swing_ros.tools.processes import Crew, isolated, Process

SOLVERS = ('ilqr', 'ddp', 'mppi')
PLANT = Path(__file__).with_name('foreign_plant.py')
FORCE_LIMIT = 20.0          # [N] default of the mpc
ZERO_WITHIN = 0.3           # [s] from a fault's beginning
RECOVERY_WITHIN = 5.0       # [s] from its end
FAULT_TIMES = (1.0, 3.0)    # [s] in the middle of the swing-up, and while it holds
LIMIT, HOLD = 20.0, 1.0     # [s] of a run at most, and upright at its end
READY = 'ready'             # what the mpc prints once it listens
START = 120.0               # [s] for that, where nothing is compiled yet
SLACK = 30.0                # [s] of wall time for the rig to start and end


class Condition(NamedTuple):
    """What the rig does, its arguments, and the parameters of the mpc that go with it."""

    title: str
    arguments: tuple[str, ...] = ()
    parameters: tuple[tuple[str, Any], ...] = ()
    wall: float = 1.0   # [s] of wall time in one of the rig's


def simulated(factor: float) -> Condition:
    """Return the condition of simulated time at so many seconds in one of wall time."""
    return Condition(f'simulated time at {factor:g} of wall time', ('--clock', str(factor)),
                     (('use_sim_time', True),), 1 / factor)


CONDITIONS = {
    'plain': Condition('default QoS, fresh stamps'),
    'stamps_50_ms_old': Condition('stamps 50 ms old', ('--stamp-offset', '0.05')),
    'stamps_zero': Condition('stamps of zero', ('--stamps', 'zero')),
    'stamps_hour_off': Condition('stamps an hour old', ('--stamp-offset', '3600')),
    'best_effort': Condition('best effort', ('--best-effort',)),
    'permuted': Condition('joints permuted, two more', ('--permute',)),
    'fast': Condition('100 Hz', ('--rate', '100')),
    'transient_local': Condition('transient local', ('--transient-local',)),
}
RIGS = {
    'plausible': Condition('plausible', ('--plausible',)),
    'plausible_late': Condition('plausible, 20 ms later', ('--plausible', '--delay', '0.02')),
    'plausible_fast': Condition('plausible, 100 Hz', ('--plausible', '--rate', '100')),
}
SIMULATED = {f'clock_{factor:g}': simulated(factor) for factor in (0.2, 0.5, 2.0)}
FAULTS = {kind: Condition(kind.replace('_', ' '), ('--fault', kind)) for kind in (
    'silence', 'nan', 'frozen', 'wrong_names', 'wrong_lengths', 'outlier_constant',
    'outlier_random')}
ALL = {**CONDITIONS, **SIMULATED, **RIGS, **FAULTS}


class Case(NamedTuple):
    """One run."""

    condition: str
    solver: str
    seed: int


def play(case: Case) -> tuple[Case, dict[str, Any]]:
    """Do one run in a ROS domain of its own, and return its figures."""
    with isolated(), tempfile.TemporaryDirectory() as folder:
        return case, row(measure(case, Path(folder)))


def measure(case: Case, folder: Path) -> dict[str, Any]:
    """
    Do one run in real time and return the rig's record of it.

    Raises ProcessError where the mpc fails, CalledProcessError where the rig does.
    """
    condition, output = ALL[case.condition], folder / 'record.json'
    arguments = [*condition.arguments, '--seed', str(case.seed), '--duration', str(LIMIT),
                 '--hold', str(HOLD), '--output', str(output)]
    if case.condition in FAULTS:
        arguments += ['--fault-at', str(FAULT_TIMES[case.seed % len(FAULT_TIMES)])]
    with Crew() as crew:
        mpc = crew.start('mpc', {'solver': case.solver, 'seed': case.seed,
                                 **dict(condition.parameters)}, folder / 'mpc.log')
        wait_until_ready(mpc)
        subprocess.run([sys.executable, str(PLANT), *arguments], check=True,
                       timeout=LIMIT * condition.wall + SLACK)
        mpc.end()
    return json.loads(output.read_text())


def wait_until_ready(mpc: Process) -> None:
    """
    Wait until the mpc listens.

    Raises ProcessError if it ends instead, TimeoutError if it takes too long.
    """
    end = time.monotonic() + START
    while not any(READY in line for line in mpc.new_lines()):
        mpc.check()
        if time.monotonic() > end:
            raise TimeoutError(f'the mpc was not ready within {START:g} s')
        time.sleep(0.02)


def reported(record: dict[str, Any]) -> bool:
    """Return whether the mpc warned of a fault, and did not take it back while it lasted."""
    during = [(t, level) for t, name, level, _ in record['reports']
              if 'mpc' in name and record['fault_began'] <= t < record['fault_ended']]
    late = [level for t, level in during if t >= record['fault_began'] + ZERO_WITHIN]
    return any(level for _, level in during) and all(late)


def row(record: dict[str, Any]) -> dict[str, Any]:
    """Return the figures of a run without its time series."""
    figures = {name: value for name, value in record.items()
               if name not in ('states', 'forces', 'reports')}
    figures['reported'] = None if record['fault_ended'] is None else reported(record)
    return figures


def failures(figures: dict[str, Any], fault: bool) -> list[str]:
    """Return in words what must not happen in any run, and did."""
    found = []
    if figures['largest_force'] > FORCE_LIMIT:
        found.append(f'a force of {figures["largest_force"]:.3g} N')
    if not figures['upright']:
        found.append('not upright at the end' if figures['began'] else 'no force at all')
    if fault and figures['began']:
        zero = figures['zero_after']
        if zero is None or zero > ZERO_WITHIN:
            found.append(f'zero force after {seconds(zero)} s of the fault')
        if not figures['reported']:
            found.append('the fault is not in /diagnostics')
    return found


def shortcomings(figures: dict[str, Any], fault: bool) -> list[str]:
    """Return in words what a run lacks of success: its failures, and a slow recovery."""
    found, recovery = failures(figures, fault), figures['recovery']
    if recovery is not None and recovery > RECOVERY_WITHIN:
        found.append(f'upright {recovery:.2f} s after the fault')
    return found


def seconds(time: float | None) -> str:
    """Return a time [s] as text."""
    return '-' if time is None else f'{time:.2f}'


def stored(file: Path, sources: str) -> dict[Case, dict[str, Any]]:
    """Return the runs that a file holds of these sources."""
    found = {}
    for line in file.read_text().splitlines() if file.exists() else ():
        entry = json.loads(line)
        if entry['sources'] == sources:
            found[Case(*entry['case'])] = entry['figures']
    return found


def do(cases: list[Case], file: Path, jobs: int) -> dict[Case, dict[str, Any]]:
    """Do the runs that the file does not hold yet, add each to it, and return all."""
    sources = digest('foreign')
    found = stored(file, sources)
    rest = [case for case in cases if case not in found]
    began = time.monotonic()
    file.parent.mkdir(parents=True, exist_ok=True)
    runs = Parallel(n_jobs=jobs, return_as='generator_unordered')(map(delayed(play), rest))
    for done, (case, figures) in enumerate(runs, 1):
        found[case] = figures
        with file.open('a') as output:
            print(json.dumps({'sources': sources, 'case': case, 'figures': figures}), file=output)
        left = (time.monotonic() - began) / done * (len(rest) - done)
        what = ', '.join(shortcomings(figures, case.condition in FAULTS)) or 'good'
        print(f'{done}/{len(rest)} {case.condition} {case.solver} {case.seed}: {what}; '
              f'{left / 60:.0f} min left', file=sys.stderr, flush=True)
    return found


def rate(successes: Iterable[bool]) -> str:
    """Return a count of successes and Wilson's interval."""
    return share(comparison.rate(list(successes)), 0)


def swing_up_cells(runs: list[dict[str, Any]]) -> list[str]:
    """Return rate, settling, force and late ticks of runs without a fault."""
    settling = [run['settling'] for run in runs if run['upright']]
    return [rate(not shortcomings(run, False) for run in runs),
            f'{np.median(settling):.2f}' if settling else '-',
            f'{max(run["largest_position"] for run in runs):.2f}',
            f'{max(run["largest_force"] for run in runs):.2f}',
            f'{sum(run["late_ticks"] for run in runs)}']


def fault_cells(runs: list[dict[str, Any]]) -> list[str]:
    """Return rate, the longest times, reports, force and late ticks of runs with a fault."""
    def longest(name: str) -> str:
        times = [run[name] for run in runs]
        return '-' if None in times else f'{max(times):.2f}'
    return [rate(not shortcomings(run, True) for run in runs), longest('zero_after'),
            longest('recovery'), f'{sum(bool(run["reported"]) for run in runs)} of {len(runs)}',
            f'{max(run["largest_force"] for run in runs):.2f}',
            f'{sum(run["late_ticks"] for run in runs)}']


SWING_UP = ('condition', 'solver', 'upright', 'median settling [s]', 'largest position [m]',
            'largest force [N]', 'late ticks')
FAULTY = ('fault', 'solver', 'as required', 'longest time to zero force [s]',
          'longest recovery [s]', 'reported', 'largest force [N]', 'late ticks')


def table(titles: tuple[str, ...], cells: Any, names: Iterable[str],
          found: dict[Case, dict[str, Any]]) -> str:
    """Return a table with a row for each condition and solver that was run."""
    lines = [titles]
    for name in names:
        for solver in SOLVERS:
            runs = [figures for case, figures in found.items()
                    if (case.condition, case.solver) == (name, solver)]
            if runs:
                lines.append((ALL[name].title, f'`{solver}`', *cells(runs)))
    return compact(lines) + '\n'


def page(found: dict[Case, dict[str, Any]]) -> str:
    """Return the page as Markdown."""
    faulty = [run for case, run in found.items() if case.condition in FAULTS]
    return '\n'.join([
        '# On a rig that shares nothing with us\n', made('foreign', digest('foreign')),
        f'The rig ({PLANT.name}) imports nothing of this package: a node of rclpy with default '
        'QoS that steps a MuJoCo model at 1 ms against the wall clock, limits the force to '
        f'{FORCE_LIMIT:g} N and the track to 2.4 m, lets the force go 0.25 s after the last '
        'command, and publishes its state at 20 Hz. The mpc is a process of its own with default '
        'parameters. Each run begins hanging, with seeds from 0 on, first attempts only, and ends '
        f'once upright for {HOLD:g} s or after {LIMIT:g} s; upright: both angles within 0.1 rad '
        'and all speeds under 1 (m/s, rad/s) through the last second; settled where that last '
        'stay begins, counted from the first force. In brackets the 95 % interval (Wilson). '
        'Late ticks are those of the rig: more than one and a half periods after the last. The '
        'rows: [foreign.csv.gz](foreign.csv.gz).\n',
        table(SWING_UP, swing_up_cells, [*CONDITIONS, *SIMULATED], found),
        '## A plausible rig\n',
        'Above, the rig is ideal: bodies as the mpc has them, no friction, a force that acts at '
        'once, exact positions and velocities. Here it is that of `config/rig.yaml`, in code of '
        'its own: other bodies, dry friction, commands that act 5 ms late through a motor that '
        'lags by 10 ms, encoders of 4,096 counts, velocities that are differences of positions. '
        'The mpc is told none of it. Figures are of the true state.\n',
        table(SWING_UP, swing_up_cells, RIGS, found),
        '## A sensor that fails\n',
        f'The sensor fails for 1.5 s, {" or ".join(f"{t:g}" for t in FAULT_TIMES)} s after the '
        'first force (even and odd seeds): during the swing-up, or while it holds. Required: '
        f'zero force within {ZERO_WITHIN:g} s and until the fault ends, no force above '
        f'{FORCE_LIMIT:g} N, a warning or an error in /diagnostics all the while, upright again '
        f'within {RECOVERY_WITHIN:g} s of its end. Meanwhile the pendulum swings freely, at times '
        'over the top, so that a recovery can take long. Of all runs '
        f'{rate(not failures(run, True) for run in faulty)} were safe and upright at the end, '
        f'{rate(not shortcomings(run, True) for run in faulty)} in time as well.\n',
        table(FAULTY, fault_cells, FAULTS, found)])


def main() -> None:
    """Do all runs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--conditions', nargs='+', choices=ALL, default=list(ALL), metavar='NAME',
                        help=f'of {", ".join(ALL)}')
    parser.add_argument('--solvers', nargs='+', choices=SOLVERS, default=SOLVERS)
    parser.add_argument('--runs', type=int, default=10, help='of each condition without a fault')
    parser.add_argument('--faulty', type=int, default=6, help='of each fault')
    parser.add_argument('--simulated', type=int, default=2, help='of each simulated clock')
    parser.add_argument('--jobs', type=int, default=2, help='runs at a time')
    parser.add_argument('--rows', type=Path, default=TOP / 'runs' / 'foreign.jsonl',
                        help='file that keeps the runs')
    parser.add_argument('--docs', type=Path, default=TOP / 'docs')
    arguments = parser.parse_args()
    runs = {**dict.fromkeys([*CONDITIONS, *RIGS], arguments.runs),
            **dict.fromkeys(SIMULATED, arguments.simulated),
            **dict.fromkeys(FAULTS, arguments.faulty)}
    cases = [Case(name, solver, seed) for name in arguments.conditions
             for solver in arguments.solvers for seed in range(runs[name])]
    every = do(cases, arguments.rows, arguments.jobs)
    found = {case: every[case] for case in cases}
    results = arguments.docs / 'results'
    results.mkdir(parents=True, exist_ok=True)
    pd.DataFrame([{**case._asdict(), **figures} for case, figures in found.items()]).to_csv(
        results / 'foreign.csv.gz', index=False)
    (results / 'foreign.md').write_text(page(found), encoding='utf-8')


if __name__ == '__main__':
    main()
