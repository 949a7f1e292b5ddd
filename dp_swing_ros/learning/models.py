# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""From stretches of experience to a learned model of a kind."""

from collections.abc import Callable, Sequence
import hashlib
from importlib import import_module
from typing import Any, NamedTuple

import numpy as np

from dp_swing_ros.dynamics.files import LearnedModel
from dp_swing_ros.dynamics.kinds import BlackBox, Learned, Residual
from dp_swing_ros.errors import UserError
from dp_swing_ros.learning import priors
from dp_swing_ros.learning.experience import Experience
from dp_swing_ros.learning.regression import fitted, Posterior
from dp_swing_ros.pendulum.equations import Pendulum
from dp_swing_ros.pendulum.parameters import PendulumParameters

DRAWS = 5            # other models that the experience allows
PIECE = 5.0          # [s] of experience that is held out, or not, as one
PIECES = 5           # at least, of which one is held out
FEWEST = 40          # transitions of which something can be learned


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


def learned(kind: str, physical: PendulumParameters, parts: Parts, hidden: int, seed: int,
            on_round: Callable[[Learned], object] = lambda _: None) -> LearnedModel:
    """
    Learn a model of a kind; a residual one of the pendulum that is known.

    Networks have so many hidden units. on_round is called with the dynamics again and again.
    Raises FloatingPointError where nothing finite is found.
    """
    seen, n = Experience.joined(parts.seen), physical.links
    dynamics: Any
    if kind == 'structured':
        dynamics, prior = priors.structured(n)
    else:
        try:   # torch takes seconds to load, and who needs no network may do without
            training = import_module('dp_swing_ros.learning.training')
        except ModuleNotFoundError as error:
            raise UserError(f'a network is trained by torch, and there is none ({error}); install '
                            'it: pip install "dp_swing_ros[torch]"') from None
        network = training.initial(n, hidden, training.Scales.of(seen), seed)
        untrained = BlackBox(network) if kind == 'black_box' else (
            Residual(Pendulum.of(physical), network))
        dynamics = training.trained(untrained, seen, Experience.joined(parts.held_out), on_round)
        prior = priors.last_layer(dynamics.network)
    found = fitted(dynamics, seen, prior, on_round)
    return model_of(dynamics, found, seen, np.random.default_rng(seed), {
        'seconds': seen.duration, 'experience': fingerprint(seen), 'seed': seed})


def model_of(dynamics: Learned, found: Posterior, seen: Experience, random: np.random.Generator,
             about: dict[str, Any]) -> LearnedModel:
    """Return the model that a fit to some experience has found."""
    n = dynamics.links
    return LearnedModel(dynamics.with_free(found.mean), found.draws(DRAWS, random), found.noise,
                        np.abs(seen.variables[:, n:]).max(axis=0), about)


def fingerprint(seen: Experience) -> str:
    """Return a digest of some experience."""
    return hashlib.sha256(b''.join(
        np.ascontiguousarray(each).tobytes() for each in seen)).hexdigest()[:16]
