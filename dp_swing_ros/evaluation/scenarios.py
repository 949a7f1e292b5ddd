# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Scenarios: what a campaign puts every controller through, each a name and a list of cases.

The sweeps are those of the DFKI double-pendulum leaderboards, scaled to this plant: what is swept
is changed in the plant alone, the controller keeps its nominal model. A start and a profile of
pushes depend on the seed alone, so that every controller meets the same.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
import math
from typing import Any

import numpy as np

from dp_swing_ros.pendulum.parameters import LimitParameters, PendulumParameters
from dp_swing_ros.pendulum.state import angles, Array, DEFAULT_LINKS, LINKS, upright
from dp_swing_ros.simulation.plant import PlantParameters

PHYSICAL, LIMITS = PendulumParameters(), LimitParameters()
PERIOD = 1 / PlantParameters().rate    # [s]
START, PUSHES = 1, 2                   # before the seed: streams beside those of streams.py

RANDOM_START = (1.0, math.pi, 1.0, 3.0)  # largest x, θ, ẋ and θ̇, either way
NEAR_GOAL = 0.3                        # [rad] largest angle at the start of near_goal

LEVELS = 21                            # of a sweep
PROFILE = 'profile'                    # what pushes sweep: a profile is a level
PULSES = 3                             # in a profile of pushes
FIRST_PUSH, LAST_PUSH, APART = 0.5, 7.0, 1.0  # [s] between their middles
WIDTHS = (0.05, 0.1)                   # [s] standard deviations of the Gaussians
STRONGEST_PUSH = LIMITS.force_limit / 2  # [N]


@dataclass(frozen=True)
class Case:
    """One episode but for who controls it."""

    scenario: str
    seed: int
    duration: float = 10.0                                    # [s]
    parameter: str = ''                                       # what is swept, if anything
    level: float | None = None
    plant: dict[str, Any] = field(default_factory=dict)       # parameters that differ
    pushes: tuple[float, ...] = ()                            # [N] one force a period


@dataclass(frozen=True)
class Sweep:
    """A parameter of the plant over a range, in its unit or as a share of its nominal value."""

    parameter: str
    low: float
    high: float
    unit: str = ''
    links: int = 1         # that there must be
    nominal: float = 1.0   # what a level is a share of


@dataclass(frozen=True)
class Scenario:
    """
    What one word on the command line stands for.

    With sweeps it has cases for every level of each and every seed; else one for every seed, and
    `case` completes it. A criterion counts in the robustness score.
    """

    about: str
    seeds: range
    sweeps: tuple[Sweep, ...] = ()
    criterion: bool = False
    case: Callable[[Case, int], Case] = lambda case, links: case

    def cases(self, name: str, seeds: range | None, levels: int | None,
              duration: float, links: int = DEFAULT_LINKS) -> Iterator[Case]:
        """Yield the cases, with other seeds or another number of levels where given."""
        if not self.sweeps:
            for seed in seeds or self.seeds:
                yield self.case(Case(name, seed, duration), links)
        for sweep in (each for each in self.sweeps if each.links <= links):
            for level in np.linspace(sweep.low, sweep.high, levels or LEVELS).tolist():
                plant = {sweep.parameter: level * sweep.nominal}
                for seed in seeds or self.seeds:
                    yield Case(name, seed, duration, sweep.parameter, level, plant)


def random_start(case: Case, links: int) -> Case:
    """Start anywhere."""
    largest = np.repeat(RANDOM_START, (1, links, 1, links))
    x = np.random.default_rng((START, case.seed)).uniform(-largest, largest)
    return replace(case, plant={'initial_state': tuple(x.tolist())})


def near_goal(case: Case, links: int) -> Case:
    """Start at rest with all links off the vertical, as in the paper's Figs. 8-10."""
    x = upright(links)
    x[angles(x)] = np.random.default_rng((START, case.seed)).uniform(-NEAR_GOAL, NEAR_GOAL, links)
    return replace(case, plant={'initial_state': tuple(x.tolist())})


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


def _scaled(name: str, links: int = 1) -> Sweep:
    """Sweep a physical parameter as a share of its nominal value."""
    return Sweep(name, 0.75, 1.25, links=links, nominal=getattr(PHYSICAL, name))


OF_LINK = ('mass', 'length', 'inertia_factor')
MODEL = (_scaled('cart_mass'), *(_scaled(f'link{i}_{name}', i) for name in OF_LINK for i in LINKS),
         *(Sweep(f'joint{i}_friction', 0.0, 0.1, 'N m s/rad', i) for i in LINKS))

SCENARIOS: dict[str, Scenario] = {
    'hanging': Scenario('from hanging at rest', range(20)),
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
    'loss': Scenario('states, then forces, that are lost', range(5),
                     (Sweep('state_loss', 0.0, 0.5), Sweep('command_loss', 0.0, 0.5))),
    'jitter': Scenario('forces that come late by chance', range(5),
                       (Sweep('command_jitter', 0.0, 0.05, 's'),))}
