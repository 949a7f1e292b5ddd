# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Learned dynamics that nobody had to learn, of known or random numbers; and experience."""

import numpy as np

from dp_swing_ros.dynamics.files import LearnedModel
from dp_swing_ros.dynamics.structured import Structured
from dp_swing_ros.learning.experience import Experience
from dp_swing_ros.learning.regression import predicted
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.parameters import PendulumParameters
from dp_swing_ros.simulation import plants

BODIES = {'cart_mass': 0.5, 'link1_mass': 0.5, 'link2_mass': 0.5, 'link1_length': 0.6,
          'link2_length': 0.6, 'cart_friction': 0.1}
# of the default bodies, which is what one believes in that is told no others
USUAL = {'force_limit': 20.0, 'track_limit': 2.4, 'physics_step': 0.005}


def of_chain(physical):
    """Return the structured dynamics that a chain has."""
    return Structured.of(Pendulum.of(physical))


def bent():
    """Return structured dynamics that are none of a chain's, with all harmonics."""
    chain = of_chain(PendulumParameters(cart_friction=0.2, joint1_friction=0.05,
                                        cart_dry_friction=0.5))
    random = np.random.default_rng(1)
    return chain._replace(inertia=chain.inertia + 0.005 * random.normal(size=(6, 9)),
                          potential=chain.potential + 0.3 * random.normal(size=9))


def model_of(dynamics):
    """Return a model with dynamics, of which nothing else is known."""
    return LearnedModel(dynamics, np.full(3, 0.05), {'bags': ['none']})


def experience(duration, seed=0, **plant):
    """Return what is measured under random forces that keep the cart near the middle."""
    rng = np.random.default_rng(seed)
    moved = plants.plant({**BODIES, **USUAL, 'seed': seed, **plant})
    t, X, U = [], [], []
    for _ in range(round(20 * duration) + 1):
        measured = moved.measure()
        x = measured.x
        t.append(measured.t)
        X.append(x)
        moved.obey(float(np.clip(9 * rng.normal() - 10 * x[0] - 3 * x[3], -20, 20)))
        moved.begin_period(0.0)
        moved.advance(0.05)
        U.append(moved.mean_force)
    return Experience.of_run(np.array(t), np.array(X), np.array(U[:-1]))


def rms(dynamics, seen):
    return np.sqrt(np.mean((seen.Y[:, 3:] - predicted(dynamics, seen)) ** 2, axis=0))
