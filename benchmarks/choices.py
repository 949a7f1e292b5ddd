# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
What each choice of the default set-up is worth: the swing-up with that choice taken back.

Run by `make results`, which keeps what it prints as docs/results/choices.md; takes minutes.
"""

import argparse
from typing import Any

import numpy as np
from tqdm import tqdm

from dp_swing_ros.metrics import measure, Metrics, wilson
from dp_swing_ros.mpc import MpcParameters, RecedingHorizon
from dp_swing_ros.parameters import (
    CostParameters, LimitParameters, PendulumParameters, PlantParameters, PredictionParameters)
from dp_swing_ros.problem import Problem
from dp_swing_ros.simulation import Plant, simulate
from dp_swing_ros.solvers import SOLVERS

SEEDS = range(20)
ALL = ('ilqr', 'ddp', 'mppi')

# what is taken back, for which solvers, and the parameters that do it, by group
CHOICES: list[tuple[str, tuple[str, ...], dict[str, dict[str, Any]]]] = [
    ('nothing: the defaults', ALL, {}),
    ('angle error θ instead of the chord', ALL, {'cost': {'angle_error': 'angle'}}),
    ('terminal cost 1000 S instead of the LQR value', ALL, {'cost': {'terminal_cost': 'scaled'}}),
    ('forces shifted instead of the policy', ALL, {'mpc': {'warm_start': 'forces'}}),
    ('horizon 60, policy shifted', ALL, {'prediction': {'horizon': 60}}),
    ('horizon 60, forces shifted', ALL,
     {'prediction': {'horizon': 60}, 'mpc': {'warm_start': 'forces'}}),
    ('force noise of 1.8 N, policy shifted', ALL, {'plant': {'force_noise': 1.8}}),
    ('force noise of 1.8 N, forces shifted', ALL,
     {'plant': {'force_noise': 1.8}, 'mpc': {'warm_start': 'forces'}}),
    ('samples about forces instead of a policy', ('mppi',), {'solver': {'feedback': False}}),
    ('force noise of 1.8 N, samples about forces', ('mppi',),
     {'plant': {'force_noise': 1.8}, 'solver': {'feedback': False}}),
    ('no samples about the regulator', ('mppi',), {'solver': {'regulator_share': 0.0}}),
    ('white noise', ('mppi',), {'solver': {'noise_correlation': 0.0}}),
    ('noise of one size, 5 N', ('mppi',),
     {'solver': {'smallest_noise': 5.0, 'largest_noise': 5.0}}),
    ('one update a tick', ('mppi',), {'solver': {'updates': 1}}),
]


def episode(name: str, seed: int, groups: dict[str, dict[str, Any]]) -> Metrics:
    """Run 10 s from hanging and measure them."""
    limits = LimitParameters()
    problem = Problem.of(PendulumParameters(), limits, CostParameters(**groups.get('cost', {})),
                         PredictionParameters(**groups.get('prediction', {})))
    controller = RecedingHorizon(
        problem, MpcParameters(solver=name, seed=seed, **groups.get('mpc', {})),
        SOLVERS[name].Parameters(**groups.get('solver', {})))
    plant = Plant(PendulumParameters(), limits,
                  PlantParameters(seed=seed, **groups.get('plant', {})))
    return measure(simulate(plant, controller, 10.0, name))


def row(title: str, name: str, runs: list[Metrics]) -> str:
    """Return a line of the table."""
    successes = sum(run.success for run in runs)
    low, high = wilson(successes, len(runs))
    settled = [run.settling_time for run in runs if run.success]
    settling = f'{np.median(settled):.2f}' if settled else '-'
    return (f'| {title} | `{name}` | {successes} of {len(runs)} ({100 * low:.0f}-'
            f'{100 * high:.0f} %) | {settling} | '
            f'{np.median([run.smoothness for run in runs]):.3f} |')


def main() -> None:
    """Print the page."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    print('# What each choice is worth\n\n'
          'Made by `make results` (choices.py): 10 s from hanging without ROS, in lockstep, seeds '
          f'{SEEDS[0]} to {SEEDS[-1]}; each row takes one choice of the defaults back. In '
          'brackets the 95 % interval (Wilson); the settling time is the median of the '
          'successes, the force step the median standard deviation of Δu over the last 2 s.\n\n'
          '| taken back | solver | upright to the end | settling [s] | force step [N] |\n'
          '| --- | --- | --- | --- | --- |')
    for title, names, groups in CHOICES:
        for name in names:
            runs = [episode(name, seed, groups) for seed in tqdm(
                SEEDS, desc=f'{title}, {name}', leave=False)]
            print(row(title, name, runs), flush=True)


if __name__ == '__main__':
    main()
