# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Who holds a rig whose model is wrong, and is told so by nobody.

MuJoCo moves the rigs, see unmodelled.py; sensors are exact but for what is said of them, and
speeds are measured.

Run by `make results`.
"""

import argparse
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
import math
from pathlib import Path
from typing import Any

from campaigns import CERTAIN, DURATION, METHODS
from joblib import delayed
from learned import in_parallel
from matplotlib.figure import Figure
import numpy as np
from rig import CENTRED, settling
from stamp import folders, made, sources
from unmodelled import CHANGE, Encoders, engines, Misread, off_zero, WithPlay

from dp_swing_ros import provenance
from dp_swing_ros.evaluation.campaign.contestants import Contestant, measured, simulated
from dp_swing_ros.evaluation.campaign.report import interval, probability, share
from dp_swing_ros.evaluation.campaign.rows import grouped, Row, store
from dp_swing_ros.evaluation.campaign.summary import common, duel
from dp_swing_ros.evaluation.comparison import rate
from dp_swing_ros.evaluation.metrics import Metrics
from dp_swing_ros.evaluation.scenarios import Case, LIMITS, of_each, PERIOD, rig
from dp_swing_ros.figures.style import (
    as_share, FAINT, INK, name_lines, PALETTE, PAPER, solver_name, styled)
from dp_swing_ros.parameters import group
from dp_swing_ros.pendulum.equations import scale_of
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import DEFAULT_LINKS
from dp_swing_ros.simulation.closed_loop import Controller
from dp_swing_ros.simulation.plants import PLANT
from dp_swing_ros.tables import compact

SEEDS = 20
SIZES = {1.0: 20.0, 0.2: 200.0}   # [m] of each link: [Hz]
DEFAULT = 'default'
CONTESTANTS: dict[str, dict[str, Any]] = {
    DEFAULT: {}, 'no_adaptation': {'ekf.adaptation': 0.0}, 'state_alone': CERTAIN,
    'no_estimator': {'estimator': 'none'}, 'adaptive': {'dynamics': 'adaptive'}}
CELLS = [cell for cell in product(SIZES, METHODS, CONTESTANTS)   # of the page
         if cell[2] == DEFAULT or cell[:2] == (1.0, 'ilqr')]
LOOKS = dict(zip(CONTESTANTS, (
    (INK, 'o'), (PALETTE[0], 's'), (PALETTE[2], '^'), (FAINT, 'D'), (PALETTE[1], 'v'))))
AGAIN = 3.0            # [s] scaled, in which a link that was changed is to be held again
KNOCKS, KNOCKED = (15.0, 25.0), 0.1   # [N, s] scaled, of the cart by who changes a link
TWICE, LENGTHS = (0.5, 2.0), (0.8, 1.2)   # factors of what is told
DRY = {'cart_dry_friction': 2.0, **dict.fromkeys(   # [N, N m] scaled
    of_each('joint{}_dry_friction', DEFAULT_LINKS), 0.02)}
SPRUNG = {**dict.fromkeys(of_each('joint{}_stiffness', DEFAULT_LINKS), 0.3),
          'joint1_preload': 0.3 * math.pi}   # [N m/rad, N m] scaled
BODIES, SHOVES = 6, 7  # before the seed; see scenarios.py


@dataclass(frozen=True)
class WrongModel:
    """
    A rig, and what is asked of it beside that it is held.

    `plant` is as of a Case, and so are `pushes`, by seed; `encoders` are what the controller sees
    it through, by seed; `told` what that is told of a pendulum, by seed.
    """

    about: str
    engine: str = 'mujoco'
    plant: Mapping[str, Any] = field(default_factory=dict)
    pushes: Callable[[int], tuple[float, ...]] = lambda seed: ()
    encoders: Callable[[int], Encoders] | None = None
    told: Callable[[int, PendulumParameters], dict[str, Any]] = lambda seed, nominal: {}
    settled_by: float = math.inf   # [s] scaled
    centred: float = math.inf      # [m] scaled, of the cart over the last seconds

    def is_as_asked(self, metrics: Metrics, size: float) -> bool:
        """Return whether a run was held, and all else that is asked."""
        scale = scale_of(pendulum(size))
        return (metrics.success and metrics.settling_time <= scale.sized(self.settled_by, 's')
                and metrics.rest_offset <= scale.sized(self.centred, 'm'))


def knock(seed: int) -> tuple[float, ...]:
    """Return pushes [N] of which there is one, as a link is changed, either way."""
    random, t = np.random.default_rng((SHOVES, seed)), (
        PERIOD * (np.arange(round(DURATION / PERIOD)) + 0.5))
    force = random.choice((-1.0, 1.0)) * random.uniform(*KNOCKS)
    return tuple(np.where((t > CHANGE) & (t < CHANGE + KNOCKED), force, 0.0).tolist())


def told_wrongly(seed: int, nominal: PendulumParameters) -> dict[str, Any]:
    """
    Return masses, frictions and a gain that are half or twice of what is, and other lengths.

    The rig stays what its drive can swing up; were it half as strong and twice as heavy, nobody
    could.
    """
    random, scale = np.random.default_rng((BODIES, seed)), scale_of(nominal)
    known = PLANT.fields(nominal.links)
    true = {name: getattr(nominal, name) for name in (
        'cart_mass', *of_each('link{}_mass', nominal.links))}
    true |= {name: scale.sized(value, known[name].metadata['unit'])
             for name, value in DRY.items()}
    told = {name: value * random.choice(TWICE)
            for name, value in {**true, 'force_gain': 1.0}.items()}
    return told | {name: getattr(nominal, name) * random.uniform(*LENGTHS)
                   for name in of_each('link{}_length', nominal.links)}


RIGS = {
    'beside': WrongModel('mass 3 cm beside the line of the joints', 'beside'),
    'along': WrongModel('mass at 65 % of the length', 'along'),
    'springs': WrongModel('joint springs of 0.3 N m/rad, at ease hanging', plant=SPRUNG),
    'cable': WrongModel('a spring on the cart, 5 N/m', 'cable'),
    'cogging': WrongModel('cogging of 1 N every 2 cm', 'cogging'),
    'zeros': WrongModel('encoder zeros off by 2°, rail tilted by 1°', 'tilted', encoders=off_zero,
                        centred=CENTRED),
    'backlash': WrongModel('backlash of 1° in joint 1', encoders=WithPlay),
    'sticking': WrongModel('a bearing of joint 1 that sticks', 'sticking',
                           {'joint1_dry_friction': 0.05}),
    'bodies': WrongModel('masses, dry frictions and gain told as half or twice, lengths up to '
                         '20 % off', plant=DRY, told=told_wrongly),
    'changed': WrongModel('50 % of its mass added to the end of link 2', 'changed',
                          settled_by=CHANGE + AGAIN),
    'knocked': WrongModel('the same, and the cart knocked as it is added', 'changed',
                          pushes=knock, settled_by=CHANGE + AGAIN)}


@dataclass(frozen=True)
class Behind(Contestant):
    """A contestant behind encoders, which depend on the seed."""

    encoders: Callable[[int], Encoders]

    def prepare(self) -> Callable[[int], Controller]:
        """Return what makes the controller for a seed; see Contestant."""
        make = super().prepare()
        return lambda seed: Misread(self.encoders(seed), make(seed))


def bodies(size: float) -> dict[str, float]:
    """Return what has to be told of links so long [m]."""
    return dict.fromkeys(of_each('link{}_length', DEFAULT_LINKS), size)


def pendulum(size: float) -> PendulumParameters:
    """Return the pendulum with links so long [m]."""
    return group(PendulumParameters, bodies(size))


def episode(name: str, size: float, solver: str, kind: str,
            seed: int) -> tuple[Contestant, Case]:
    """Return the episode of a seed: a rig with links so long [m], a solver, who holds it."""
    model = RIGS[name]
    of = (f'{solver}, {kind}', solver, {**bodies(size), 'rate': SIZES[size]},
          {**bodies(size), **CONTESTANTS[kind]})
    contestant = Contestant(*of) if model.encoders is None else Behind(*of, model.encoders)
    case = rig(Case(name, seed, DURATION, 'size', size,
                    plant={'engine': model.engine, **model.plant}, pushes=model.pushes(seed)),
               DEFAULT_LINKS)
    told = model.told(seed, pendulum(size))
    if told:   # else its limits would go with what it is told
        case = replace(case, told=vars(LIMITS), mpc=told)
    return contestant, case


def played(contestant: Contestant, case: Case) -> Row:
    """Return the row of an episode."""
    with np.errstate(all='ignore'), engines():
        return measured(contestant, case, simulated(contestant, case))


def cell(row: Row) -> tuple[str, float, str, str]:
    """Return rig, size, solver and contestant of a row."""
    size = row.key.level
    assert size is not None
    solver, kind = row.key.contestant.split(', ')
    return row.key.scenario, size, solver, kind


def table(rows: Sequence[Row]) -> str:
    """Return a line for each rig, size, solver and contestant."""
    return compact([('rig', 'links [m]', 'solver', 'mpc', 'held', 'as asked',
                     'median settling [s]', 'only it held', 'only the default held', 'p'),
                    *lines(rows)])


def lines(rows: Sequence[Row]) -> Iterator[tuple[str, ...]]:
    """Yield the lines of the table."""
    groups = grouped(rows, cell)
    for (name, size, solver, kind), of in groups.items():
        asked = [RIGS[name].is_as_asked(row.metrics, size) for row in of]
        line = [f'`{name}`', f'{size:g}', f'`{solver}`', f'`{kind}`',
                share(rate([row.metrics.success for row in of])), share(rate(asked)),
                interval(settling(of), '.2f')]
        default = groups.get((name, size, solver, DEFAULT), [])
        if kind != DEFAULT and default:
            one = duel(name, kind, DEFAULT, common(of, default))
            line += [str(one.first_only), str(one.second_only), probability(one.p)]
        yield (*line, *[''] * (10 - len(line)))


@styled
def picture(rows: Sequence[Row]) -> Figure:
    """Draw what is held of each rig, and how soon, by the solver and at the size of the first."""
    _, size, solver, _ = cell(rows[0])
    groups = grouped([row for row in rows if cell(row)[1:3] == (size, solver)],
                     lambda row: (cell(row)[0], cell(row)[3]))
    names, kinds = (list(dict.fromkeys(of)) for of in zip(*groups))
    pitch = len(kinds) + 1
    looks = {kind: {'color': colour, 'marker': marker, 'linewidth': 1.4, 'markersize': 4.7,
                    'markevery': [1]} for kind, (colour, marker) in LOOKS.items() if kind in kinds}
    figure = Figure(figsize=(8.4, 1.3 + 0.13 * pitch * len(names)), layout='constrained')
    held, settled = figure.subplots(1, 2, sharey=True)
    for (name, kind), of in groups.items():
        y = [pitch * names.index(name) + kinds.index(kind)] * 3
        found, took = rate([row.metrics.success for row in of]), settling(of)
        held.plot([found.low, found.successes / found.runs, found.high], y, **looks[kind],
                  clip_on=False)
        settled.plot([took.low, took.value, took.high], y, **looks[kind])
    for axes in (held, settled):
        for n in range(0, len(names), 2):
            axes.axhspan(n * pitch - 1, (n + 1) * pitch - 1, color=PAPER, zorder=0)
        axes.tick_params('y', length=0)
        axes.grid(True, axis='x')
    held.set_yticks(pitch * np.arange(len(names)) + (pitch - 2) / 2, names)
    held.set(ylim=(pitch * len(names) - 1, -1), xlabel='held')
    as_share(held, 'x')
    settled.set(xlim=(0, None), xlabel='median settling time [s]')
    name_lines(figure, looks, entry=2.0)
    figure.suptitle(f'When the model is wrong: {solver_name(solver)}, links of {size:g} m')
    return figure


def page(rows: Sequence[Row], made: str) -> str:
    """Return the page."""
    sizes = ' or '.join(f'{size:g} m at {rate:g} Hz' for size, rate in SIZES.items())
    return '\n'.join([
        '# When the model is wrong\n', made,
        f'{DURATION:g} s from nearly hanging, moved by MuJoCo, with links of {sizes}; what stands '
        'below is of links of 1 m, and of others as much in their own units. Nothing of it is '
        'told. Sensors are exact but where one is named, and speeds are measured.\n',
        compact([('rig', 'what is wrong'), *(
            (f'`{name}`', model.about) for name, model in RIGS.items())]) + '\n',
        'The mpc is the default one; or its filter takes its noises as given (`no_adaptation`) or '
        'estimates the state alone (`state_alone`), or it has none (`no_estimator`); or it '
        '[learns dynamics](../learned_dynamics.md#beside-the-equations) beside the equations, and '
        'plans with these while they predict better (`adaptive`).\n',
        'Held is what [evaluate](../evaluation.md#measures) calls so; of `springs`, whose links '
        'cannot rest upright, about where they can. As asked is, of `zeros`, with the cart within '
        f'{100 * CENTRED:g} cm of its goal at the end; of `changed` and `knocked`, settled within '
        f'{AGAIN:g} s of the change, which comes after {CHANGE:g} s; of others, what is held. '
        'Links that rest upright do not feel the change, hence `knocked`, whose cart is pushed as '
        f'well, by {KNOCKS[0]:g} to {KNOCKS[1]:g} N for {KNOCKED:g} s, either way by the seed. '
        'Where sensors are exact and nothing else goes with the seed, as of `cogging`, `sticking` '
        'and `changed`, runs differ only by where they begin.\n',
        "p is of McNemar's exact test against the default on the same seeds; in brackets 95 % "
        'intervals, by Wilson of what is held, by the bootstrap of a median. Rows: '
        '`results/wrong_models.csv.gz`.\n',
        '![What each mpc holds of each rig, and how soon](../figures/wrong_models.png)\n',
        table(rows), ''])


def main(argv: Sequence[str] | None = None) -> None:
    """Play, and print the table or write the page."""
    parser = argparse.ArgumentParser(
        description=__doc__, epilog='Without --size, --solvers and --contestants: the cells of '
        'the page; with one of them, all of the others.')
    parser.add_argument('--rigs', nargs='+', choices=RIGS, default=list(RIGS))
    parser.add_argument('--size', nargs='+', type=float, choices=SIZES, help='[m] of the links')
    parser.add_argument('--solvers', nargs='+', choices=METHODS)
    parser.add_argument('--contestants', nargs='+', choices=CONTESTANTS)
    parser.add_argument('--seeds', type=int, default=SEEDS)
    parser.add_argument('--docs', type=Path, help='folder to write the page and its rows into')
    asked = parser.parse_args(argv)
    chosen = (asked.size, asked.solvers, asked.contestants)
    cells = list(product(*(some or all_of for some, all_of in zip(
        chosen, (SIZES, METHODS, CONTESTANTS))))) if any(chosen) else CELLS
    rows = in_parallel('wrong models', [
        delayed(played)(*episode(name, *one, seed))
        for name in asked.rigs for one in cells for seed in range(asked.seeds)])
    if not asked.docs:
        print(table(rows))
        return
    results, figures = folders(asked.docs)
    store(results / 'wrong_models.csv.gz', rows)
    picture(rows).savefig(figures / 'wrong_models.png')
    (results / 'wrong_models.md').write_text(page(rows, made(
        'wrong_models', sources('wrong_models'), (*provenance.COMPUTING, 'mujoco'))),
        encoding='utf-8')


if __name__ == '__main__':
    main()
