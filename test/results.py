# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Rows and descriptions of campaigns that are made up, to test what looks at them."""

import dataclasses
import math

import numpy as np
from synthetic import first, swing_up

from dp_swing_ros.evaluation.campaign.rows import ERROR, Key, Row, UNKNOWN
from dp_swing_ros.evaluation.metrics import measure

HELD = measure(swing_up())
FALLEN = measure(first(swing_up(), 30))


def row(contestant='ilqr', scenario='hanging', seed=0, held=True, parameter='', level=None,
        solve_times=(0.001, 0.002), **metrics):
    """Return the row of an episode that was held or not, with some metrics as given."""
    return Row(Key(contestant, scenario, parameter, level, seed),
               'HELD' if held else 'NEVER_UP', '',
               dataclasses.replace(HELD if held else FALLEN, **metrics), np.array(solve_times))


def error_row(contestant='ilqr', scenario='hanging', seed=0):
    """Return the row of an episode that raised."""
    return Row(Key(contestant, scenario, '', None, seed), ERROR, 'ValueError: no, "never"',
               UNKNOWN, np.zeros(0))


def campaign(contestants=('ilqr', 'mppi'), scenarios=('hanging',), duration=4.0, links=2):
    """Return the description of a campaign of contestants called like their solvers."""
    return {'contestants': {name: {'name': name.split(':')[0], 'plant': {}, 'mpc': {}}
                            for name in contestants},
            'scenarios': {name: {'seeds': [0, 20], 'levels': 0} for name in scenarios},
            'duration': duration, 'links': links, 'version': '0.1.0', 'commit': 'abc',
            'made': dict.fromkeys(('command', 'date', 'machine', 'packages'), 'made up')}


def same(a, b):
    """Return whether two floats are, or are both unknown."""
    return a == b or (math.isnan(a) and math.isnan(b))
