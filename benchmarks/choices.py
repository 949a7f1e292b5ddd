# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What each choice of the default set-up is worth: the runs with that choice taken back."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from dp_swing_ros.evaluation.campaign.contestants import Contestant, key
from dp_swing_ros.evaluation.campaign.report import share
from dp_swing_ros.evaluation.campaign.rows import Row
from dp_swing_ros.evaluation.comparison import rate
from dp_swing_ros.evaluation.metrics import Metrics
from dp_swing_ros.evaluation.scenarios import Case, SCENARIOS
from dp_swing_ros.parameters import fields_of
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.pendulum.state import DEFAULT_LINKS
from dp_swing_ros.tables import compact

ALL = ('ilqr', 'ddp', 'mppi')
DURATION = 10.0  # [s]

# a plant that is not as the controller has it: all masses and lengths
HEAVIER = {field.name: 1.2 * field.default
           for field in fields_of(PendulumParameters, DEFAULT_LINKS)
           if field.name.endswith(('_mass', '_length'))}


class Choice(NamedTuple):
    """What is taken back, the parameters of mpc and plant that do it, and where it shows."""

    title: str
    mpc: dict[str, Any] = {}
    plant: dict[str, Any] = {}
    solvers: tuple[str, ...] = ALL
    scenario: str = 'hanging'
    seeds: int = 20


ALONE = {'first_starts': 1, 'other_starts': 0}
CHOICES = [
    Choice('nothing: the defaults'),
    Choice('nothing', scenario='random', seeds=50),
    Choice('one start a tick', ALONE),
    Choice('one start a tick', ALONE, scenario='random', seeds=50),
    Choice('one start at the first tick', {'first_starts': 1}, scenario='random', seeds=50),
    Choice('one start at later ticks', {'other_starts': 0}, scenario='random', seeds=50),
    Choice('nothing', scenario='near_goal', seeds=50),
    Choice('one start a tick', ALONE, scenario='near_goal', seeds=50),
    Choice('angle error θ instead of the chord', {'angle_error': 'angle'}),
    Choice('terminal cost 1000 S instead of the LQR value', {'terminal_cost': 'scaled'}),
    Choice('forces shifted instead of the policy', {'warm_start': 'forces'}),
    Choice('horizon 60', {'horizon': 60}, scenario='random', seeds=20),
    Choice('horizon 60, one start a tick', {'horizon': 60, **ALONE}, scenario='random', seeds=20),
    Choice('horizon 60, forces shifted', {'horizon': 60, 'warm_start': 'forces'},
           scenario='random', seeds=20),
    Choice('horizon 100', {'horizon': 100}, scenario='random', seeds=20),
    Choice('force noise of 1.8 N', {}, {'force_noise': 1.8}),
    Choice('force noise of 1.8 N, forces shifted', {'warm_start': 'forces'},
           {'force_noise': 1.8}),
    Choice('force noise of 1.8 N, no estimator', {'estimator': 'none'}, {'force_noise': 1.8}),
    Choice('no estimator', {'estimator': 'none'}),
    Choice('velocity noise of 0.5', {}, {'velocity_noise': 0.5}),
    Choice('velocity noise of 0.5, no estimator', {'estimator': 'none'}, {'velocity_noise': 0.5}),
    Choice('all masses and lengths 20 % larger', {}, HEAVIER),
    Choice('all masses and lengths 20 % larger, state alone estimated',
           {'ekf.body_error': 0.0, 'ekf.friction_error': 0.0}, HEAVIER),
    Choice('all masses and lengths 20 % larger, no estimator', {'estimator': 'none'}, HEAVIER),
    Choice('samples about forces instead of a policy', {'mppi.feedback': False},
           solvers=('mppi',)),
    Choice('force noise of 1.8 N, samples about forces', {'mppi.feedback': False},
           {'force_noise': 1.8}, ('mppi',)),
    Choice('white noise', {'mppi.noise_correlation': 0.0}, solvers=('mppi',)),
    Choice('noise of one size, 5 N', {'mppi.smallest_noise': 5.0, 'mppi.largest_noise': 5.0},
           solvers=('mppi',)),
    Choice('no noise above 10 N', {'mppi.largest_noise': 10.0}, solvers=('mppi',)),
    Choice('one update a tick', {'mppi.iterations': 1}, solvers=('mppi',)),
]


def contestant(choice: Choice, name: str) -> Contestant:
    """Return a solver with a choice taken back."""
    return Contestant(f'{name}, {choice.title}', name, choice.plant, choice.mpc)


def of_choice(choice: Choice, name: str) -> list[tuple[Contestant, Case]]:
    """Return the episodes of a row of the page."""
    cases = SCENARIOS[choice.scenario].cases(
        choice.scenario, range(choice.seeds), None, DURATION)
    return [(contestant(choice, name), case) for case in cases]


def episodes() -> list[tuple[Contestant, Case]]:
    """Return the episodes of all rows of the page."""
    return [episode for choice in CHOICES for name in choice.solvers
            for episode in of_choice(choice, name)]


def line(choice: Choice, name: str, runs: Sequence[Metrics]) -> tuple[str, ...]:
    """Return a row of the page."""
    settled = [run.settling_time for run in runs if run.success]
    return (choice.title, choice.scenario, f'`{name}`', share(rate([run.success for run in runs])),
            f'{np.median(settled):.2f}' if settled else '-',
            f'{np.median([run.smoothness for run in runs]):.3f}')


def page(rows: Sequence[Row], made: str) -> str:
    """Return the page from the rows of all runs."""
    found = {row.key: row.metrics for row in rows}
    lines = [line(choice, name, [found[key(*episode)] for episode in of_choice(choice, name)])
             for choice in CHOICES for name in choice.solvers]
    return '\n'.join([
        '# What each choice is worth\n', made,
        f'{DURATION:g} s without ROS, in lockstep, of the scenarios of [evaluate]'
        '(../evaluation.md), from their first seed on; the rows: '
        '[choices.csv.gz](choices.csv.gz). Each line takes one choice of the defaults back. In '
        'brackets the 95 % interval (Wilson); the settling time is the median of the successes, '
        'the force step the median standard '
        'deviation of Δu over the last 2 s.\n',
        compact([('taken back', 'scenario', 'solver', 'upright to the end', 'settling [s]',
                  'force step [N]'), *lines]), ''])
