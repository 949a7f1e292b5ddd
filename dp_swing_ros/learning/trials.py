# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Trials of a learner, each from the plant's initial state, until it holds the pendulum."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from dp_swing_ros.learning.learner import Learner
from dp_swing_ros.pendulum.model import ROUNDING
from dp_swing_ros.pendulum.state import Array, deviation
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate

OUT = 0.2       # [rad] of the largest error of an angle: no longer held
PIECE = 0.5     # [s] scaled, between two looks whether it holds


@dataclass(frozen=True)
class Trial:
    """
    What came of a trial.

    Shapes: experience (K,) [s] until each state, from the first trial on; X (K, 2n + 2) the true
    states; deviation (K,) [rad] the largest error of an angle.
    """

    number: int
    experience: Array
    X: Array
    deviation: Array
    held: float          # [s] for how long it was within OUT at the end
    noise: Array         # (n + 1,) standard deviations of what is predicted a period ahead


def trials(learner: Learner, plant: Mapping[str, Any], trial: float, total: float, hold: float,
           on_piece: Callable[[float, float], object] = lambda *_: None) -> Iterator[Trial]:
    """
    Yield trials of so long [s], until one holds at its end or there is so much experience [s].

    One holds that was within OUT for the last time of `hold` [s]; where trials have no end, it
    ends then. Each plant has the parameters that are given, and noise of its own. on_piece is
    called with the experience so far [s] and the last deviation [rad].
    """
    goal, seed = learner.nominal.x_r, int(plant.get('seed', 0))
    number, held, piece = 0, 0.0, learner.nominal.scale.sized(PIECE, 's')
    while total - learner.duration >= piece and held < hold:
        moved = plants.plant({**plant, 'seed': seed + number})
        number, before, states = number + 1, learner.duration, list[Array]()
        learner.begin(1 / moved.parameters.rate)
        piece = max(piece, learner.period)
        while (moved.t + learner.period / 2 < trial
               and moved.t + piece <= total - before + ROUNDING):
            states += [*simulate(moved, learner, min(piece, trial - moved.t)).X[1:]]
            off = deviation(np.array(states), goal)
            held = held_for(off, learner.period)
            on_piece(before + moved.t, float(off[-1]))
            if math.isinf(trial) and held >= hold:
                break
        at = before + learner.period * np.arange(1, len(off) + 1)
        yield Trial(number, at, np.array(states), off, held, learner.noise)


def held_for(off: Array, period: float, limit: float = OUT) -> float:
    """Return for how long [s] deviations (K,) have been within a limit at the end."""
    beyond = np.flatnonzero(~(off <= limit))   # also where it is no number
    return period * (len(off) - 1 - (beyond[-1] if len(beyond) else -1))
