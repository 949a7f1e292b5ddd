# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How the contestants of a campaign look in all of its pictures."""

from collections.abc import Iterable
from itertools import count
from typing import Any, NamedTuple

from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from dp_swing_ros.figures.style import ALARM, DASHES, FAINT, name_lines, PALETTE, tint

OWN = dict(zip(('ilqr', 'ddp', 'mppi'), PALETTE)) | {'tvlqr': ALARM, 'nothing': FAINT}
OTHERS = PALETTE[4:]  # of solvers that are not ours, in turn, and then paler
ENTRY, WORDY = 1.3, 2.1  # [inch] of a legend
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
        return {**self.point(), 'linestyle': '-', 'linewidth': 1.4}

    def point(self) -> dict[str, Any]:
        """Return the arguments of a point."""
        return {'color': self.colour, 'marker': self.marker, 'markeredgewidth': 1.2,
                'markerfacecolor': self.colour if self.filled else 'white'}


def colours(names: Iterable[str]) -> dict[str, str]:
    """Return a colour of its own for each solver or baseline, however many there are."""
    others = (to_hex(tint(colour, 0.55 ** turn)) for turn in count() for colour in OTHERS)
    return {name: OWN[name] if name in OWN else next(others) for name in dict.fromkeys(names)}


def looks(campaign: dict[str, Any]) -> dict[str, Look]:
    """Return the look of every contestant in a campaign's description."""
    seen: dict[str, int] = {}
    found = {}
    colour = colours(about['name'] for about in campaign['contestants'].values())
    for label, about in campaign['contestants'].items():
        variant = seen.setdefault(about['name'], 0)
        seen[about['name']] += 1
        found[label] = Look(colour[about['name']], DASHES[variant % len(DASHES)],
                            MARKERS[variant % len(MARKERS)], variant == 0)
    return found


def name_contestants(figure: Figure, shown: dict[str, Look], points: bool = False,
                     words: dict[str, str] | None = None) -> None:
    """Put a legend of the contestants below a picture, by their labels or some words for each."""
    name_lines(figure, {(words or {}).get(label, label): look.mark() if points else look.line()
                        for label, look in shown.items()},
               'lower center', ENTRY if words is None else WORDY)


def as_share(axes: Axes, along: str) -> None:
    """Let an axis go from 0 to 100 %."""
    axis = axes.xaxis if along == 'x' else axes.yaxis
    axis.set_ticks([0.0, 0.25, 0.5, 0.75, 1.0], ['0', '25', '50', '75', '100 %'])
    axes.set(**{f'{along}lim': (-0.02, 1.02)})
