# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The hands of the pages on the pendulum: springs and pushes, as forces on the cart."""

from collections.abc import Hashable, Sequence
from typing import NamedTuple

import numpy as np

from dp_swing_ros.pendulum.geometry import joint_positions
from dp_swing_ros.pendulum.state import Array
from dp_swing_ros.pendulum.units import SAME, Units

LASTS = 0.3   # [s] a hand that does not renew its pull has let go
AHEAD = 0.2   # [s] scaled; a pull is felt some two periods later, and what is more damps it


class Pull(NamedTuple):
    """
    A spring from a place on a body to a point [m], of which the cart feels what is level.

    The place is where it will be in a moment: else what comes late would swing it up.
    """

    body: int      # 0: the cart, k: link k
    along: float   # of the link, from its joint (0) to its end (1)
    to: tuple[float, float]


class Hold(NamedTuple):
    """A force [N] that stays the same."""

    force: float


class Pulls:
    """What each hand does, until it lets go."""

    def __init__(self) -> None:
        """Begin with none."""
        self._hands: dict[Hashable, tuple[Pull | Hold, float]] = {}

    def take(self, hand: Hashable, pull: Pull | Hold, now: float) -> None:
        """Let a hand pull from now [s] on, in place of what it did."""
        self._hands[hand] = pull, now + LASTS

    def release(self, hand: Hashable) -> None:
        """Let go."""
        self._hands.pop(hand, None)

    def force(self, now: float, x: Array, lengths: Sequence[float], stiffness: float,
              limit: float, kick: float = 0.0, scale: Units = SAME) -> float:
        """
        Return the sum of all and a kick [N], each and all within a limit, in a state x (2n + 2,).

        The links are of such lengths [m], the pendulum so many times larger than the default one.
        """
        self._hands = {hand: (pull, until) for hand, (pull, until) in self._hands.items()
                       if now < until}
        q, v = np.hsplit(x, 2)
        ahead = scale.sized(AHEAD, 's')
        places = joint_positions(np.concatenate((q + ahead * np.nan_to_num(v), v)), lengths)
        forces = [kick, *(force_of(pull, places, stiffness) for pull, _ in self._hands.values())]
        return bounded(sum(bounded(each, limit) for each in forces), limit)


def bounded(force: float, limit: float) -> float:
    """Return a force [N] within a limit, either way."""
    return min(max(force, -limit), limit)


def force_of(pull: Pull | Hold, places: Array, stiffness: float) -> float:
    """Return the force [N] of one, where the joints are at places (n + 1, 2) [m]."""
    if isinstance(pull, Hold):
        return pull.force
    end = min(pull.body, len(places) - 1)
    begin = max(end - 1, 0)
    place = places[begin, 0] + pull.along * (places[end, 0] - places[begin, 0])
    return stiffness * float(pull.to[0] - place)
