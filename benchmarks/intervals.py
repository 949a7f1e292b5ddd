# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
How often the intervals of `identify` hold the truth, on rigs of random sizes.

Nothing is told of a rig but the mass of its cart. Run by `make results`.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

from joblib import delayed
from learned import in_parallel
import numpy as np
import pandas as pd
from stamp import asked, made, sources, store_page

from dp_swing_ros import provenance
from dp_swing_ros.control import controllers
from dp_swing_ros.evaluation.campaign.report import share
from dp_swing_ros.evaluation.comparison import rate
from dp_swing_ros.identification.base_parameters import base_parameters
from dp_swing_ros.identification.identify import Identified, identify
from dp_swing_ros.identification.segments import Motion
from dp_swing_ros.learning.learner import Learner
from dp_swing_ros.parameters import group
from dp_swing_ros.pendulum.equations import scale_of
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import Array, hanging
from dp_swing_ros.pendulum.units import STATES
from dp_swing_ros.problem.plan import Plan
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import Controller, simulate
from dp_swing_ros.simulation.engines import SLIP
from dp_swing_ros.simulation.plant import Plant
from dp_swing_ros.tables import compact

COUNT = 180
DRAWN, PUSHED = 47, 48        # seeds of their own
LENGTHS, MASSES = (0.1, 2.0), (0.05, 1.0)   # [m], [kg] of the longest link, and of the middle one
SHORTER, LIGHTER = 0.5, 0.6   # of these, how short and light (or heavy) another link may be
CART = 0.5, 5.0               # masses of all links that a cart may have
CENTRE, INERTIA = (0.4, 0.6), (0.7, 1.3)    # of the length, and of a rod's
GAIN = 0.8, 1.25
# the largest, of the default bodies; others have the same in their own units
FRICTIONS = {'friction': 0.02, 'dry_friction': 0.03}   # [N m s/rad, N m] of a joint
OTHERS = {'cart_friction': 0.5, 'cart_dry_friction': 1.5, 'actuation_delay': 0.02,
          'motor_time_constant': 0.03, 'force_bias': 0.5}   # [N s/m, N, s, s, N]
RATES, COUNTS = (100.0, 200.0), (2000, 4096, 8192)
NOISES = 2e-4, 1e-3           # [m, rad]
# in turn
ENGINES = OWN, SHARP, SOFT = '`own`', '`mujoco`', '`mujoco`, soft friction'
FRICTION_STEPS = 2            # of MuJoCo, in which its dry friction sets in at the soonest
# [s] scaled; steps as long as the engines' own would pass for delay and friction
STEP = 1e-4
DURATION, APART = 15.0, 3.0   # [s] scaled, of a recording, and between pushes
STRONGEST = 1.5               # of the largest force, of a push
NEARLY = 0.05                 # [m, rad, m/s, rad/s] scaled, deviation of a start from hanging
EXPLORED, CONTROLLED = 'random forces', 'swing-up, held and pushed'
AIM = 0.9, 0.98               # of intervals of 95 %, how many are to hold the truth
PER_FORCE = ('friction', 'force_bias')   # known per force alone where a mass is


class Rig(NamedTuple):
    """A rig: its number, the parameters of its plant, and how it is commanded."""

    number: int
    plant: dict[str, Any]
    motion: str
    engine: str

    @property
    def physical(self) -> PendulumParameters:
        """Return its bodies."""
        return group(PendulumParameters, plants.PLANT.complete(self.plant))

    def truth(self, name: str) -> float:
        """Return a parameter; the semi-implicit steps of MuJoCo answer half of one early."""
        value = float(self.plant[name])
        early = name == 'actuation_delay' and self.engine != OWN
        return value - self.plant['physics_step'] / 2 if early else value

    @property
    def kinds(self) -> dict[str, str]:
        """Return of what kind it is."""
        return {'links': str(self.plant['links']), 'engine': self.engine,
                'sensors': 'encoders' if 'encoder_counts' in self.plant else 'noise',
                'commands': self.motion}


def drawn(number: int) -> Rig:
    """Return a rig at random: in turn with one and two links, by each engine, of both motions."""
    rng = np.random.default_rng((DRAWN, number))
    links = 1 + number % 2
    lengths = np.exp(rng.uniform(*np.log(LENGTHS))) * rng.uniform(SHORTER, 1.0, links)
    masses = np.exp(rng.uniform(*np.log(MASSES))) * rng.uniform(LIGHTER, 1 / LIGHTER, links)
    values: dict[str, Any] = {'links': links, 'cart_mass': masses.sum() * np.exp(
        rng.uniform(*np.log(CART)))}
    largest = dict(OTHERS)
    for i, (mass, length) in enumerate(zip(masses, np.maximum(lengths, LENGTHS[0])), 1):
        values |= {f'link{i}_mass': mass, f'link{i}_length': length,
                   f'link{i}_centre': rng.uniform(*CENTRE) * length,
                   f'link{i}_inertia_factor': rng.uniform(*INERTIA)}
        largest |= {f'joint{i}_{name}': value for name, value in FRICTIONS.items()}
    scale, fields = scale_of(PendulumParameters(**values)), plants.PLANT.fields(links)
    for name, value in largest.items():
        values[name] = scale.sized(
            rng.uniform(-value if name == 'force_bias' else 0.0, value),
            fields[name].metadata['unit'])
    sensors = {'encoder_counts': int(rng.choice(COUNTS))} if rng.random() < 0.5 else {
        'position_noise': np.exp(rng.uniform(*np.log(NOISES)))}
    engine = ENGINES[number // 2 % 3]
    off = np.multiply(scale.factors(STATES, 2 * links + 2), rng.normal(0, NEARLY, 2 * links + 2))
    return Rig(number, {
        **values, **sensors, 'force_gain': rng.uniform(*GAIN), 'rate': float(rng.choice(RATES)),
        'velocities': 'differenced', 'engine': 'own' if engine == OWN else 'mujoco',
        'seed': number, 'physics_step': scale.sized(STEP, 's'),
        'initial_state': (hanging(links) + off).tolist()},
        (EXPLORED, CONTROLLED)[number // 4 % 2], engine)


class Recorder:
    """A controller, and what it was told and did."""

    def __init__(self, controller: Controller, u_max: float) -> None:
        """Take the controller, and the largest force [N]."""
        self.controller, self.u_max = controller, u_max
        self.t, self.X, self.U = list[float](), list[Array](), list[float]()

    def update(self, t: float, x: Array, delay: float) -> Plan:
        """Return its plan."""
        plan = self.controller.update(t, x, delay)
        self.t.append(t)
        self.X.append(x)
        self.U.append(plan.first_force(self.u_max))
        return plan

    def fallback(self, acts_at: float) -> Plan:
        """Return its plan where no state came."""
        return self.controller.fallback(acts_at)


def record(rig: Rig) -> Motion:
    """Return what the sensors of a rig see of it; who commands it is told masses and lengths."""
    plant, scale = plants.plant(rig.plant), scale_of(rig.physical)
    if rig.engine == SHARP:
        engine: Any = plant.engine
        engine.model.dof_solref[:, 0] = FRICTION_STEPS * rig.plant['physics_step']
    rate, u_max = plant.parameters.rate, plant.limits.force_limit
    told = {'seed': rig.number, **{
        name: value for name, value in rig.plant.items()
        if name == 'links' or name.endswith(('_mass', '_length'))}}
    controller: Controller = Learner(told, np.inf)   # which explores for ever
    pushes = np.zeros(round(scale.sized(DURATION, 's') * rate))
    if rig.motion == CONTROLLED:
        controller = controllers.controller(told)
        every = round(scale.sized(APART, 's') * rate)
        pushes[every::every] = STRONGEST * u_max * np.random.default_rng(
            (PUSHED, rig.number)).uniform(-1, 1, len(pushes[every::every]))
    return watched(plant, controller, pushes)


def watched(plant: Plant, controller: Controller, pushes: Array) -> Motion:
    """Return what the sensors see of a plant under a controller, and pushes [N] in its periods."""
    rate = plant.parameters.rate
    recorder = Recorder(controller, plant.limits.force_limit)
    simulate(plant, recorder, len(pushes) / rate, pushes=pushes)
    t, Q = np.array(recorder.t), np.hsplit(np.array(recorder.X), 2)[0]
    Q[:, 1:] = np.unwrap(Q[:, 1:], axis=0)
    return Motion(t, Q, t, np.array(recorder.U), np.nonzero(pushes)[0] / rate,
                  plant.limits.track_limit)


def found_of(rig: Rig) -> list[dict[str, Any]]:
    """Identify a rig; return a row for each parameter, first those of base_parameters.py."""
    with np.errstate(all='ignore'):
        found = identify([record(rig)], PendulumParameters(links=rig.plant['links']),
                         known={'cart_mass': rig.plant['cart_mass']})
    return [{'rig': rig.number, **rig.kinds, 'at_bound': ', '.join(found.at_bound), **row}
            for row in (*of_bodies(rig, found), *of_others(rig, found))]


def of_bodies(rig: Rig, found: Identified) -> Iterator[dict[str, Any]]:
    """Yield the base parameters."""
    truth = base_parameters(rig.physical, rig.plant['force_gain'])
    for name, of in found.base.items():
        yield {'parameter': name, 'is_base': True, 'truth': truth[name][0], 'value': of.value,
               'low': of.low, 'high': of.high}


def of_others(rig: Rig, found: Identified) -> Iterator[dict[str, Any]]:
    """
    Yield the frictions and the drive, where they are told.

    The mass of the cart is known, but not where those of the links are: rods that move alike have
    another gain, so frictions and the lasting force count per force, too.
    """
    for name, interval in found.intervals.items():
        if name.endswith(PER_FORCE) or name in OTHERS:
            per = [gains['force_gain'] if name.endswith(PER_FORCE) else 1.0
                   for gains in (rig.plant, found.values)]
            yield {'parameter': name, 'is_base': False, 'truth': rig.truth(name) / per[0],
                   **{key: value / per[1] for key, value in zip(
                       ('value', 'low', 'high'), (found.values[name], *interval))}}


def holds(rows: pd.DataFrame) -> 'pd.Series[bool]':
    """Return which intervals hold the truth."""
    return (rows.low <= rows.truth) & (rows.truth <= rows.high)


def counted(rows: pd.DataFrame, by: str) -> list[tuple[str, ...]]:
    """Return for each kind of rows how often intervals hold the truth, and how wide they are."""
    lines = list[tuple[str, ...]]()
    for name, of in rows.groupby(by, sort=False):
        held = rate(holds(of).tolist())
        half, error = (100 * each / of.truth.abs() for each in (
            (of.high - of.low) / 2, (of.value - of.truth).abs()))
        of_all = held.successes / held.runs
        met = '**too few**' if of_all < AIM[0] else '**too many**' if of_all > AIM[1] else 'met'
        lines.append((str(name), share(held), met, f'{half.median():.2g}',
                      f'{error.median():.2g}', f'{error.max():.2g}'))
    return lines


def by_engine(rows: pd.DataFrame, lines: Iterable[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """Return lines about parameters with how often intervals hold the truth by each engine."""
    counts = holds(rows).groupby([rows.parameter, rows.engine]).agg(['sum', 'size'])
    return [(name, *cells, *('{sum} of {size}'.format(**counts.loc[name, engine])
                             if (name, engine) in counts.index else '-' for engine in ENGINES))
            for name, *cells in lines]


def page(rows: pd.DataFrame, made: str) -> str:
    """Return the page."""
    is_met = rows.at_bound != ''
    bodies, others = (rows[~is_met & (rows.is_base == is_base)] for is_base in (True, False))
    head = ('hold the truth', f'{100 * AIM[0]:g} to {100 * AIM[1]:g} %',
            'half the interval, median [%]', 'error, median [%]', 'largest [%]')
    met = [(str(number), of.at_bound.iloc[0], str((~holds(of)).sum()),
            f'{(100 * (of.value / of.truth - 1).abs()).max():.2g}')
           for number, of in rows[is_met & rows.is_base].groupby('rig')]
    return '\n'.join([
        '# How often intervals hold the truth\n', made,
        f'{rows.rig.nunique()} rigs at random, of one and two links of {LENGTHS[0]:g} to '
        f'{LENGTHS[1]:g} m, with centres of mass at {100 * CENTRE[0]:g} to {100 * CENTRE[1]:g} % '
        'of the length and inertias of 70 to 130 % of a rod, viscous and dry frictions, delay, '
        f'lag, gain and a lasting force; {RATES[0]:g} or {RATES[1]:g} states a second, positions '
        'alone, from encoders or with noise. Our own engine moves them in turn with MuJoCo, whose '
        'dry friction sets in as soon as its steps allow, or '
        f'{SLIP / (FRICTION_STEPS * STEP):g} times as late, its default here (soft). '
        f'{DURATION:g} s (of links of 1 m; of others as long in their own time) under random '
        'forces, or of a swing-up that is held and pushed. `identify` begins with the default '
        'bodies and is told the mass of the cart. Counted are its intervals of 95 %, in brackets '
        'the 95 % interval of their share (Wilson); those of one rig are not independent. What '
        'goes with a mass is per force. Semi-implicit steps, as those of MuJoCo, act like half of '
        'one less of delay, which is taken for the truth. The rows: `results/intervals.csv.gz`.\n',
        compact([('base parameter', *head, *ENGINES),
                 *by_engine(bodies, counted(bodies, 'parameter'))]), '',
        'Of frictions and drive, where they are told:\n',
        compact([('parameter', *head[:2], *ENGINES), *by_engine(others, (
            line[:3] for line in counted(others, 'parameter')))]),
        '',
        'Base parameters by the kind of rig:\n',
        compact([('rigs', *head), *(line for kind in ('links', 'engine', 'sensors', 'commands')
                                    for line in counted(bodies.assign(
                                        kind=kind + ': ' + bodies[kind]), 'kind'))]), '',
        f'A bound of the search was met on {len(met)} rigs, and reported; they are left out '
        'above.\n',
        *([compact([('rig', 'at the bound', 'base parameters missed', 'largest error [%]'),
                    *met]), ''] if met else [])])


def main(argv: Sequence[str] | None = None) -> None:
    """Identify all rigs, and write the page."""
    count, results, _ = asked(__doc__, argv, COUNT)
    calls: list[Any] = [delayed(found_of)(drawn(number)) for number in range(count)]
    rows = pd.DataFrame([row for of in in_parallel('rigs', calls) for row in of])
    text = page(rows, made('intervals', sources('intervals'), (*provenance.COMPUTING, 'mujoco')))
    store_page('intervals', rows, text, results.parent)


if __name__ == '__main__':
    main()
