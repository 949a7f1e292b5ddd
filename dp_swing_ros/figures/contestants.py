# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How the contestants of a campaign look in all of its pictures."""

from collections.abc import Iterable
from itertools import cycle
from typing import Any, NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from dp_swing_ros.figures.style import ALARM, FAINT, FORCE, LINK1, LINK2, plain

OWN = {'ilqr': LINK1, 'ddp': LINK2, 'mppi': FORCE, 'tvlqr': ALARM, 'nothing': FAINT}
OTHERS = ('#E69F00', '#56B4E9', '#7F4F9E')  # of solvers that are not ours, in turn
DASHES = ('-', (0, (4, 1.5)), (0, (1, 1)), (0, (5, 1, 1, 1)))  # of a first, second ... variant
ENTRY, WORDY = 1.3, 2.1  # [inch] of a legend
MARKERS = ('o', 's', '^', 'D')


class Look(NamedTuple):
    """The colour says which solver, line and marker which of its variants."""

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
    """Return a colour for each solver or baseline; those that are not ours take turns."""
    others = cycle(OTHERS)
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
    entry = ENTRY if words is None else WORDY
    figure.legend(
        handles=[Line2D([], [], label=plain((words or {}).get(label, label)),
                        **(look.mark() if points else look.line()))
                 for label, look in shown.items()],
        loc='outside lower center', handlelength=2.6,
        ncols=max(1, min(len(shown), int(figure.get_size_inches()[0] / entry))))


def as_share(axes: Axes, along: str) -> None:
    """Let an axis go from 0 to 100 %."""
    axis = axes.xaxis if along == 'x' else axes.yaxis
    axis.set_ticks([0.0, 0.25, 0.5, 0.75, 1.0], ['0', '25', '50', '75', '100 %'])
    axes.set(**{f'{along}lim': (-0.02, 1.02)})
