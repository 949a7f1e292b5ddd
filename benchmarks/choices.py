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

from dp_swing_ros import configuration
from dp_swing_ros.comparison import wilson
from dp_swing_ros.metrics import measure, Metrics
from dp_swing_ros.simulation import simulate

SEEDS = range(20)
ALL = ('ilqr', 'ddp', 'mppi')

# what is taken back, for which solvers, the parameters of the mpc that do it, and of the plant
CHOICES: list[tuple[str, tuple[str, ...], dict[str, Any], dict[str, Any]]] = [
    ('nothing: the defaults', ALL, {}, {}),
    ('angle error θ instead of the chord', ALL, {'angle_error': 'angle'}, {}),
    ('terminal cost 1000 S instead of the LQR value', ALL, {'terminal_cost': 'scaled'}, {}),
    ('forces shifted instead of the policy', ALL, {'warm_start': 'forces'}, {}),
    ('horizon 60, policy shifted', ALL, {'horizon': 60}, {}),
    ('horizon 60, forces shifted', ALL, {'horizon': 60, 'warm_start': 'forces'}, {}),
    ('force noise of 1.8 N, policy shifted', ALL, {}, {'force_noise': 1.8}),
    ('force noise of 1.8 N, forces shifted', ALL, {'warm_start': 'forces'}, {'force_noise': 1.8}),
    ('samples about forces instead of a policy', ('mppi',), {'mppi.feedback': False}, {}),
    ('force noise of 1.8 N, samples about forces', ('mppi',), {'mppi.feedback': False},
     {'force_noise': 1.8}),
    ('no samples about the regulator', ('mppi',), {'mppi.regulator_share': 0.0}, {}),
    ('white noise', ('mppi',), {'mppi.noise_correlation': 0.0}, {}),
    ('noise of one size, 5 N', ('mppi',),
     {'mppi.smallest_noise': 5.0, 'mppi.largest_noise': 5.0}, {}),
    ('one update a tick', ('mppi',), {'mppi.updates': 1}, {}),
]


def episode(name: str, seed: int, mpc: dict[str, Any], plant: dict[str, Any]) -> Metrics:
    """Run 10 s from hanging and measure them."""
    return measure(simulate(configuration.plant({**plant, 'seed': seed}),
                            configuration.controller({**mpc, 'solver': name, 'seed': seed}),
                            10.0, name))


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
    for title, names, mpc, plant in CHOICES:
        for name in names:
            runs = [episode(name, seed, mpc, plant) for seed in tqdm(
                SEEDS, desc=f'{title}, {name}', leave=False)]
            print(row(title, name, runs), flush=True)


if __name__ == '__main__':
    main()
