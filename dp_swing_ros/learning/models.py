# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From experience to a learned model of a kind, once or while there is more and more of it."""

from collections.abc import Callable, Sequence
from dataclasses import replace
import hashlib
from importlib import import_module
import math
from typing import NamedTuple

import numpy as np

from dp_swing_ros.dynamics.files import LearnedModel
from dp_swing_ros.dynamics.kinds import BlackBox, Learned, Residual
from dp_swing_ros.errors import UserError
from dp_swing_ros.learning import priors
from dp_swing_ros.learning.experience import Experience
from dp_swing_ros.learning.quality import misses, rms
from dp_swing_ros.learning.regression import FINE, fitted, Posterior, Prior, spread
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.parameters import DIRECT, Drive

DRAWS = 5            # other models that the experience allows
PIECE = 5.0          # [s] of experience that is held out, or not, as one
PIECES = 5           # at least, of which one is held out
FEWEST = 40          # transitions of which something can be learned
HIDDEN = 16          # units of a network: twice as many take twice as long in every solve
MOST = 2400          # transitions that hidden units are trained by: two minutes
TRAINED = 5.0        # [s] more experience, for which hidden units are trained again

OnRound = Callable[[Learned], object]


class Parts(NamedTuple):
    """Stretches of experience to learn from, and others to judge by what was learned."""

    seen: list[Experience]
    held_out: list[Experience]


def parted(stretches: Sequence[Experience], seed: int) -> Parts:
    """
    Hold a fifth of the experience out, in pieces: what is near in time is too much alike.

    Raises UserError for too little.
    """
    duration = sum(each.duration for each in stretches)
    count = sum(len(each.U) for each in stretches)
    if count < FEWEST:
        raise UserError(f'there are {count} transitions ({duration:.3g} s) to learn from; '
                        f'expected {FEWEST} at least, better a minute that swings and is held')
    size = max(round(min(PIECE, duration / PIECES) / (duration / count)), 1)
    pieces = [each.chosen(np.arange(begin, min(begin + size, len(each.U))))
              for each in stretches for begin in range(0, len(each.U), size)]
    order = np.random.default_rng(seed).permutation(len(pieces)).tolist()
    held_out = set(order[:max(round(len(pieces) / PIECES), 1)])
    return Parts([each for i, each in enumerate(pieces) if i not in held_out],
                 [each for i, each in enumerate(pieces) if i in held_out])


def learned(kind: str, known: Pendulum, parts: Parts, hidden: int, seed: int,
            on_round: OnRound = lambda _: None, drive: Drive = DIRECT) -> LearnedModel:
    """
    Learn a model of a kind, where a pendulum is known, about.

    A residual model is of that pendulum, with frictions of any size. Of structured ones, one is
    about it and one about nothing, and that is returned which predicts better what was held out.
    Networks have so many hidden units. drive is the one by which the experience has its forces.
    on_round is called with the dynamics again and again. Raises FloatingPointError where nothing
    finite is found.
    """
    held_out = Experience.joined(parts.held_out)
    begun: list[tuple[Learned, Prior]] = [
        priors.structured(known.links), priors.known(known)] if kind == 'structured' else [
        _trained(kind, known, parts, hidden, seed, on_round)]
    found = min((_fitted_finely(*each, parts, seed, on_round) for each in begun),
                key=lambda model: np.nan_to_num(rms(model.dynamics, held_out), nan=np.inf))
    return replace(found, drive=drive)


def _fitted_finely(dynamics: Learned, prior: Prior, parts: Parts, seed: int,
                   on_round: OnRound) -> LearnedModel:
    seen = Experience.joined(parts.seen)
    found = fitted(dynamics.with_creep(FINE.creep), seen, prior, FINE.step, on_round)
    return model_of(dynamics, found, seen, seed)


def _trained(kind: str, known: Pendulum, parts: Parts, hidden: int, seed: int,
             on_round: OnRound = lambda _: None) -> tuple[Residual | BlackBox, Prior]:
    """Return dynamics with a network that is trained, and the prior of what is to be fitted."""
    try:   # torch takes seconds to load, and who needs no network may do without
        training = import_module('dp_swing_ros.learning.training')
    except ModuleNotFoundError as error:
        raise UserError(f'a network is trained by torch, and there is none ({error}); install it: '
                        'pip install "dp_swing_ros[torch]"') from None
    seen, held_out = map(Experience.joined, parts)
    seen = seen.chosen(np.unique(np.linspace(0, len(seen.U) - 1, MOST).round().astype(int)))
    network = training.initial(known.links, hidden, training.Scales.of(seen), seed)
    untrained: Residual | BlackBox = BlackBox(network)
    if kind == 'residual':   # what is dry is no smooth function, and no network's to learn
        untrained = Residual(known, network)
        frictions = fitted(untrained.with_creep(FINE.creep), seen, priors.frictions(untrained),
                           FINE.step)
        untrained = untrained.with_free(frictions.mean)
    found: Residual | BlackBox = training.trained(untrained, seen, held_out, on_round)
    return found, priors.last_layer(found)


class Online:
    """A model of a kind, fitted again and again while there is more and more experience."""

    def __init__(self, kind: str, known: Pendulum, seed: int, hidden: int = HIDDEN) -> None:
        """Take what `learned` takes; a structured model begins with nothing."""
        self.kind, self.known, self.seed, self.hidden = kind, known, seed, hidden
        self.trained = -math.inf   # [s] of experience that the hidden units are of
        self.dynamics: Learned
        self.dynamics, self.prior = priors.structured(known.links)

    def model(self, seen: Experience) -> LearnedModel:
        """
        Return what all experience so far says.

        A network's last layer is fitted each time, its hidden units now and then. Raises
        UserError for too little, and where nothing finite is found FloatingPointError or
        LinAlgError.
        """
        if self.kind != 'structured' and seen.duration >= self.trained + TRAINED:
            self.dynamics, self.prior = _trained(
                self.kind, self.known, parted([seen], self.seed), self.hidden, self.seed)
            self.trained = seen.duration
        found = model_of(self.dynamics, fitted(self.dynamics, seen, self.prior), seen, self.seed)
        self.dynamics = found.dynamics
        return found


def model_of(dynamics: Learned, found: Posterior, seen: Experience, seed: int) -> LearnedModel:
    """Return the model that a fit of the free numbers of dynamics to some experience has found."""
    dynamics = dynamics.with_free(found.mean)
    n = dynamics.links
    return LearnedModel(
        dynamics, found.draws(DRAWS, np.random.default_rng(seed)), spread(misses(dynamics, seen)),
        np.abs(seen.variables[:, n:]).max(axis=0),
        {'seconds': seen.duration, 'experience': fingerprint(seen), 'seed': seed})


def fingerprint(seen: Experience) -> str:
    """Return a digest of some experience."""
    return hashlib.sha256(b''.join(
        np.ascontiguousarray(each).tobytes() for each in seen)).hexdigest()[:16]
