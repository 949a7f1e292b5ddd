# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Scenarios: what a campaign puts every controller through, each a name and a list of cases.

The sweeps are those of the DFKI double-pendulum leaderboards, scaled to this plant: what is swept
is changed in the plant alone, the controller keeps its nominal model. A start, a profile of pushes
and a rig depend on the seed alone, so that every controller meets the same. No start is exactly an
equilibrium: where nothing else is drawn from the seed, all seeds would be one run.

The rigs are of other make: MuJoCo moves them, and what is wrong with their drives, their sensors
and their bodies is told to no controller.

All numbers are of the default bodies at the default rate; for others, `sized` makes a case that is
the same in their own units.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, fields, replace
from itertools import permutations
import math
from typing import Any

import numpy as np

from dp_swing_ros.pendulum.equations import scale_of
from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import (
    angles, Array, DEFAULT_LINKS, equilibria, hanging, LINKS, upright)
from dp_swing_ros.pendulum.units import by_element, SAME
from dp_swing_ros.simulation.plant import PlantParameters
from dp_swing_ros.simulation.plants import PLANT

PHYSICAL, LIMITS = PendulumParameters(), LimitParameters()
PERIOD = 1 / PlantParameters().rate    # [s] scaled
OF_BODIES = {each.name for each in fields(PendulumParameters)
             if each.name.endswith(('_mass', '_length', '_factor'))}
START, PUSHES, RIG, RESETS = 1, 2, 3, 4  # before the seed: streams beside those of streams.py

RANDOM_START = (1.0, math.pi, 1.0, 3.0)  # largest x, θ, ẋ and θ̇, either way
NEAR_GOAL = 0.3                        # [rad] largest angle at the start of near_goal

JOINT = 'joint_dry_friction'           # stands for those of all joints
NEARLY = 1e-3                          # [SI] standard deviation of a start at an equilibrium

LEVELS = 21                            # of a sweep
PROFILE = 'profile'                    # what pushes sweep: a profile is a level
PULSES = 3                             # in a profile of pushes
FIRST_PUSH, LAST_PUSH, APART = 0.5, 7.0, 1.0  # [s] scaled, between their middles
WIDTHS = (0.05, 0.1)                   # [s] scaled, standard deviations of the Gaussians
STRONGEST_PUSH = LIMITS.force_limit / 2  # [N] scaled
PEAK = 'peak'                          # [N] scaled; stands for the largest force of a profile
SEVERITY = 'severity'                  # stands for all of ALL_AT_ONCE, as a multiple of it
OF_CASE = (PEAK, SEVERITY)             # which are no parameters of a plant
TO = ' to '                            # between two equilibria

SHORT_TRACK = 1.5                      # [m] scaled, either way, of `tight`
RESET_EVERY, UNDISTURBED = 4.0, 1.0     # [s] scaled, of `uptime`, in the mean and at least


@dataclass(frozen=True)
class Case:
    """One episode but for who controls it."""

    scenario: str
    seed: int
    duration: float = 10.0                                    # [s]
    parameter: str = ''                                       # what is swept, if anything
    level: float | None = None
    plant: dict[str, Any] = field(default_factory=dict)       # parameters that differ
    told: dict[str, Any] = field(default_factory=dict)        # which the controller knows, too
    mpc: dict[str, Any] = field(default_factory=dict)         # parameters of the controller alone
    pushes: tuple[float, ...] = ()                            # [N] one force a period
    resets: tuple[tuple[int, tuple[float, ...]], ...] = ()    # the period, and the state then


def sized(case: Case, nominal: PendulumParameters, period: float) -> Case:
    """
    Return what a case is for a pendulum of other bodies, whose states come once in a period [s].

    Bodies that are off are off by the same share of their nominal values.
    """
    scale, known = scale_of(nominal), PLANT.fields(nominal.links)
    if scale == SAME and period == PERIOD:
        return case

    def value(name: str, given: Any) -> Any:
        if name in OF_BODIES:
            return given / getattr(PHYSICAL, name) * getattr(nominal, name)
        unit = known[name].metadata['unit'] if name != 'rate' else ''
        if isinstance(given, tuple):
            return tuple(map(scale.sized, given, by_element(unit, len(given))))
        return scale.sized(given, unit) if unit and isinstance(given, float) else given

    def values(given: dict[str, Any]) -> dict[str, Any]:
        return {name: value(name, one) for name, one in given.items()}

    duration, old = scale.sized(case.duration, 's'), scale.sized(PERIOD, 's')
    pushes, middles = case.pushes, np.arange(round(duration / period)) + 0.5
    if pushes:
        forces = np.interp(middles * period, (np.arange(len(pushes)) + 0.5) * old, pushes)
        pushes = tuple((scale.factor('N') * forces).tolist())
    return replace(case, duration=duration, plant=values(case.plant), told=values(case.told),
                   pushes=pushes, resets=tuple(
                       (round(n * old / period), value('initial_state', x))
                       for n, x in case.resets))


@dataclass(frozen=True)
class Sweep:
    """A parameter of the plant over a range, in its unit or as a share of its nominal value."""

    parameter: str
    low: float
    high: float
    unit: str = ''
    links: int = 1         # that there must be
    nominal: float = 1.0   # what a level is a share of

    def plant(self, level: float, links: int) -> dict[str, float]:
        """Return the parameters of a plant at a level."""
        return dict.fromkeys(names_of(self.parameter, links), level * self.nominal)


@dataclass(frozen=True)
class Scenario:
    """
    What one word on the command line stands for.

    With sweeps it has cases for every level of each and every seed; else one for every seed, on
    each of its `ways` if it has several. `case` completes them; where it gives no start, that is
    nearly hanging. A criterion counts in the robustness score. A case lasts `times` as long as was
    asked for.
    """

    about: str
    seeds: range
    sweeps: tuple[Sweep, ...] = ()
    criterion: bool = False
    levels: int = LEVELS
    case: Callable[[Case, int], Case] = lambda case, links: case
    times: int = 1
    ways: Callable[[int], Iterable[str]] = lambda links: ('',)

    def cases(self, name: str, seeds: range | None, levels: int | None,
              duration: float, links: int = DEFAULT_LINKS) -> Iterator[Case]:
        """Yield the cases, with other seeds or another number of levels where given."""
        for way in () if self.sweeps else self.ways(links):
            for seed in seeds or self.seeds:
                yield self.begun(Case(name, seed, self.times * duration, way), links)
        for sweep in (each for each in self.sweeps if each.links <= links):
            for level in np.linspace(sweep.low, sweep.high, levels or self.levels).tolist():
                for seed in seeds or self.seeds:
                    yield self.begun(Case(name, seed, self.times * duration, sweep.parameter,
                                          level, sweep.plant(level, links)), links)

    def begun(self, case: Case, links: int) -> Case:
        """Return a case completed."""
        case = self.case(case, links)
        start = start_near(hanging(links), case)
        return replace(case, plant={'initial_state': start, **case.plant})


def start_near(x: Array, case: Case) -> tuple[float, ...]:
    """Return a start (2n + 2,) near an equilibrium, which the seed decides."""
    return nearly(x, np.random.default_rng((RIG, case.seed)))


def nearly(x: Array, random: np.random.Generator) -> tuple[float, ...]:
    """Return a state (2n + 2,) that is off by NEARLY."""
    return tuple((x + random.normal(0.0, NEARLY, len(x))).tolist())


def random_start(case: Case, links: int) -> Case:
    """Start anywhere."""
    return replace(case, plant={'initial_state': anywhere(
        np.random.default_rng((START, case.seed)), links)})


def anywhere(random: np.random.Generator, links: int) -> tuple[float, ...]:
    """Return a state (2n + 2,) that is drawn from all of RANDOM_START."""
    largest = np.repeat(RANDOM_START, (1, links, 1, links))
    x: Array = random.uniform(-largest, largest)
    return tuple(x.tolist())


def near_goal(case: Case, links: int) -> Case:
    """Start at rest with all links off the vertical, as in the paper's Figs. 8-10."""
    x = upright(links)
    x[angles(x)] = np.random.default_rng((START, case.seed)).uniform(-NEAR_GOAL, NEAR_GOAL, links)
    return replace(case, plant={'initial_state': tuple(x.tolist())})


def transitions(links: int) -> Iterator[str]:
    """Yield the ways from each equilibrium to each other."""
    return (f'{start}{TO}{goal}' for start, goal in permutations(equilibria(links), 2))


def transition(case: Case, links: int) -> Case:
    """Start nearly in one equilibrium, and go to another."""
    start, goal = case.parameter.split(TO)
    return replace(case, plant={'initial_state': start_near(equilibria(links)[start], case)},
                   mpc={'goal': goal})


def pushed(case: Case, links: int) -> Case:
    """Push the cart by some Gaussian pulses; every profile is a level of its own."""
    profile = push_profile(case.seed, round(case.duration / PERIOD))
    return replace(case, parameter=PROFILE, level=float(case.seed),
                   pushes=tuple(profile.tolist()))


def push_profile(seed: int, periods: int) -> Array:
    """Return the forces (periods,) [N] of pulses at random times, in the periods' middles."""
    random = np.random.default_rng((PUSHES, seed))
    slack = LAST_PUSH - FIRST_PUSH - (PULSES - 1) * APART
    middles = FIRST_PUSH + np.sort(random.uniform(0, slack, PULSES)) + APART * np.arange(PULSES)
    peaks = random.uniform(-STRONGEST_PUSH, STRONGEST_PUSH, PULSES)
    widths = random.uniform(*WIDTHS, PULSES)
    t = PERIOD * (np.arange(periods) + 0.5)
    return np.exp(-0.5 * ((t[:, None] - middles) / widths) ** 2) @ peaks


def strongly_pushed(case: Case, links: int) -> Case:
    """Push the cart by the profile of `pushes`, its peaks within the level [N] either way."""
    assert case.level is not None
    profile = push_profile(case.seed, round(case.duration / PERIOD))
    return replace(case, pushes=tuple((case.level / STRONGEST_PUSH * profile).tolist()))


def tight(case: Case, links: int) -> Case:
    """Shorten the track and weaken the force, which the controller knows."""
    return replace(case, plant={}, told={**case.plant, 'track_limit': SHORT_TRACK})


def with_resets(case: Case, links: int) -> Case:
    """Put the pendulum anywhere at random times."""
    random = np.random.default_rng((RESETS, case.seed))
    count = round(case.duration / RESET_EVERY)
    slack = max(case.duration - (count + 1) * UNDISTURBED, 0.0)
    times = np.sort(random.uniform(0, slack, count)) + UNDISTURBED * (1 + np.arange(count))
    return replace(case, resets=tuple(
        (round(t / PERIOD), anywhere(random, links)) for t in times.tolist()))


def severe(case: Case, links: int) -> Case:
    """Let all of ALL_AT_ONCE be wrong, so many times."""
    assert case.level is not None
    s, counts = case.level, ALL_AT_ONCE['encoder_counts']
    of = {**ALL_AT_ONCE, 'engine': 'own', 'encoder_counts': round(counts / s)}
    for name in ('actuation_delay', 'motor_time_constant', 'cart_dry_friction', JOINT,
                 'force_bias'):
        low, high = of[name]
        of[name] = s * low, s * high
    low, high = of['force_gain']
    return rig(replace(case, plant={}), links, s * of.pop('body_error'), **{
        **of, 'force_gain': (1 - s * (1 - low), 1 + s * (high - 1))})


def rig(case: Case, links: int, body_error: float = 0.0, **parameters: Any) -> Case:
    """
    Let MuJoCo move the pendulum from nearly hanging, with some parameters.

    A range is drawn from, that of JOINT for each joint; masses and lengths are off by a share
    `body_error` at most.
    """
    random = np.random.default_rng((RIG, case.seed))
    plant: dict[str, Any] = {
        'engine': 'mujoco', 'initial_state': nearly(hanging(links), random)}
    for name, value in parameters.items():
        plant |= {one: random.uniform(*value) if isinstance(value, tuple) else value
                  for one in names_of(name, links)}
    if body_error:
        low, high = 1 - body_error, 1 + body_error
        plant |= {name: getattr(PHYSICAL, name) * random.uniform(low, high)
                  for name in ('cart_mass', *of_each('link{}_mass', links),
                               *of_each('link{}_length', links))}
    return replace(case, plant=plant | case.plant)


def rig_with(about: str, body_error: float = 0.0, sweep: Sweep | None = None,
             **parameters: Any) -> Scenario:
    """Return the scenario of a rig; a sweep has two levels, the half and the whole."""
    def case(given: Case, links: int) -> Case:
        return rig(given, links, body_error, **parameters)
    return Scenario(f'a rig of other make: {about}', range(100), (sweep,) if sweep else (),
                    levels=2, case=case)


def names_of(parameter: str, links: int) -> tuple[str, ...]:
    """Return the parameters that one stands for."""
    if parameter in OF_CASE:
        return ()
    return of_each('joint{}_dry_friction', links) if parameter == JOINT else (parameter,)


def of_each(name: str, links: int) -> tuple[str, ...]:
    """Return the names of a parameter of all links or joints."""
    return tuple(map(name.format, range(1, links + 1)))


def _scaled(name: str, links: int = 1) -> Sweep:
    """Sweep a physical parameter as a share of its nominal value."""
    return Sweep(name, 0.75, 1.25, links=links, nominal=getattr(PHYSICAL, name))


OF_LINK = ('mass', 'length', 'inertia_factor')
MODEL = (_scaled('cart_mass'), *(_scaled(f'link{i}_{name}', i) for name in OF_LINK for i in LINKS),
         *(Sweep(f'joint{i}_friction', 0.0, 0.1, 'N m s/rad', i) for i in LINKS))

ALL_AT_ONCE: dict[str, Any] = {
    'body_error': 0.15, 'actuation_delay': (0.0, 0.03), 'motor_time_constant': (0.0, 0.025),
    'cart_dry_friction': (0.0, 3.0), 'joint_dry_friction': (0.0, 0.03), 'encoder_counts': 4096,
    'velocities': 'none', 'force_gain': (0.85, 1.15), 'force_bias': (-2.0, 2.0)}

SCENARIOS: dict[str, Scenario] = {
    'hanging': Scenario(f'from nearly hanging, at rest but for {NEARLY:g}', range(20)),
    'random': Scenario('from anywhere: x ±1 m, angles ±π, ẋ ±1 m/s, θ̇ ±3 rad/s', range(1000),
                       case=random_start),
    'near_goal': Scenario('from rest with all angles within ±0.3 rad', range(100),
                          case=near_goal),
    'model': Scenario('a plant with other physical parameters than the controller knows', range(1),
                      MODEL, criterion=True),
    'velocity_noise': Scenario(
        'noise on the measured velocities', range(10),
        (Sweep('velocity_noise', 0.0, 0.5, 'm/s, rad/s'),), criterion=True),
    'force_noise': Scenario(
        'noise on the force, up to 18 % of its limit', range(10),
        (Sweep('force_noise', 0.0, 0.18 * LIMITS.force_limit, 'N'),), criterion=True),
    'response': Scenario(
        'a force that lags or overshoots, u = u₋₁ + k (u_des - u₋₁)', range(1),
        (Sweep('actuator_response', 0.1, 2.0),), criterion=True),
    'delay': Scenario('measurements that come late', range(1),
                      (Sweep('delay', 0.0, 0.15, 's'),), criterion=True),
    'pushes': Scenario('three Gaussian pushes of the cart', range(50), criterion=True,
                       case=pushed),
    'transitions': Scenario(
        f'from nearly each equilibrium, at rest but for {NEARLY:g}, to each other', range(100),
        case=transition, ways=transitions),
    'loss': Scenario('states, then forces, that are lost', range(5),
                     (Sweep('state_loss', 0.0, 0.5), Sweep('command_loss', 0.0, 0.5))),
    'jitter': Scenario('forces that come late by chance', range(5),
                       (Sweep('command_jitter', 0.0, 0.05, 's'),)),
    'strong_pushes': Scenario(
        'the profiles of `pushes`, stronger than the drive', range(25),
        (Sweep(PEAK, 10.0, 40.0, 'N'),), levels=4, case=strongly_pushed),
    'tight': Scenario(
        f'{SHORT_TRACK:g} m of track either way and a weak force, both known to the controller',
        range(25), (Sweep('force_limit', 6.0, 12.0, 'N'),), levels=4, case=tight),
    'position_noise': Scenario('noise on the measured positions', range(20), (
        Sweep('position_noise', 0.0, 0.02, 'm, rad'),), levels=5),
    'unknown_delay': Scenario('forces act late, by what no controller is told', range(20), (
        Sweep('actuation_delay', 0.0, 0.1, 's'),), levels=5),
    'all_at_once': Scenario(
        'half to twice of what is wrong with `rig_all`, on our own plant', range(25),
        (Sweep(SEVERITY, 0.5, 2.0),), levels=4, case=severe),
    'uptime': Scenario(
        f'every {RESET_EVERY:g} s in the mean somebody puts the pendulum anywhere; 60 s',
        range(20), case=with_resets, times=6),
    'rig_clean': rig_with('nothing is wrong'),
    'rig_delay': rig_with('forces act 0 to 50 ms late', actuation_delay=(0.0, 0.05)),
    'rig_lag': rig_with('forces lag', sweep=Sweep('motor_time_constant', 0.025, 0.05, 's')),
    'rig_cart': rig_with('dry friction of the cart',
                         sweep=Sweep('cart_dry_friction', 2.0, 4.0, 'N')),
    'rig_joints': rig_with('dry friction of the joints', sweep=Sweep(JOINT, 0.025, 0.05, 'N m')),
    'rig_noise': rig_with('noise on the measured positions',
                          sweep=Sweep('position_noise', 0.0025, 0.005, 'm, rad')),
    'rig_encoders': rig_with('encoders of 2,048 counts, no velocities', encoder_counts=2048,
                             velocities='none'),
    'rig_backlash': rig_with(
        'play between joints and their encoders, 4,096 counts, no velocities',
        encoder_counts=4096, velocities='none',
        sweep=Sweep('joint_backlash', math.radians(0.5), math.radians(1.0), 'rad')),
    'rig_bias': rig_with('a lasting force on the cart', sweep=Sweep('force_bias', 2.5, 5.0, 'N')),
    'rig_gain': rig_with('a force 0.7 to 1.3 times as large', force_gain=(0.7, 1.3)),
    'rig_all': rig_with('all of it at once', **ALL_AT_ONCE),
    'rig_all_fast': rig_with('all of it at once, states at 100 Hz', rate=100.0, **ALL_AT_ONCE)}
RIGS = [name for name in SCENARIOS if name.startswith('rig_')]   # which need MuJoCo
