# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How far a learned model is to be trusted, by what a tick shows of it."""

import math
from typing import NamedTuple

import numpy as np

from dp_swing_ros.dynamics.files import LearnedModel
from dp_swing_ros.pendulum.model import hold, Model
from dp_swing_ros.pendulum.state import Array

REACH = 1.1   # times the largest speeds of the experience, beyond which nothing is known


class Trust(NamedTuple):
    """
    What a tick shows of a learned model, NaN where it does not.

    error is by how much the last prediction of a speed was off, and spread by how much the
    members of the model differ from it in the next, the worst speed of each, in standard
    deviations of what predictions missed in training. reach is the largest ratio of a speed to
    those of the experience.
    """

    error: float
    spread: float
    reach: float

    @property
    def warning(self) -> str:
        """Return what is wrong; nothing where nothing is."""
        return '' if self.reach <= REACH else (
            f'it moves {self.reach:.2g} times as fast as all that the model was learned from')


def trust(learned: LearnedModel, model: Model, x: Array, u: float,
          measured: Array, predicted: Array | None) -> Trust:
    """
    Judge a learned model, and its Model with the step of a plan, in a state under a force [N].

    Shapes: x (2n + 2,); measured and predicted (2n + 2,), the last state twice, NaN where it was
    not measured.
    """
    v, w = x[len(x) // 2], x[len(x) // 2 + 1:]
    error = math.nan
    if predicted is not None:
        off = np.abs(np.hsplit(measured - predicted, 2)[1]) / learned.noise
        error = float(np.fmax.reduce(off))
    own, *others = (np.hsplit(hold(model._replace(pendulum=each), x, u, model.h), 2)[1]
                    for each in (learned.dynamics, *learned.members))
    spread = np.array(math.nan)
    if others:
        spread = np.sqrt(np.mean((np.array(others) - own) ** 2, axis=0)) / learned.noise
    largest = np.maximum(np.append(learned.largest[:len(w)], learned.largest[-1]), 1e-9)
    return Trust(error, float(spread.max()),
                 float(np.max(np.abs(np.append(w, v)) / largest)))
