# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How the contestants of a campaign look in all of its pictures."""

from collections.abc import Iterable
from itertools import count
from typing import Any, NamedTuple

from matplotlib.colors import to_hex

from dp_swing_ros.figures.style import ALARM, DASHES, FAINT, PALETTE, tint

OWN = dict(zip(('ilqr', 'ddp', 'mppi'), PALETTE)) | {'tvlqr': ALARM, 'nothing': FAINT}
OTHERS = PALETTE[4:]  # of solvers that are not ours, in turn, and then paler
MARKERS = ('o', 's', '^', 'D')


class Look(NamedTuple):
    """The colour stands for the solver, line and marker for its variant."""

    colour: str
    dash: Any
    marker: str
    filled: bool

    def line(self) -> dict[str, Any]:
        """Return the arguments of a line."""
        return {'color': self.colour, 'linestyle': self.dash}

    def mark(self) -> dict[str, Any]:
        """Return the arguments of a point on its interval."""
        return {'color': self.colour, 'linewidth': 1.4, 'marker': self.marker,
                'markeredgewidth': 1.2,
                'markerfacecolor': self.colour if self.filled else 'white'}


def colours(names: Iterable[str]) -> dict[str, str]:
    """Return a colour of its own for each solver or baseline, however many there are."""
    others = (to_hex(tint(colour, 0.55 ** turn)) for turn in count() for colour in OTHERS)
    return {name: OWN[name] if name in OWN else next(others) for name in dict.fromkeys(names)}


def looks(campaign: dict[str, Any]) -> dict[str, Look]:
    """Return the look of every contestant in a campaign's description."""
    names = [about['name'] for about in campaign['contestants'].values()]
    colour, found = colours(names), dict[str, Look]()
    for n, (label, name) in enumerate(zip(campaign['contestants'], names)):
        variant = names[:n].count(name)
        found[label] = Look(colour[name], DASHES[variant % len(DASHES)],
                            MARKERS[variant % len(MARKERS)], variant == 0)
    return found
