# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The paper's six experiments, each with the defaults and with the paper's own set-up."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import NamedTuple

from dp_swing_ros import configuration
from dp_swing_ros.evaluation.campaign.contestants import Contestant
from dp_swing_ros.evaluation.scenarios import Case
from dp_swing_ros.pendulum.state import hanging

TOP = Path(__file__).parents[1]
SEEDS = 100
NEAR_GOAL = (0.0, 0.2, 0.2, 0.0, 0.0, 0.0)    # the paper does not name its own
STARTS = {'swing-up': tuple(hanging().tolist()), 'near the goal': NEAR_GOAL}
STEPS = {'ddp': 150, 'ilqr': 150, 'mppi': 100}
PERIOD = 0.05                                 # [s]
PICTURES = {('ddp', 'swing-up'): (2, 3), ('ilqr', 'swing-up'): (4, 5),
            ('mppi', 'swing-up'): (6, 7), ('ddp', 'near the goal'): (8,),
            ('ilqr', 'near the goal'): (9,), ('mppi', 'near the goal'): (10,)}


class Key(NamedTuple):
    """Which experiment; the names of the set-ups are those of SETUPS."""

    solver: str
    start: str
    setup: str


class Setup(NamedTuple):
    """The name in pictures, if drawn; parameter files; other parameters of the mpc; for whom."""

    title: str
    files: tuple[str, ...] = ()
    mpc: Mapping[str, float] = {}
    solvers: Collection[str] = tuple(STEPS)


SETUPS = {
    'defaults': Setup("This package's defaults"),
    'paper': Setup("The paper's own set-up and forward Euler plant",
                   ('paper', 'paper_euler')),
    'paper, fine plant': Setup('', ('paper',)),
    'paper, S_f = S': Setup('', ('paper', 'paper_euler'), {'terminal_scale': 1.0},
                            ('mppi',))}


def keys(figures: Collection[int] = range(2, 11)) -> list[Key]:
    """Return the experiments of some of the paper's figures."""
    return [Key(solver, start, setup) for (solver, start), numbers in PICTURES.items()
            if not set(numbers).isdisjoint(figures)
            for setup, about in SETUPS.items() if solver in about.solvers]


def files_of(key: Key) -> list[Path]:
    """Return the parameter files of an experiment."""
    names = SETUPS[key.setup].files
    if names and key.solver == 'mppi':
        names += ('paper_mppi',)
    return [TOP / 'config' / f'{name}.yaml' for name in names]


def contestant(key: Key) -> Contestant:
    """Return who plays an experiment."""
    values = configuration.read(files_of(key))
    return Contestant(f'{key.solver}, {key.setup}', key.solver, values['plant'],
                      {**values['mpc'], **SETUPS[key.setup].mpc})


def case(key: Key, seed: int) -> Case:
    """Return one episode of an experiment but for who plays it."""
    return Case(key.start, seed, STEPS[key.solver] * PERIOD,
                plant={'initial_state': STARTS[key.start]})


def episodes() -> list[tuple[Contestant, Case]]:
    """Return all episodes of all experiments."""
    return [(contestant(key), case(key, seed)) for key in keys() for seed in range(SEEDS)]
