# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Faults that befall running processes, one after the other, and how soon the pendulum is up again.

Run by `make results`, on a machine that must do nothing else.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
import math
from pathlib import Path
import signal
import tempfile
import time
from typing import NamedTuple

from campaigns import METHODS
import faults
from live_operator import Operator
import numpy as np
import pandas as pd
from stamp import made, sources, store_page, TOP
from std_msgs.msg import Float64
from std_srvs.srv import Trigger
from tqdm import tqdm

from dp_swing_ros.control import controllers
from dp_swing_ros.evaluation.campaign.report import share
from dp_swing_ros.evaluation.comparison import rate
from dp_swing_ros.nodes.connections import publish
from dp_swing_ros.pendulum.state import deviation, upright
from dp_swing_ros.tables import compact
from dp_swing_ros.tools.processes import Crew, isolated, Process
from dp_swing_ros.topics import DISTURBANCE, FORCE_COMMAND

RUNS = 2          # of each fault and solver
DOWN = 0.2        # [rad] of an angle, beyond which it is down
STAYS = 1.0       # [s] within that: up again
ALLOWED = 10.0    # [s] after the end of a fault
SWING_UP = 20.0   # [s] for the first
BETWEEN = 2.0     # [s] up before the next fault
LASTS = 3.0       # [s], of faults of the network
THROUGH = {'joint_states': 'faults/joint_states', 'force_command': 'faults/force_command'}


class Recovery(NamedTuple):
    """What came of a fault."""

    solver: str
    fault: str
    run: int
    largest: float    # [rad] of an angle since it began
    again: float      # [s] from its end until it was up again, 0 if never down, NaN for too late
    not_finite: int   # forces on the topic
    beyond: int       # forces on the topic beyond the limit


class Bench:
    """Plant, mpc and what stands between them, and what can befall them."""

    def __init__(self, crew: Crew, operator: Operator, solver: str, folder: Path) -> None:
        """Start them, and wait until the pendulum is up; raises TimeoutError or ProcessError."""
        self.crew, self.operator, self.solver, self.folder = crew, operator, solver, folder
        self.pushes = publish(operator.node, DISTURBANCE)
        crew.start('faults', {}, folder / 'faults.log', script=Path(faults.__file__))
        self.mpc, self.plant = self.start_mpc(), None
        if not operator.until(lambda: operator.node.count_subscribers('faults/joint_states') > 0):
            raise TimeoutError('the mpc does not come up')
        self.plant = self.start_plant()
        if not operator.until(lambda: self.is_up(time.monotonic() - STAYS), SWING_UP):
            raise TimeoutError(f'not up after {SWING_UP:g} s')

    def start_mpc(self) -> Process:
        """Start an mpc behind the faults."""
        return self.crew.start('mpc', {'solver': self.solver}, self.log('mpc'),
                               remappings=THROUGH)

    def start_plant(self) -> Process:
        """Start a plant."""
        return self.crew.start('plant', {}, self.log('plant'))

    def log(self, name: str) -> Path:
        """Return a file for another log."""
        return self.folder / f'{name}_{len(list(self.folder.glob(f"{name}_*")))}.log'

    def deviations(self, since: float) -> list[tuple[float, float]]:
        """Return when [s] and by how much [rad] the angles were off, since a time."""
        found, goal = [], upright(self.operator.links)
        for state in reversed(self.operator.states):
            if state.at < since:
                break
            found.append((state.at, float(deviation(state.x, goal))))
        return found[::-1]

    def is_up(self, since: float) -> bool:
        """Return whether it has been up since a time [s], and states came until now."""
        seen = self.deviations(since)
        return (len(seen) > 0.8 * 20 * (time.monotonic() - since)
                and all(off <= DOWN for _, off in seen))

    @contextmanager
    def network(self, **values: float) -> Iterator[None]:
        """Let the node between them make faults."""
        self.operator.put('faults', **values)
        yield
        self.operator.put('faults', **dict.fromkeys(values, 0.0))

    def kill_mpc(self) -> None:
        """Kill the mpc, and start another."""
        self.mpc.kill()
        self.operator.wait(0.5)
        self.mpc = self.start_mpc()

    def kill_plant(self) -> None:
        """Kill the plant, and start another, which hangs."""
        self.plant.kill()
        self.operator.wait(0.5)
        count = len(self.operator.states)
        self.plant = self.start_plant()
        self.operator.until(lambda: len(self.operator.states) > count)

    def reset_plant(self) -> None:
        """Reset the plant: it hangs."""
        self.operator.call(Trigger, 'plant/reset')

    def stop_mpc(self) -> None:
        """Stop the process of the mpc for two seconds, and let it go on."""
        self.mpc.signal(signal.SIGSTOP)
        self.operator.wait(2.0)
        self.mpc.signal(signal.SIGCONT)

    def lose(self) -> None:
        """Lose 30 % of states and forces."""
        with self.network(state_loss=0.3, command_loss=0.3):
            self.operator.wait(LASTS)

    def double_and_reorder(self) -> None:
        """Double and reorder 30 % of states and forces."""
        with self.network(state_duplication=0.3, command_duplication=0.3,
                          state_reordering=0.3, command_reordering=0.3):
            self.operator.wait(LASTS)

    def jitter(self) -> None:
        """Let states and forces come late by up to 20 ms each."""
        with self.network(state_jitter=0.02, command_jitter=0.02):
            self.operator.wait(LASTS)

    def nan(self) -> None:
        """Send NaN for states for 0.3 s."""
        with self.network(state_nan=1.0):
            self.operator.wait(0.3)

    def second_master(self) -> None:
        """Command 10 N to and fro for a second, beside the mpc."""
        other = publish(self.operator.node, FORCE_COMMAND)
        end, n = time.monotonic() + 1.0, 0
        while time.monotonic() < end:
            other.publish(Float64(data=10.0 * math.sin(0.5 * n)))
            self.operator.wait(0.05)
            n += 1
        self.operator.node.destroy_publisher(other)

    def push(self) -> None:
        """Push with 10 N for 0.1 s."""
        for _ in range(2):
            count = len(self.operator.states)
            self.pushes.publish(Float64(data=10.0))
            self.operator.until(lambda: len(self.operator.states) > count)


FAULTS: dict[str, Callable[[Bench], None]] = {
    'mpc killed and restarted': Bench.kill_mpc,
    'plant killed and restarted': Bench.kill_plant,
    'plant reset': Bench.reset_plant,
    'mpc stopped for 2 s': Bench.stop_mpc,
    '30 % loss both ways, 3 s': Bench.lose,
    '30 % doubled and 30 % reordered both ways, 3 s': Bench.double_and_reorder,
    '0 to 20 ms jitter both ways, 3 s': Bench.jitter,
    'states of NaN, 0.3 s': Bench.nan,
    'a second master, 10 N to and fro, 1 s': Bench.second_master,
    '10 N for 0.1 s': Bench.push}


def befall(bench: Bench, fault: str, run: int, limit: float) -> Recovery:
    """Let a fault befall what is up, and see how soon it is up again."""
    operator = bench.operator
    began, forces = time.monotonic(), len(operator.forces)
    FAULTS[fault](bench)
    ended = time.monotonic()
    operator.until(lambda: time.monotonic() > ended + STAYS
                   and bench.is_up(time.monotonic() - STAYS), ALLOWED + STAYS)
    seen = bench.deviations(began)
    down = [at for at, off in seen if off > DOWN]
    again = max(down[-1] - ended, 0.0) if down else 0.0
    if not bench.is_up(time.monotonic() - STAYS):
        again = math.nan
    sent = np.array([force for _, force in operator.forces[forces:]])
    return Recovery(bench.solver, fault, run, max((off for _, off in seen), default=math.nan),
                    again, int(np.sum(~np.isfinite(sent))), int(np.sum(np.abs(sent) > limit)))


def play(solver: str, runs: int, folder: Path) -> Iterator[Recovery]:
    """Let all faults befall a solver so many times; after one it does not survive, begin anew."""
    limit = controllers.MPC.complete({})['force_limit']
    left = [(fault, run) for run in range(runs) for fault in FAULTS]
    with tqdm(total=len(left), desc=solver, disable=None) as bar:
        while left:
            own = Path(tempfile.mkdtemp(dir=folder))
            with Crew() as crew, Operator() as operator:
                bench = Bench(crew, operator, solver, own)
                while left:
                    fault, run = left.pop(0)
                    found = befall(bench, fault, run, limit)
                    bar.update()
                    yield found
                    if math.isnan(found.again):
                        break
                    operator.wait(BETWEEN)


def page(rows: pd.DataFrame, made: str) -> str:
    """Return the page as Markdown."""
    lines = []
    for (fault, solver), of in rows.groupby(['fault', 'solver'], sort=False):
        in_time = of.again <= ALLOWED
        lines.append((
            fault, f'`{solver}`', share(rate(in_time.tolist())),
            str(int((of.largest <= DOWN).sum())), f'{of.again.median():.1f}',
            f'{of.again.max():.1f}' if in_time.all() else '-', f'{of.largest.max():.2f}',
            str(int(of.not_finite.sum())), str(int(of.beyond.sum()))))
    return '\n'.join([
        '# Faults of running processes\n', made,
        'Plant, [faults](../nodes.md#faults-between-plant-and-mpc) and mpc as processes at 20 Hz, '
        f'with their defaults. Each fault befalls a pendulum that has been up for {BETWEEN:g} s; '
        f'it is up while all angles are within {DOWN:g} rad of upright, and up again when it '
        f'stays so for {STAYS:g} s. To be up again within {ALLOWED:g} s of the end of the fault '
        'is the aim; a process that was killed is started 0.5 s later, and takes its time to load '
        'from then on; a plant that is started, or reset, hangs. In brackets the 95 % interval '
        '(Wilson). Not finite and beyond the limit are forces on `force_command`, all that were '
        'sent by anybody. Rows: `results/live_faults.csv.gz`.\n',
        compact([('fault', 'solver', f'up again within {ALLOWED:g} s', 'never down',
                  'median until up [s]', 'longest [s]', 'largest angle [rad]', 'not finite',
                  'beyond the limit'), *lines]), ''])


def main(argv: Sequence[str] | None = None) -> None:
    """Play all faults, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--runs', type=int, default=RUNS, help='of each fault and solver')
    parser.add_argument('--solvers', nargs='+', default=METHODS)
    parser.add_argument('--docs', type=Path, default=TOP / 'results')
    arguments = parser.parse_args(argv)
    with isolated(), tempfile.TemporaryDirectory() as folder:
        rows = pd.DataFrame([found for solver in arguments.solvers
                             for found in play(solver, arguments.runs, Path(folder))])
    store_page('live_faults', rows, page(rows, made('live_faults', sources('live_faults'))),
               arguments.docs)


if __name__ == '__main__':
    main()
