# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From motions to parameters: what is found, how well, and what these motions cannot tell."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dp_swing_ros.identification.fit import FINE, Fit
from dp_swing_ros.identification.segments import DURATION, Motion, Segments, segments_of
from dp_swing_ros.identification.unknowns import Parametrisation, SHARE
from dp_swing_ros.pendulum.parameters import DIRECT, Drive, PendulumParameters
from dp_swing_ros.pendulum.state import Array

ROUNDS = 6          # of parameters and of what residuals count by in turns, at most
CONFIDENCE = 1.96   # standard deviations to either side of 95 %


@dataclass(frozen=True)
class Prediction:
    """
    What the segments of one motion were predicted to do, each from its best state.

    Shapes: before and after (S, K, n + 1), of the nominal parameters and of those found.
    """

    segments: Segments
    before: Array
    after: Array


@dataclass(frozen=True)
class Identified:
    """What was found, by name; what could not be told has its nominal value."""

    before: dict[str, float]
    values: dict[str, float]
    intervals: dict[str, tuple[float, float]]  # 95 %, of what was found
    held: dict[str, str]                       # why it was not looked for
    unidentified: dict[str, float]             # half the interval that it would have
    predictions: list[Prediction]              # a motion each
    left_out: int                              # segments that nothing explains

    def rms(self, of: str) -> Array:
        """Return the RMS of the errors of predictions, 'before' or 'after' (n + 1,) [m, rad]."""
        errors = [(getattr(each, of) - each.segments.Q).reshape(-1, each.before.shape[-1])
                  for each in self.predictions]
        rms: Array = np.sqrt(np.mean(np.concatenate(errors) ** 2, axis=0))
        return rms


def identify(motions: Sequence[Motion], physical: PendulumParameters, drive: Drive = DIRECT,
             known: Mapping[str, float] = {}, duration: float = DURATION,
             on_step: Callable[[], object] = lambda: None) -> Identified:
    """
    Identify pendulum and drive from motions, from nominal parameters on.

    `known` are values by name that are right; `duration` [s] is that of a segment. Raises
    UserError where motions say too little, ParameterError for what cannot be known.
    """
    about = Parametrisation(physical, drive, known)
    fit = Fit([segments_of(motion, duration) for motion in motions], about, on_step)
    cut = sum(len(motion.t) for motion in fit.motions)
    fit.free = np.array([i for i, name in enumerate(about.names) if name not in about.held])
    for _ in range(ROUNDS):
        fit.restart()
        fit.solve()
        white = fit.whiten()
        if not fit.leave_out_odd() and white:
            break
    fit.use(FINE)
    for _ in range(2):
        fit.solve()
        fit.whiten()
    unidentified = hold_unidentifiable(fit)
    deviations = fit.deviations()
    found = fit.p.copy()
    bounds = np.array([found, found])
    bounds[:, fit.free] += np.outer((-CONFIDENCE, CONFIDENCE), deviations)
    low, high = about.values(np.clip(bounds, about.lowest, about.highest))
    left_out = cut - sum(len(motion.t) for motion in fit.motions)
    return Identified(
        about.named(about.nominal), about.named(about.values(found)),
        {about.names[i]: (float(low[i]), float(high[i])) for i in fit.free},
        about.held, unidentified, predictions(fit), left_out)


def hold_unidentifiable(fit: Fit) -> dict[str, float]:
    """
    Hold what the motions cannot tell at its nominal value, the least told first; fit the rest.

    It is told if half its interval is less than half its value, or than what is typical of such
    a value. Returns half the intervals of what is not, by name, for a factor as a share.
    """
    unidentified: dict[str, float] = {}
    while len(fit.free):
        about, free = fit.about, fit.free
        half = CONFIDENCE * fit.deviations()
        size = np.where(about.is_factor[free], 0.0, SHARE * np.abs(about.values(fit.p)[free]))
        width = half / np.maximum(size, about.scales[free])
        worst = int(np.argmax(width))
        if width[worst] <= 1:
            break
        unidentified[about.names[free[worst]]] = float(half[worst])
        fit.p[free[worst]] = 0.0
        fit.free = np.delete(free, worst)
        fit.solve()
    return unidentified


def predictions(fit: Fit) -> list[Prediction]:
    """Return what segments are predicted to do by nominal parameters, and by those found."""
    after = fit.differences()
    fit.p = np.zeros_like(fit.p)
    fit.restart()
    return [Prediction(motion, motion.Q + first, motion.Q + second)
            for motion, first, second in zip(fit.motions, fit.differences(), after)]
