# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
From experience to a learned model, once or while there is more and more of it.

A pendulum of another scale than the default bodies is learned as if it were as large as they are.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
import hashlib
from typing import NamedTuple

import numpy as np

from dp_swing_ros.dynamics import priors
from dp_swing_ros.dynamics.files import LearnedModel
from dp_swing_ros.dynamics.priors import Prior
from dp_swing_ros.dynamics.structured import Structured
from dp_swing_ros.errors import UserError
from dp_swing_ros.learning.experience import Experience
from dp_swing_ros.learning.quality import misses, rms
from dp_swing_ros.learning.regression import FINE, fitted, spread
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.parameters import DIRECT, Drive
from dp_swing_ros.pendulum.units import SAME, SPEEDS, Units

PIECE = 5.0          # [s] scaled, of experience that is held out, or not, as one
PIECES = 5           # at least, of which one is held out
FEWEST = 40          # transitions of which something can be learned

OnRound = Callable[[Structured], object]


class Parts(NamedTuple):
    """Stretches of experience to learn from, and others to judge by what was learned."""

    seen: list[Experience]
    held_out: list[Experience]


def parted(stretches: Sequence[Experience], seed: int, scale: Units = SAME) -> Parts:
    """
    Hold a fifth of the experience out, in pieces: what is near in time is too much alike.

    Raises UserError for too little.
    """
    duration = sum(each.duration for each in stretches)
    count = sum(len(each.U) for each in stretches)
    if count < FEWEST:
        raise UserError(f'there are {count} transitions ({duration:.3g} s) to learn from; '
                        f'expected {FEWEST} at least, better a minute that swings and is held')
    piece = min(scale.sized(PIECE, 's'), duration / PIECES)
    size = max(round(piece / (duration / count)), 1)
    pieces = [each.chosen(np.arange(begin, min(begin + size, len(each.U))))
              for each in stretches for begin in range(0, len(each.U), size)]
    order = np.random.default_rng(seed).permutation(len(pieces)).tolist()
    held_out = set(order[:max(round(len(pieces) / PIECES), 1)])
    return Parts([each for i, each in enumerate(pieces) if i not in held_out],
                 [each for i, each in enumerate(pieces) if i in held_out])


def learned(known: Pendulum, parts: Parts, on_round: OnRound = lambda _: None,
            drive: Drive = DIRECT, scale: Units = SAME) -> LearnedModel:
    """
    Learn a model of a pendulum of a scale, where it is known, about.

    Of two, one that begins with that pendulum and one that begins with nothing, that is returned
    which predicts better what was held out. drive is the one by which the experience has its
    forces. on_round is called with the dynamics again and again. Raises FloatingPointError where
    nothing finite is found.
    """
    seen, held_out = (Experience.joined(each).sized(scale.inverse) for each in parts)
    about = Structured.of(known).sized(scale.inverse)
    found = min((_fitted_finely(*begun, seen, lambda dynamics: on_round(dynamics.sized(scale)))
                 for begun in (priors.structured(known.links), (about, priors.known(about)))),
                key=lambda dynamics: np.nan_to_num(rms(dynamics, held_out), nan=np.inf))
    return replace(model_of(found, Experience.joined(parts.seen), scale), drive=drive)


def _fitted_finely(dynamics: Structured, prior: Prior, seen: Experience,
                   on_round: OnRound) -> Structured:
    return dynamics.with_free(
        fitted(dynamics.with_creep(FINE.creep), seen, prior, FINE.step, on_round))


class Online:
    """A model that is fitted again and again while there is more and more experience."""

    def __init__(self, links: int, scale: Units = SAME) -> None:
        """Take the number of links and the scale; it begins with nothing."""
        self.scale = scale
        self.dynamics, self.prior = priors.structured(links)

    def model(self, seen: Experience) -> LearnedModel:
        """
        Return what all experience so far says.

        Raises FloatingPointError or LinAlgError where nothing finite is found.
        """
        self.dynamics = self.dynamics.with_free(
            fitted(self.dynamics, seen.sized(self.scale.inverse), self.prior))
        return model_of(self.dynamics, seen, self.scale)


def model_of(dynamics: Structured, seen: Experience, scale: Units) -> LearnedModel:
    """Return the model of a pendulum of a scale; dynamics are those of one of the default size."""
    noise = spread(misses(dynamics, seen.sized(scale.inverse)))
    return LearnedModel(dynamics.sized(scale), noise * scale.factors(SPEEDS, len(noise)),
                        {'seconds': seen.duration, 'experience': fingerprint(seen)})


def fingerprint(seen: Experience) -> str:
    """Return a digest of some experience."""
    return hashlib.sha256(b''.join(
        np.ascontiguousarray(each).tobytes() for each in seen)).hexdigest()[:16]
