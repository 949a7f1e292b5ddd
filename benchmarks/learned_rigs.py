# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Who holds rigs of other make: the equations with an estimator, or what swing-ups have taught.

Of some rigs the equations lack nothing: what is wrong are numbers, and their estimator finds them.
Of the others, of unmodelled.py, they lack the structure.

Run by `make results`.
"""

from collections.abc import Sequence
from typing import Any

from campaigns import DURATION, informed
from joblib import delayed, Memory
from learned import in_parallel
from matplotlib.figure import Figure
import numpy as np
from rig import ORACLES, Rig, settling
from stamp import asked, made, sources
from unmodelled import ADDED, Along, Beside, engines, exact, UnevenRig

from dp_swing_ros import provenance
from dp_swing_ros.control import controllers
from dp_swing_ros.control.receding_horizon import RecedingHorizon
from dp_swing_ros.evaluation.campaign.contestants import Contestant, play
from dp_swing_ros.evaluation.campaign.report import difference, interval, probability, share
from dp_swing_ros.evaluation.campaign.rows import grouped, Row, store
from dp_swing_ros.evaluation.campaign.summary import common, duel
from dp_swing_ros.evaluation.comparison import rate
from dp_swing_ros.evaluation.scenarios import Case
from dp_swing_ros.figures.style import as_share, FAINT, INK, name_lines, PALETTE, PAPER, styled
from dp_swing_ros.learning.experience import Experience
from dp_swing_ros.learning.models import learned, parted
from dp_swing_ros.learning.recorded import stretches_of
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.parameters import Drive
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.problem.plan import Plan
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate
from dp_swing_ros.tables import compact

RIGS = (Rig('rig_cart', 4.0), Rig('rig_joints', 0.05), Rig('rig_lag', 0.05), Rig('rig_gain'),
        Rig('rig_all'), UnevenRig('beside'), UnevenRig('along'))
SEEDS = 12
SOLVER = 'ilqr'
RUNS = (1, 5)       # of which is learned
OTHER, APART = 1000, 100   # seeds further, and apart, are the runs that are learned from
# as the contestants come; those that learned have one colour
LOOKS = ((INK, 'o'), (FAINT, 'o'), (PALETTE[0], 's'), (PALETTE[0], 'D'), (PALETTE[2], '^'))
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
        self.X.append(np.where(np.isnan(x), self.controller.belief.x, x))
        self.U.append(plan.first_force(self.controller.nominal.u_max))
        return plan

    def fallback(self, begins: float) -> Plan:
        """Return its plan where no state came."""
        return self.controller.fallback(begins)

    def experience(self, drive: Drive) -> list[Experience]:
        """Return what there is to learn from, by a drive."""
        t, X, U = map(np.array, (self.t, self.X, self.U))
        limits = self.controller.nominal.parameters.limits
        return stretches_of(t, X, t, U, limits.track_limit, drive)


def swing_up(case: Case, seed: int) -> Watched:
    """Return what an mpc with the defaults was told and did on a rig, with a seed of its own."""
    watched = Watched(controllers.controller({'solver': SOLVER, 'seed': seed}))
    simulate(plants.plant({**case.plant, 'seed': seed}), watched, case.duration)
    return watched


def contestants(case: Case, counts: Sequence[int] = RUNS) -> list[Contestant]:
    """Return who is to hold a rig: told nothing, learned from so many runs, or told all."""
    found = [Contestant(ESTIMATING, SOLVER, {}, {})]
    if case.plant.get('velocities') != 'none':   # else none can do without an estimator
        found.append(Contestant(ALONE, SOLVER, {}, {'estimator': 'none'}))
    runs = [swing_up(case, OTHER + number * APART + case.seed)
            for number in range(max(counts, default=0))]
    for count in counts:
        last = runs[count - 1].controller   # what it believes in the end, as `train` has it
        known = Pendulum.of(last.belief.problem.physical)
        drive = Drive(last.belief.drive.delay, last.belief.drive.time_constant)
        seen = [stretch for run in runs[:count] for stretch in run.experience(drive)]
        model = learned(known, parted(seen, case.seed), drive=drive)
        found.append(Contestant(label(count), SOLVER, {},
                                {'dynamics': 'learned', 'model': model.to_text()}))
    truth = {'dynamics': 'learned', 'model': exact(case).to_text()} \
        if case.plant['engine'] in ADDED else ORACLES[ORACLE]
    return [*found, Contestant(ORACLE, SOLVER, {}, truth)]


def label(runs: int) -> str:
    """Return what one is called that has learned from so many swing-ups."""
    return f'learned, {runs} swing-up{"s" if runs > 1 else ""}'


def played(case: Case, counts: Sequence[int] = RUNS) -> list[Row]:
    """Return a row for each contestant on a rig."""
    with np.errstate(all='ignore'), engines():
        is_told = case.plant['engine'] not in ADDED   # else its model is
        return [play(one, informed(case) if is_told and one.label == ORACLE else case)
                for one in contestants(case, counts)]


Groups = dict[Rig, dict[str, list[Row]]]


def by_rig(rows: Sequence[Row]) -> Groups:
    """Return the rows by rig, and then by contestant."""
    return {rig: grouped(of_rig, lambda row: row.key.contestant) for rig, of_rig in grouped(
        rows, lambda row: Rig(row.key.scenario, row.key.level)).items()}


@styled
def picture(groups: Groups) -> Figure:
    """Draw what each holds of each rig, and when it has settled, with intervals."""
    names = list(dict.fromkeys(name for of_rig in groups.values() for name in of_rig))
    looks = {name: {'color': colour, 'marker': marker, 'linewidth': 1.4, 'markersize': 4.7,
                    'markevery': [1]} for name, (colour, marker) in zip(names, LOOKS)}
    pitch = len(names) + 1
    figure = Figure(figsize=(8.4, 1.3 + 0.15 * pitch * len(groups)), layout='constrained')
    held, settled = figure.subplots(1, 2, sharey=True)
    for n, of_rig in enumerate(groups.values()):
        if n % 2 == 0:
            for axes in (held, settled):
                axes.axhspan(n * pitch - 1, (n + 1) * pitch - 1, color=PAPER, zorder=0)
        for name, rows in of_rig.items():
            y = [n * pitch + names.index(name)] * 3
            found, took = rate([row.metrics.success for row in rows]), settling(rows)
            held.plot([found.low, found.successes / found.runs, found.high], y, **looks[name],
                      clip_on=False)
            settled.plot([took.low, took.value, took.high], y, **looks[name])
    held.set_yticks(pitch * np.arange(len(groups)) + (len(names) - 1) / 2,
                    [str(rig).strip('`').replace('`,', ',\n') for rig in groups])
    held.set(ylim=(pitch * len(groups) - 1, -1), xlabel='held')
    for axes in (held, settled):
        axes.tick_params('y', length=0)
        axes.grid(True, axis='x')
    as_share(held, 'x')
    settled.set(xlim=(0, None), xlabel='median settling time [s]')
    name_lines(figure, looks, entry=2.0)
    figure.suptitle('What swing-ups teach of a rig')
    return figure


def page(groups: Groups, made: str) -> str:
    """Return the page."""
    lines = []
    for rig, by_label in groups.items():
        for name, of in by_label.items():
            line = [str(rig), name, share(rate([row.metrics.success for row in of])),
                    interval(settling(of), '.2f')]
            if name != ESTIMATING:
                one = duel(rig.scenario, name, ESTIMATING, common(of, by_label[ESTIMATING]))
                line += [str(one.first_only), str(one.second_only), probability(one.p),
                         difference(one.differences['settling_time'])]
            lines.append((*line, *[''] * (8 - len(line))))
    return '\n'.join([
        '# Of rigs of other make\n', made,
        f'{DURATION:g} s from nearly hanging, moved by MuJoCo, controlled by `{SOLVER}`, and what '
        'is wrong is told to nobody. First the rigs of [evaluate](../evaluation.md#scenarios), '
        'where the equations of the mpc lack nothing: what is wrong are numbers, all of which its '
        'estimator seeks. Then two that are chains of links as well, but no rods with their mass '
        f'about the middle: of `rig_beside` each centre of mass lies {100 * Beside.beside:g} cm '
        f'beside the line of the joints, of `rig_along` at {100 * Along.along:g} % of the length. '
        'No masses and lengths make the equations those.\n',
        'Each rig meets the mpc with its defaults, whose estimator learns parameters as it goes, '
        'and the same without an estimator; then [learned dynamics](../learned_dynamics.md) of '
        f'one run of {DURATION:g} s by the first of these, held or not, on the same rig with '
        f'another seed, and of {max(RUNS)}; last, one that is told all. Each seed has models of '
        'its own. Beside each stands how it compares with the first on the same seeds. In '
        'brackets the 95 % interval, by Wilson of what is held, by the bootstrap of a median of '
        'what was held. Rows: `results/learned_rigs.csv.gz`.\n',
        '![What each holds of each rig, and how soon](../figures/learned_rigs.png)\n',
        compact([('rig', 'mpc', 'held', 'median settling [s]', 'only it held',
                  'only the first held', 'p', 'settling less than the first [s]'), *lines]), ''])


def main(argv: Sequence[str] | None = None) -> None:
    """Play all rigs, and write the page."""
    seeds, results, figures = asked(__doc__, argv, SEEDS)
    digest = sources('learned_rigs')
    # to go on with; beside what `make results` keeps of this page, and forgets with it
    kept = Memory(results.parents[1] / f'played_{digest}', verbose=0)
    play_kept = delayed(kept.cache(played))
    calls: list[Any] = [play_kept(case) for rig in RIGS for case in rig.cases(range(seeds))]
    rows = [row for of in in_parallel('rigs', calls) for row in of]
    store(results / 'learned_rigs.csv.gz', rows)
    groups = by_rig(rows)
    picture(groups).savefig(figures / 'learned_rigs.png')
    (results / 'learned_rigs.md').write_text(page(groups, made(
        'learned_rigs', digest, (*provenance.COMPUTING, 'mujoco'))), encoding='utf-8')


if __name__ == '__main__':
    main()
