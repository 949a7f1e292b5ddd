# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Who holds rigs of other make: the equations with an estimator, or what swing-ups have taught.

Run by `make results`.
"""

from collections.abc import Sequence
from typing import Any

from campaigns import DURATION
from joblib import delayed, Memory
from learned import in_parallel
import numpy as np
from rig import Rig, told
from stamp import asked, made, sources_with

from dp_swing_ros import configuration, provenance
from dp_swing_ros.control.receding_horizon import RecedingHorizon
from dp_swing_ros.evaluation.campaign.contestants import Contestant, play
from dp_swing_ros.evaluation.campaign.report import difference, interval, probability, share
from dp_swing_ros.evaluation.campaign.rows import grouped, Row, store
from dp_swing_ros.evaluation.campaign.summary import common, duel
from dp_swing_ros.evaluation.comparison import median, rate
from dp_swing_ros.evaluation.scenarios import Case
from dp_swing_ros.learning.experience import Experience
from dp_swing_ros.learning.models import learned, parted
from dp_swing_ros.learning.recorded import stretches_of
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.parameters import Drive
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.plan import Plan
from dp_swing_ros.simulation.closed_loop import simulate
from dp_swing_ros.tables import compact

FILES = ('learned_rigs.py', 'learned.py', 'rig.py', 'campaigns.py')
RIGS = (Rig('rig_cart', 4.0), Rig('rig_joints', 0.05), Rig('rig_lag', 0.05), Rig('rig_gain'),
        Rig('rig_all'))
SEEDS, OF_RESIDUAL = 100, 34
SOLVER = 'ilqr'
RUNS = (1, 5)       # of which is learned
OTHER = 1000        # seeds further are those of the runs that are learned from
HIDDEN = 8
ESTIMATING, ALONE, ORACLE = 'equations, estimator', 'equations alone', 'told'


class Watched:
    """A controller, and what it was told and did."""

    def __init__(self, controller: RecedingHorizon) -> None:
        """Take the controller."""
        self.controller = controller
        self.t, self.X, self.U = list[float](), list[Array](), list[float]()

    def update(self, t: float, x: Array, delay: float) -> Plan:
        """Return its plan; speeds that are not measured are those that it believes in."""
        plan = self.controller.update(t, x, delay)
        self.t.append(t)
        self.X.append(np.where(np.isnan(x), self.controller.x, x))
        self.U.append(plan.first_force(self.controller.nominal.u_max))
        return plan

    def fallback(self, begins: float) -> Plan:
        """Return its plan where no state came."""
        return self.controller.fallback(begins)

    def experience(self, drive: Drive) -> list[Experience]:
        """Return what there is to learn from, by a drive."""
        t, X, U = map(np.array, (self.t, self.X, self.U))
        return stretches_of(t, X, t, U, self.controller.nominal.given[0].track_limit, drive)


def swing_up(case: Case, seed: int) -> Watched:
    """Return what an mpc with the defaults was told and did on a rig, with a seed of its own."""
    watched = Watched(configuration.controller({'solver': SOLVER, 'seed': seed}))
    simulate(configuration.plant({**case.plant, 'seed': seed}), watched, case.duration)
    return watched


def contestants(case: Case, kinds: Sequence[str]) -> list[Contestant]:
    """Return who is to hold a rig: that is told nothing, has learned, or is told all."""
    found = [Contestant(ESTIMATING, SOLVER, {}, {})]
    if case.plant.get('velocities') != 'none':   # else none can do without an estimator
        found.append(Contestant(ALONE, SOLVER, {}, {'estimator': 'none'}))
    runs = [swing_up(case, OTHER + number * SEEDS + case.seed) for number in range(max(RUNS))]
    for kind in kinds:
        for count in RUNS:
            last = runs[count - 1].controller   # what it believes in the end, as `train` has it
            known = Pendulum.of(last.problem.physical)
            drive = Drive(last.drive.delay, last.drive.time_constant)
            seen = [stretch for run in runs[:count] for stretch in run.experience(drive)]
            model = learned(kind, known, parted(seen, case.seed), HIDDEN, case.seed, drive=drive)
            found.append(Contestant(label(kind, count), SOLVER, {},
                                    {'dynamics': 'learned', 'model': model.to_text()}))
    return [*found, Contestant(ORACLE, SOLVER, {}, told(ORACLE, SOLVER, case).mpc)]


def label(kind: str, runs: int) -> str:
    """Return what one is called that has learned from so many swing-ups."""
    return f'{kind}, {runs} swing-up{"s" if runs > 1 else ""}'


def played(case: Case, kinds: Sequence[str]) -> list[Row]:
    """Return a row for each contestant on a rig."""
    with np.errstate(all='ignore'):
        return [play(contestant, case) for contestant in contestants(case, kinds)]


def page(rows: Sequence[Row], made: str) -> str:
    """Return the page from all rows."""
    lines = []
    for rig, of_rig in grouped(rows, lambda row: Rig(row.key.scenario, row.key.level)).items():
        by_label = grouped(of_rig, lambda row: row.key.contestant)
        for name, of in by_label.items():
            settled = median(np.array([row.metrics.settling_time for row in of
                                       if row.metrics.success]))
            line = [str(rig), name, share(rate([row.metrics.success for row in of])),
                    interval(settled, '.2f')]
            if name != ESTIMATING:
                one = duel(rig.scenario, name, ESTIMATING, common(of, by_label[ESTIMATING]))
                line += [str(one.first_only), str(one.second_only), probability(one.p),
                         difference(one.differences['settling_time'])]
            lines.append((*line, *[''] * (8 - len(line))))
    return '\n'.join([
        '# Learned dynamics on rigs of other make\n', made,
        f'{DURATION:g} s from nearly hanging of the scenarios `rig_*` of [evaluate]'
        f'(../evaluation.md#scenarios): MuJoCo moves the pendulum, `{SOLVER}` controls it, and '
        'what is wrong is told to nobody. First the mpc with its defaults, whose estimator learns '
        'parameters as it goes, and the same without an estimator; then [learned dynamics]'
        '(../learned_dynamics.md) of one swing-up by the first of these, on the same rig with '
        f'another seed, and of {max(RUNS)}; last, one that is told all. Each seed has models of '
        'its own. Beside each stands how it compares with the first on the same seeds. In '
        'brackets the 95 % interval, by Wilson of what is held, by the bootstrap of a median. The '
        'rows: [learned_rigs.csv.gz](learned_rigs.csv.gz).\n',
        compact([('rig', 'mpc', 'held', 'median settling [s]', 'only it held',
                  'only the first held', 'p', 'settling less than the first [s]'), *lines]), ''])


def main(argv: Sequence[str] | None = None) -> None:
    """Play all rigs, and write the page."""
    seeds, results, _ = asked(__doc__, argv, SEEDS)
    sources = sources_with(*FILES)
    # to go on with; beside what `make results` keeps of this page, and forgets with it
    kept = Memory(results.parents[1] / f'played_{sources}', verbose=0)
    play_kept = delayed(kept.cache(played))
    calls: list[Any] = [
        play_kept(case, ('structured', 'residual')[:1 + (case.seed < OF_RESIDUAL)])
        for rig in RIGS for case in rig.cases(range(seeds))]
    rows = [row for of in in_parallel('rigs', calls) for row in of]
    store(results / 'learned_rigs.csv.gz', rows)
    (results / 'learned_rigs.md').write_text(page(rows, made(
        'learned_rigs', sources, (*provenance.COMPUTING, 'mujoco'))),
        encoding='utf-8')


if __name__ == '__main__':
    main()
