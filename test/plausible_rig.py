# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Half a minute of the plausible rig, config/rig.yaml, moved by MuJoCo and pushed now and then."""

from pathlib import Path

from intervals import watched
import numpy as np

from dp_swing_ros import declarations
from dp_swing_ros.control import controllers
from dp_swing_ros.pendulum.state import hanging
from dp_swing_ros.simulation import plants

RIG = Path(__file__).parents[1] / 'config' / 'rig.yaml'
DURATION, APART = 30.0, 3.0   # [s], and between pushes
STRONGEST = 30.0              # [N] of them
NEARLY = 1e-3                 # [SI] standard deviation of a start from hanging
WITHIN = 0.03                 # of itself, to which a parameter is to be found
DRY, LATE = 0.15, 0.003       # of a friction; [s] of a delay or time constant
ZERO = 1e-3                   # [rad] of an encoder
RUB = {'cart': 0.05, 'joint': 0.005}  # [N s/m, N m s/rad] viscous friction that none may pass for


def plant():
    """Return the plant, nearly hanging."""
    start = hanging() + np.random.default_rng((1, 0)).normal(0.0, NEARLY, len(hanging()))
    return plants.plant({**declarations.read([RIG])['plant'], 'seed': 0,
                         'initial_state': start.tolist()})


def record():
    """Return a motion of the rig as its sensors see it, under an mpc that is told nothing."""
    rig = plant()
    rate = rig.parameters.rate
    pushes, every = np.zeros(round(DURATION * rate)), round(APART * rate)
    pushes[every::every] = np.random.default_rng((2, 0)).uniform(
        -STRONGEST, STRONGEST, len(pushes[every::every]))
    return watched(rig, controllers.controller({'seed': 0}), pushes)


def truth():
    """Return the parameters of the rig."""
    rig = plant()
    return {**vars(rig.physical), **vars(rig.drive), 'link1_balance': 0.0, 'link2_balance': 0.0}


def allowed(name, value):
    """Return by how much a found value may differ from the true one."""
    if name.endswith('_dry_friction'):
        return DRY * value
    if name.endswith('_friction'):
        return RUB[name[:-9].rstrip('123_')]
    if name.endswith('_balance'):
        return ZERO
    if name in ('actuation_delay', 'motor_time_constant'):
        return LATE
    return 0.1 if name == 'force_bias' else WITHIN * value
