# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A first guess of the bodies: the nominal ones in the size with which a motion is predicted best.

Far from the right size a fit ends anywhere: predictions over half a second of a pendulum that
swings five times meanwhile have no more to do with it. Over a time that is short for all sizes
they are nearly what accelerations make of them, so their loss has one minimum. The links tell
their lengths by themselves, on a cart that moves as it was measured; the masses tell the forces.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from dp_swing_ros.identification.fit import Fit, losses, roughly
from dp_swing_ros.identification.given_cart import HEAVY, on_cart_as_measured
from dp_swing_ros.identification.segments import Motion, Segments, segments_of
from dp_swing_ros.identification.unknowns import OF_CART, Parametrisation
from dp_swing_ros.parameters import fields_of
from dp_swing_ros.pendulum.equations import scale_of
from dp_swing_ros.pendulum.parameters import DIRECT, Drive, PendulumParameters

LENGTHS, MASSES = range(-5, 3), range(-4, 5, 2)   # sizes to try: powers of two of the nominal ones
ENOUGH = 1.1   # of the least loss: of what predicts as well, what is nearest to the nominal size
SEGMENTS = 60  # of a motion, for more tell no more of that


def guessed(motions: Sequence[Motion], physical: PendulumParameters, drive: Drive,
            known: Mapping[str, float], on_step: Callable[[], object],
            is_given: bool = False) -> PendulumParameters:
    """
    Return the bodies whose size is about that of what moved, from nominal ones.

    Where the motion of the cart is given, nothing tells their masses. Raises UserError and
    ParameterError as `identify`.
    """
    shortest = scale_of(resized(physical, LENGTHS[0], 0, known))

    def best(motions: Sequence[Motion], drive: Drive, known: Mapping[str, float],
             bodies: Mapping[int, PendulumParameters]) -> int:
        segments = [some_of(segments_of(motion, shortest)) for motion in motions]

        def loss(guess: PendulumParameters) -> float:
            fit = Fit(segments, Parametrisation(physical, drive, known, guess, is_given), on_step)
            fit.whitening = roughly(scale_of(physical), physical.links)   # the same for all
            fit.take(fit.p[fit.free])
            return sum(float(losses(fit.white(each)).sum()) for each in fit.differences())

        found = {power: loss(each) for power, each in bodies.items()}
        return min((power for power in found if found[power] <= ENOUGH * min(found.values())),
                   key=abs)

    # forces that move a heavy cart as it was measured come from no drive
    of_links = {name: value for name, value in known.items() if name not in OF_CART}
    length = best(
        motions if is_given else list(map(on_cart_as_measured, motions)), DIRECT, of_links, {
            power: replace(resized(physical, power, 0, known), cart_mass=HEAVY)
            for power in LENGTHS})
    mass = 0 if is_given else best(motions, drive, known, {
        power: resized(physical, length, power, known) for power in MASSES})
    return resized(physical, length, mass, known)


def resized(physical: PendulumParameters, length: int, mass: int,
            known: Mapping[str, float]) -> PendulumParameters:
    """Return bodies with lengths and masses times powers of two, but for those that are known."""
    powers, values = {'_length': length, '_mass': mass}, dict[str, Any]()
    for field in fields_of(PendulumParameters, physical.links):
        nominal = getattr(physical, field.name)
        for kind, power in powers.items():
            if field.name.endswith(kind):
                values[field.name] = max(nominal * 2.0 ** power, field.metadata['minimum'])
        if field.name in known:
            values[field.name] = known[field.name]
    return physical.estimated(values)


def some_of(segments: Segments) -> Segments:
    """Return a few of the segments of a motion, from all of it."""
    count = len(segments.t)
    return segments.chosen(np.linspace(0, count - 1, min(count, SEGMENTS)).round().astype(int))
