# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From motions to parameters: what is found, how well, and what these motions cannot tell."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from dp_swing_ros.identification.base_parameters import (
    base_parameters, base_parameters_of_links, Quantity)
from dp_swing_ros.identification.fit import FINE, Fit
from dp_swing_ros.identification.given_cart import HEAVY, on_given_cart
from dp_swing_ros.identification.guess import guessed
from dp_swing_ros.identification.segments import Motion, Segments, segments_of
from dp_swing_ros.identification.unknowns import OF_CART, Parametrisation, SHARE
from dp_swing_ros.pendulum.parameters import DIRECT, Drive, FORCE, PendulumParameters
from dp_swing_ros.pendulum.state import Array

ROUNDS = 6          # of parameters and of what residuals count by in turns, at most
CARTS = FREE, GIVEN = 'free', 'given'   # moved by commands and links; or as it was recorded


@dataclass(frozen=True)
class Prediction:
    """
    What the segments of one motion were predicted to do, each from its best state.

    Shapes: before and after (S, K, n + 1), of the nominal parameters and of those found.
    """

    segments: Segments
    before: Array
    after: Array


class BaseParameter(NamedTuple):
    """One of base_parameters.py, with its interval of 95 %."""

    value: float
    low: float
    high: float
    unit: str


@dataclass(frozen=True)
class Identified:
    """What was found, by name; what could not be told is as it was guessed to be at first."""

    before: dict[str, float]
    values: dict[str, float]
    intervals: dict[str, tuple[float, float]]  # 95 %, of what was found
    at_bound: list[str]                        # what ended at a bound of the search
    held: dict[str, str]                       # why it was not looked for
    unidentified: dict[str, float]             # half the interval that it would have
    predictions: list[Prediction]              # a motion each
    left_out: int                              # segments that nothing explains
    cart: str                                  # FREE, or GIVEN: then all this is of links alone
    base: dict[str, 'BaseParameter']           # what is told of the bodies, however they share it
    creep: float                               # [m/s, rad/s] scaled, of dry friction; see CREEPS

    @property
    def joints(self) -> list[int]:
        """Return which positions were predicted."""
        return list(range(self.cart == GIVEN, self.predictions[0].before.shape[-1]))

    def rms(self, of: str) -> Array:
        """Return the RMS of the errors of predictions, 'before' or 'after' (n + 1,) [m, rad]."""
        errors = [(getattr(each, of) - each.segments.Q).reshape(-1, each.before.shape[-1])
                  for each in self.predictions]
        rms: Array = np.sqrt(np.mean(np.concatenate(errors) ** 2, axis=0))
        return rms


def identify(motions: Sequence[Motion], physical: PendulumParameters, drive: Drive = DIRECT,
             known: Mapping[str, float] = {}, on_step: Callable[[], object] = lambda: None,
             cart: str = FREE) -> Identified:
    """
    Identify pendulum and drive from motions, from nominal parameters of about any size on.

    `known` are values by name that are right; where the motion of the cart is GIVEN, commands say
    nothing, and what is found are the links. Raises UserError where motions say too little,
    ParameterError for what cannot be known.
    """
    is_given = cart == GIVEN
    if is_given:
        motions = list(map(on_given_cart, motions))
        drive, physical = DIRECT, replace(physical, drive=FORCE, cart_mass=HEAVY,
                                          cart_friction=0.0, cart_dry_friction=0.0)
    about = Parametrisation(physical, drive, known, guessed(
        motions, physical, drive, known, on_step, is_given), is_given)
    fit = Fit([segments_of(motion, about.scale) for motion in motions], about, on_step)
    cut = sum(len(motion.t) for motion in fit.motions)
    fit.free = np.array([i for i, name in enumerate(about.names) if name not in about.held])
    for _ in range(ROUNDS):
        fit.restart()
        fit.solve()
        white = fit.whiten()
        if not fit.leave_out_odd() and white:
            break
    fit.use(FINE)
    fit.solve()
    fit.whiten()
    creep = fit.choose_creep()
    fit.solve()
    fit.whiten()
    unidentified = hold_unidentifiable(fit)
    found, halves = fit.p.copy(), np.zeros(len(fit.p))
    covariance = fit.covariance()
    halves[fit.searched] = fit.halves(covariance)
    low, high = about.values(
        np.clip([found - halves, found + halves], about.lowest, about.highest))
    at_bounds, base = about.at_bounds(found, halves), base_of(fit, covariance, cart)
    left_out = cut - sum(len(motion.t) for motion in fit.motions)

    values, held = about.named(about.values(found)), dict(about.held)
    for i, (centre, given) in enumerate(zip(about.centres, about.is_centre_given), 1):
        if given:
            values[f'link{i}_centre'] = centre * values[f'link{i}_length']
            held[f'link{i}_centre'] = 'it is as far along the link as it was told'

    def of_rig(values: dict[str, Any]) -> dict[str, Any]:
        return {name: value for name, value in values.items()
                if not (is_given and name in OF_CART)}
    return Identified(
        of_rig(about.named(about.nominal)), of_rig(values),
        {about.names[i]: (float(low[i]), float(high[i])) for i in fit.free if not at_bounds[i]},
        [about.names[i] for i in fit.free if at_bounds[i]], of_rig(held), unidentified,
        predictions(fit), left_out, cart, base, creep)


def hold_unidentifiable(fit: Fit) -> dict[str, float]:
    """
    Hold what the motions cannot tell at its first guess, the least told first; fit the rest.

    It is told if half its interval is less than half its value, or than what is typical of such
    a value, or if it ended at a bound, which is none of its own accord. Returns half the intervals
    of what is not, by name, for a factor as a share.
    """
    unidentified: dict[str, float] = {}
    while len(fit.free):
        about, free = fit.about, fit.free
        half = fit.halves(fit.covariance())
        size = np.where(about.is_factor[free], 0.0, SHARE * np.abs(about.values(fit.p)[free]))
        width = half / np.maximum(size, about.scales[free])
        width[about.at_bounds(fit.p, np.zeros(len(fit.p)))[free]] = 0.0
        worst = int(np.argmax(width))
        if width[worst] <= 1:
            break
        unidentified[about.names[free[worst]]] = float(half[worst])
        fit.p[free[worst]] = about.first[free[worst]]
        fit.free = np.delete(free, worst)
        fit.solve()
    fit.untold = np.array([fit.about.names.index(name) for name in unidentified], dtype=int)
    return unidentified


def base_of(fit: Fit, covariance: Array, cart: str) -> dict[str, BaseParameter]:
    """Return the base parameters of what a fit has found, with intervals, by a covariance."""
    about, searched = fit.about, fit.searched

    def at(p: Array) -> dict[str, Quantity]:
        bodies = about.bodies(p)
        return base_parameters_of_links(bodies) if cart == GIVEN else base_parameters(
            bodies, about.named(about.values(p))['force_gain'])

    def numbers(p: Array) -> Array:
        return np.array([value for value, _ in at(p).values()])
    found = at(fit.p)
    J = np.zeros((len(found), len(searched)))
    for column, i in enumerate(searched):
        step = np.zeros(len(fit.p))
        step[i] = about.differences[i]
        J[:, column] = (numbers(fit.p + step) - numbers(fit.p)) / step[i]
    return {name: BaseParameter(value, value - half, value + half, unit)
            for (name, (value, unit)), half in zip(
                found.items(), fit.halves(covariance, J).tolist())}


def predictions(fit: Fit) -> list[Prediction]:
    """Return what segments are predicted to do by nominal parameters, and by those found."""
    after = fit.differences()
    fit.p = np.zeros_like(fit.p)
    fit.restart()
    return [Prediction(motion, motion.Q + first, motion.Q + second)
            for motion, first, second in zip(fit.motions, fit.differences(), after)]
