# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Who holds rigs of other make: MuJoCo moves them, and what is wrong with them is told to nobody.

An mpc that is told shows whether a figure is limited by what is not known or by what the drive can
do; what the estimator has found after an episode, how much of it is learned.
"""

from collections.abc import Iterable, Mapping, Sequence
import math
from typing import Any, NamedTuple

from campaigns import Campaign, CERTAIN, DURATION, informed, METHODS
from joblib import delayed, Parallel
from matplotlib.figure import Figure
import numpy as np

from dp_swing_ros.control import controllers
from dp_swing_ros.evaluation.campaign.contestants import Contestant
from dp_swing_ros.evaluation.campaign.report import difference, failures, probability, share
from dp_swing_ros.evaluation.campaign.rows import grouped, Row
from dp_swing_ros.evaluation.campaign.summary import common, duel, Failure, summarise, why
from dp_swing_ros.evaluation.comparison import Median, median, Rate, rate
from dp_swing_ros.evaluation.metrics import REST
from dp_swing_ros.evaluation.scenarios import Case, RIGS, SCENARIOS
from dp_swing_ros.figures.campaign import successes
from dp_swing_ros.identification.base_parameters import base_parameters
from dp_swing_ros.pendulum.parameters import Drive, PendulumParameters
from dp_swing_ros.pendulum.state import Array, DEFAULT_LINKS, joints
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate
from dp_swing_ros.tables import compact

SEEDS = range(20)
CAMPAIGN = Campaign('Rigs of other make', METHODS, tuple(RIGS), SEEDS, {}, {})
CLEAN, BIAS = 'rig_clean', 'rig_bias'
CENTRED = 0.02          # [m] from the reference, at most, over the last seconds
ESTIMATING = 'ilqr'     # whose estimator is asked
DELAY, LAG = 'actuation_delay', 'motor_time_constant'
CONFIDENCE = 1.96       # standard deviations to either side of 95 %
DIFFERENCE = 1e-5       # of an unknown for derivatives


class Rig(NamedTuple):
    """A scenario, at a level where something is swept."""

    scenario: str
    level: float | None = None

    def __str__(self) -> str:
        """Return what it is called on the page."""
        if self.level is None:
            return f'`{self.scenario}`'
        return f'`{self.scenario}`, {self.level:g} {SCENARIOS[self.scenario].sweeps[0].unit}'

    def cases(self, seeds: range = SEEDS) -> list[Case]:
        """Return its cases of some seeds."""
        return [case for case in SCENARIOS[self.scenario].cases(
            self.scenario, seeds, None, DURATION) if case.level == self.level]


class Aim(NamedTuple):
    """The least share that is held, and the bounds of the median settling time, if any."""

    held: float = 0.0
    settling: float = math.inf   # [s]
    slower: float = math.inf     # times that of CLEAN


# of what is swept, the hardest level
AIMS = {
    Rig(CLEAN): Aim(),
    Rig('rig_delay'): Aim(0.98, 2.5),
    Rig('rig_lag', 0.025): Aim(0.98),
    Rig('rig_lag', 0.05): Aim(),
    Rig('rig_cart', 4.0): Aim(0.95),
    Rig('rig_joints', 0.05): Aim(0.95),
    Rig('rig_noise', 0.005): Aim(0.95),
    Rig('rig_encoders'): Aim(0.98),
    Rig(BIAS, 5.0): Aim(0.98),
    Rig('rig_gain'): Aim(0.95),
    Rig('rig_all'): Aim(0.95, slower=2.0),
    Rig('rig_all_fast'): Aim(0.99)}

# what an mpc is given beside the truth: certain, its estimator learns nothing but the state
ORACLES: dict[str, dict[str, Any]] = {
    'told': {},
    'told and certain': CERTAIN}
TOLD = [Rig('rig_delay'), Rig('rig_lag', 0.05), Rig('rig_cart', 4.0), Rig('rig_all')]
TOLD_SEEDS = range(12)

# which a rig may ask for; see control/supervisor.py
LIMITS: dict[str, dict[str, Any]] = {
    'controlled_stop': {'controlled_stop': 1.0},
    'and cart_speed_limit 2 m/s': {'controlled_stop': 1.0, 'cart_speed_limit': 2.0},
    'force_rate_limit 800 N/s': {'force_rate_limit': 800.0},
    'force_rate_limit 400 N/s': {'force_rate_limit': 400.0},
    'and force_limit 10 N': {'force_rate_limit': 400.0, 'force_limit': 10.0}}
LIMITED = [Rig(CLEAN), Rig('rig_all')]
LIMITED_SEEDS = range(10)


class Sought(NamedTuple):
    """Parameters, summed, that the estimator is to find of a rig, and how closely, if asked."""

    rig: Rig
    names: tuple[str, ...]
    within: float = math.inf   # in their unit, or as a share of the true sum
    is_share: bool = False

    def text(self, error: float) -> str:
        """Return an error, or what is aimed at, with its unit."""
        unit = plants.PLANT.fields(DEFAULT_LINKS)[self.names[0]].metadata['unit']
        return f'{100 * error:.1f} %' if self.is_share else f'{error:.2g} {unit}'


SOUGHT = [
    Sought(Rig('rig_delay'), (DELAY,), 0.005),
    Sought(Rig('rig_delay'), (DELAY, LAG)),
    Sought(Rig('rig_lag', 0.025), (LAG,), 0.01),
    Sought(Rig('rig_lag', 0.025), (DELAY, LAG)),
    Sought(Rig('rig_cart', 4.0), ('cart_dry_friction',), 0.2, True),
    Sought(Rig('rig_joints', 0.05), ('joint1_dry_friction',), 0.2, True),
    Sought(Rig('rig_joints', 0.05), ('joint2_dry_friction',), 0.2, True),
    Sought(Rig('rig_gain'), ('force_gain',), 0.2, True),
    Sought(Rig(BIAS, 5.0), ('force_bias',))]


class Found(NamedTuple):
    """A parameter after an episode, as it is and as the estimator has it."""

    scenario: str
    level: float | None
    seed: int
    parameter: str
    true: float
    found: float


class Sure(NamedTuple):
    """Whether the estimator's own interval of 95 % holds a number of a rig."""

    scenario: str
    seed: int
    parameter: str
    true: float
    found: float
    half: float   # of the interval


Groups = Mapping[tuple[str, Rig], Sequence[Row]]


def episodes() -> list[tuple[Contestant, Case]]:
    """Return the runs of all solvers, then those of an mpc that is told, or has limits."""
    return [
        *(episode for episode in CAMPAIGN.episodes()
          if Rig(episode[1].scenario, episode[1].level) in AIMS),
        *((Contestant(f'{solver}, {kind}', solver, {}, ORACLES[kind]), informed(case))
          for rig in TOLD for case in rig.cases(TOLD_SEEDS)
          for kind in ORACLES for solver in METHODS),
        *((Contestant(f'{solver}, {kind}', solver, {}, LIMITS[kind]), case) for rig in LIMITED
          for case in rig.cases(LIMITED_SEEDS) for kind in LIMITS for solver in METHODS)]


def estimates(seeds: range = SEEDS) -> list[Found]:
    """Play all episodes of the rigs of which something is sought, on all cores."""
    sought = grouped(SOUGHT, lambda one: one.rig)
    found = Parallel(n_jobs=-1)(
        delayed(estimated)(case, sorted({name for one in of_rig for name in one.names}))
        for rig, of_rig in sought.items() for case in rig.cases(seeds))
    return [one for episode in found for one in episode]


def estimated(case: Case, names: Iterable[str]) -> list[Found]:
    """Play an episode; return some parameters as the estimator has them at its end."""
    plant = plants.plant({**case.plant, 'seed': case.seed})
    controller = controllers.controller({'solver': ESTIMATING, 'seed': case.seed})
    with np.errstate(all='ignore'):
        simulate(plant, controller, case.duration)
    believed = {**controller.belief.estimate.physical,
                **dict(zip(vars(plant.drive), controller.belief.drive))}
    true = {**vars(plant.physical), **vars(plant.drive)}
    return [Found(case.scenario, case.level, case.seed, name, true[name], believed[name])
            for name in names]


def intervals(seeds: range = SEEDS) -> list[Sure]:
    """Return how sure the estimator is of the rig of all faults, and of one that is as told."""
    found = Parallel(n_jobs=-1)(delayed(sure_of)(case) for scenario in (CLEAN, 'rig_all')
                                for case in Rig(scenario).cases(seeds))
    return [one for episode in found for one in episode]


def sure_of(case: Case) -> list[Sure]:
    """
    Play the first half of an episode; return what the estimator says of what motion tells.

    Its unknowns are sure in common alone, so intervals are those of numbers that follow from them.
    """
    plant = plants.plant({**case.plant, 'seed': case.seed})
    controller = controllers.controller({'solver': ESTIMATING, 'seed': case.seed})
    with np.errstate(all='ignore'):
        simulate(plant, controller, case.duration / 2)
    nominal, ekf = controller.nominal.physical, controller.observer.estimator
    size, about = ekf.size, ekf.unknowns
    p, C = ekf.z[size:], ekf.P[size:, size:]

    def numbers(p: Array) -> dict[str, float]:
        values = about.values(p)
        bodies = {name: value for name, value in values.items() if hasattr(nominal, name)}
        gain = values['force_gain']
        return told(nominal.estimated(bodies), Drive(
            values[DELAY], values[LAG], gain, values['force_bias']))
    found, true = numbers(p), told(plant.physical, Drive.of(plant.drive))
    # one-sided, for a friction may be at its least
    J = np.array([np.subtract(list(numbers(p + step).values()), list(found.values())) / DIFFERENCE
                  for step in DIFFERENCE * np.eye(len(p))]).T
    halves = CONFIDENCE * np.sqrt(np.einsum('ki,ij,kj->k', J, C, J))
    return [Sure(case.scenario, case.seed, name, true[name], value, half)
            for (name, value), half in zip(found.items(), halves.tolist())]


def told(physical: PendulumParameters, drive: Drive) -> dict[str, float]:
    """Return the numbers of a rig that motion tells, by name, per force gain."""
    return {**{name: value for name, (value, _) in base_parameters(physical, drive.gain).items()},
            **{f'dry friction, {joint}': dry / drive.gain for joint, dry in zip(
                joints(physical.links), physical.dry_frictions)},
            'delay and lag': drive.delay + drive.time_constant,
            'lasting force': drive.bias / drive.gain}


def picture(rows: Sequence[Row]) -> Figure:
    """Draw how many episodes the solvers held, those of all levels of a scenario together."""
    alone = [row for row in rows if row.key.contestant in METHODS]
    return successes(summarise(CAMPAIGN.description(), alone, len(alone)))


def page(rows: Sequence[Row], found: Sequence[Found], sure: Sequence[Sure], made: str) -> str:
    """Return the page from the rows of all runs, and what the estimator found, and how surely."""
    groups = grouped(rows, lambda row: (row.key.contestant,
                                        Rig(row.key.scenario, row.key.level)))
    return '\n'.join([
        f'# {CAMPAIGN.title}\n', made,
        f'{DURATION:g} s without ROS, in lockstep, of the scenarios `rig_*` of [evaluate]'
        '(../evaluation.md#scenarios), with the defaults of the mpc: MuJoCo moves the pendulum '
        'from nearly hanging, and what is wrong is told to no solver. The rows: '
        '`results/rig.csv.gz`. In brackets the 95 % interval, by Wilson of what is held, by '
        'the bootstrap of a median; the settling time is the median of the episodes held. An aim '
        'is met or missed by the figure itself, whatever its interval. The settling time of '
        f'`rig_all` is to be at most {AIMS[Rig("rig_all")].slower:g} times that of the same '
        f'solver in `{CLEAN}`.\n',
        compact([('rig', 'solver', 'upright to the end', 'aim', 'median settling [s]', 'aim'), *(
            line(rig, solver, groups) for rig in AIMS for solver in METHODS)]) + '\n',
        '![Held](../figures/rig.png)\n',
        'In the picture all levels of a scenario are together.\n',
        '## A lasting force\n',
        f'Centred are the episodes held with the cart within {1e3 * CENTRED:g} mm of its '
        f'reference over all of the last {REST:g} s; the median is of the episodes held.\n',
        compact([('rig', 'solver', 'centred', 'aim', 'furthest off, median [mm]'), *(
            centred(rig, solver, groups) for rig in AIMS if rig.scenario == BIAS
            for solver in METHODS)]) + '\n',
        '## An mpc that is told\n',
        'The same rigs, and an mpc that is given the delay, the lag, the gain, the lasting force, '
        'the dry frictions, the masses and the lengths of each as its parameters (`told`): its '
        'estimator begins there, as uncertain as ever. Or it is certain of all of them, and '
        'estimates the state alone. Noise, encoders and the engine stay. What such an mpc does '
        'better was limited by knowledge; what it misses as well, by the drive, by the sensors '
        'or by how it plans. '
        f'Seeds {TOLD_SEEDS.start} to {TOLD_SEEDS.stop - 1}; beside them the same seeds as above. '
        'The p are those of the exact test of McNemar and of the sign test; the difference is '
        'the median, over the seeds that both held, of told less not told.\n',
        compact([('rig', 'solver', 'it is', 'held', 'held, not told', 'only told',
                  'only not told', 'p', 'median settling [s]', 'not told [s]', 'difference [s]'),
                 *(beside(rig, solver, kind, groups) for rig in TOLD for solver in METHODS
                   for kind in ORACLES)]) + '\n',
        '## With the limits of a rig\n',
        f'Seeds {LIMITED_SEEDS.start} to {LIMITED_SEEDS.stop - 1}, beside the same seeds without. '
        'A run that ends in a [controlled stop](../rig.md#limits-and-the-controlled-stop) is not '
        'held.\n',
        compact([('rig', 'solver', 'limit', 'held', 'held without', 'median settling [s]',
                  'without [s]'),
                 *(limited(rig, solver, kind, groups) for rig in LIMITED for solver in METHODS
                   for kind in LIMITS)]) + '\n',
        '## What the estimator has found\n',
        f'After {DURATION:g} s of `{ESTIMATING}`, held or not: the median error, without its '
        'sign, over the same seeds; each estimate: `results/rig_estimates.csv.gz`. '
        'A delay and a lag of a few tens of milliseconds act nearly alike, hence their sum, and a '
        'gain as masses that are all off by one factor.\n',
        compact([('rig', 'found', 'seeds', 'median error', 'aim'), *(
            of_estimates(one, found) for one in SOUGHT)]) + '\n',
        f'How often its own intervals of 95 % hold the truth after {DURATION / 2:g} s, by Wilson; '
        'masses, moments and forces are those per force gain, for motion tells no more.\n',
        compact([('number', *(f'`{name}`' for name in by_rig(sure))), *(
            (name, *(share(rate([abs(one.true - one.found) <= one.half for one in of_rig
                                 if one.parameter == name])) for of_rig in by_rig(sure).values()))
            for name in dict.fromkeys(one.parameter for one in sure))]) + '\n',
        '## What was not held, and why\n',
        failures([Failure(*row.key, why(row)) for row in rows if not row.metrics.success]), ''])


def by_rig(sure: Sequence[Sure]) -> dict[str, list[Sure]]:
    """Return them by scenario."""
    return grouped(sure, lambda one: one.scenario)


def settling(rows: Sequence[Row]) -> Median:
    """Return the median settling time [s] of the episodes that were held."""
    times = np.array([row.metrics.settling_time for row in rows if row.metrics.success])
    return median(np.round(times, 6))   # sums of periods; an aim is met where they would be exact


def line(rig: Rig, solver: str, groups: Groups) -> tuple[str, ...]:
    """Return a line of the first table."""
    rows, clean = groups[solver, rig], groups[solver, Rig(CLEAN)]
    held, took = rate([row.metrics.success for row in rows]), settling(rows)
    return (str(rig), f'`{solver}`', share(held), held_aim(AIMS[rig], held), interval(took),
            settling_aim(AIMS[rig], took.value, settling(clean).value))


def held_aim(aim: Aim, found: Rate) -> str:
    """Return the least share that is to be held, and whether it is."""
    return verdict(f'at least {100 * aim.held:g} %',
                   found.successes >= aim.held * found.runs) if aim.held else '-'


def settling_aim(aim: Aim, took: float, clean: float) -> str:
    """Return the bound of the median settling time [s], and whether it is within."""
    if math.isfinite(aim.settling):
        return verdict(f'below {aim.settling:.2f}', took < aim.settling)
    if math.isfinite(aim.slower):
        return verdict(f'at most {aim.slower * clean:.2f}', took <= aim.slower * clean)
    return '-'


def verdict(aim: str, is_met: bool) -> str:
    """Return an aim, and whether it was met."""
    return f'{aim}: {"met" if is_met else "**missed**"}'


def centred(rig: Rig, solver: str, groups: Groups) -> tuple[str, ...]:
    """Return a line on where the cart rests."""
    rows = groups[solver, rig]
    held = [row.metrics for row in rows if row.metrics.success]
    found = rate([row.metrics.success and row.metrics.rest_offset <= CENTRED for row in rows])
    offset = median(1e3 * np.array([metrics.rest_offset for metrics in held]))
    return (str(rig), f'`{solver}`', share(found),
            held_aim(AIMS[rig], found), interval(offset, 1))


def beside(rig: Rig, solver: str, kind: str, groups: Groups) -> tuple[str, ...]:
    """Return a line on an mpc that is told, beside one that is not."""
    pairs = common(groups[f'{solver}, {kind}', rig], groups[solver, rig])
    found = duel(rig.scenario, kind, solver, pairs)
    held, took = side_by_side(pairs)
    return (str(rig), f'`{solver}`', kind, *held, str(found.first_only), str(found.second_only),
            probability(found.p), *took, difference(found.differences['settling_time']))


def limited(rig: Rig, solver: str, kind: str, groups: Groups) -> tuple[str, ...]:
    """Return a line on an mpc with limits, beside one without."""
    held, took = side_by_side(common(groups[f'{solver}, {kind}', rig], groups[solver, rig]))
    return (str(rig), f'`{solver}`', kind, *held, *took)


def side_by_side(pairs: Sequence[tuple[Row, Row]]) -> tuple[list[str], list[str]]:
    """Return what each of two held, and the median settling time [s] of each."""
    both = [[pair[n] for pair in pairs] for n in (0, 1)]
    return ([share(rate([row.metrics.success for row in rows])) for rows in both],
            [interval(settling(rows)) for rows in both])


def of_estimates(sought: Sought, found: Sequence[Found]) -> tuple[str, ...]:
    """Return a line on what the estimator found."""
    of_seeds = grouped([one for one in found if one.parameter in sought.names
                        and Rig(one.scenario, one.level) == sought.rig], lambda one: one.seed)
    true, value = (np.array([sum(getattr(one, name) for one in group)
                             for group in of_seeds.values()]) for name in ('true', 'found'))
    error = median(np.abs(value - true) / (true if sought.is_share else 1.0))
    low, middle, high = map(sought.text, (error.low, error.value, error.high))
    aim = verdict(f'at most {sought.text(sought.within)}', error.value <= sought.within)
    return (str(sought.rig), ' + '.join(f'`{name}`' for name in sought.names),
            str(len(of_seeds)), f'{middle} ({low} to {high})',
            aim if math.isfinite(sought.within) else '-')


def interval(found: Median, digits: int = 2) -> str:
    """Return a median with its interval, where there is one."""
    if math.isnan(found.low):
        return '-' if math.isnan(found.value) else f'{found.value:.{digits}f}'
    return f'{found.value:.{digits}f} ({found.low:.{digits}f}-{found.high:.{digits}f})'
