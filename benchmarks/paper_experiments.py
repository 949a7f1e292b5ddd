# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The paper's six experiments, with the defaults, the paper's own set-up, and between them."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dp_swing_ros import declarations
from dp_swing_ros.control import controllers
from dp_swing_ros.evaluation.campaign.contestants import Contestant
from dp_swing_ros.evaluation.scenarios import Case, NEARLY, RIG
from dp_swing_ros.pendulum.parameters import LimitParameters
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
    """The name in pictures, if drawn; parameter files, and what goes on top of them; for whom."""

    title: str = ''
    files: tuple[str, ...] = ()
    plant: Mapping[str, Any] = {}
    mpc: Mapping[str, Any] = {}
    solvers: Collection[str] = tuple(STEPS)


def ours(*names: str) -> dict[str, Any]:
    """Return the defaults of some parameters of the mpc."""
    values = controllers.MPC.complete({})
    return {name: values[name] for name in names}


FINE, EULER = ('paper',), ('paper', 'paper_euler')
MODEL = {'physics_step': PERIOD}              # of a plant that moves as the model predicts
EULERS = {'model': 'euler'}                   # that of the paper, whatever the plant
BOUND = {'force_limit': LimitParameters().force_limit}
PLAIN = {'terminal_scale': 1.0}
GAINS = ours('mppi.feedback')
SAMPLING = ours('mppi.samples', 'mppi.iterations', 'mppi.temperature', 'mppi.temperature_scale',
                'mppi.smallest_noise', 'mppi.largest_noise', 'mppi.noise_correlation')
COST = ours('angle_error', 'terminal_cost', 'horizon', 'state_weights')
SETUPS = {
    'defaults': Setup("This package's defaults"),
    'paper': Setup("The paper's own set-up and forward Euler plant", EULER),
    'paper, 20 N': Setup('', EULER, BOUND, BOUND),
    'paper, RK4 plant': Setup('', FINE, MODEL),
    'paper, RK4 plant, 20 N': Setup('', FINE, {**MODEL, **BOUND}, BOUND),
    'paper, fine plant': Setup('', FINE),
    'paper, fine plant, 20 N': Setup('', FINE, BOUND, BOUND),
    'paper, Euler model, fine plant': Setup('', FINE, {}, EULERS),
    'paper, Euler model, fine plant, 20 N': Setup('', FINE, BOUND, {**BOUND, **EULERS}),
    'paper, S_f = S': Setup('', EULER, {}, PLAIN, ('mppi',)),
    **{f'paper, fine plant, 20 N, {name}': Setup('', FINE, BOUND, {**BOUND, **mpc}, ('mppi',))
       for name, mpc in {
           'S_f = S': PLAIN, 'our sampling and cost': {**SAMPLING, **COST},
           'our gains and sampling': {**GAINS, **SAMPLING},
           'our gains, sampling and cost': {**GAINS, **SAMPLING, **COST}}.items()}}


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
    values, setup = declarations.read(files_of(key)), SETUPS[key.setup]
    return Contestant(f'{key.solver}, {key.setup}', key.solver,
                      {**values['plant'], **setup.plant}, {**values['mpc'], **setup.mpc})


def case(key: Key, seed: int) -> Case:
    """Return one episode of an experiment but for who plays it; no two seeds start alike."""
    random, x = np.random.default_rng((RIG, seed)), STARTS[key.start]
    return Case(key.start, seed, STEPS[key.solver] * PERIOD, plant={
        'initial_state': tuple((x + random.normal(0.0, NEARLY, len(x))).tolist())})


def episodes() -> list[tuple[Contestant, Case]]:
    """Return all episodes of all experiments."""
    return [(one, case(key, seed)) for key in keys() for one in [contestant(key)]
            for seed in range(SEEDS)]
