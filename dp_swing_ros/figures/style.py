# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Palette and style of all pictures, and how each solver and contestant looks in them."""

from collections.abc import Iterable, Mapping
from itertools import count
import math
from typing import Any, NamedTuple

import matplotlib
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, NullFormatter
import numpy as np

from dp_swing_ros.pendulum.parameters import acting, acting_unit

# Okabe and Ito's palette: distinct to colour-blind readers, on white and in grey
PALETTE = ('#0072B2', '#D55E00', '#009E73', '#CC79A7', '#E69F00', '#56B4E9', '#7F4F9E')
INK, FAINT, PAPER, WARNING = '#26323e', '#9aa5b1', '#f4f6f8', '#b3261e'
CART, FORCE, ALARM = INK, PALETTE[2], PALETTE[3]
LINKS = (PALETTE[0], PALETTE[1], PALETTE[3])  # link 1 first
DASHES: tuple[Any, ...] = ('-', (0, (4, 1.5)), (0, (1, 1)), (0, (5, 1, 1, 1)))
MARKERS = ('o', 's', '^', 'D')
OWN = dict(zip(('ilqr', 'ddp', 'mppi'), PALETTE)) | {
    'tvlqr': ALARM, 'nothing': FAINT}
OTHERS = PALETTE[4:6]  # of solvers that are not ours, in turn, and then paler
SOLVERS = {'ilqr': 'iLQR', 'ddp': 'DDP', 'mppi': 'MPPI'}  # those that are written otherwise
STYLE: dict[Any, Any] = {
    'axes.axisbelow': True, 'axes.edgecolor': FAINT, 'axes.labelcolor': INK,
    'axes.spines.right': False, 'axes.spines.top': False, 'axes.titlesize': 'medium',
    'figure.dpi': 120, 'figure.labelsize': 'medium', 'figure.titlesize': 'large',
    'font.size': 9.0, 'grid.color': '#e3e7eb', 'grid.linewidth': 0.8, 'legend.frameon': False,
    'lines.linewidth': 1.6, 'text.color': INK, 'xtick.color': INK, 'ytick.color': INK}
# draws in the house style, without touching the settings of the caller
styled = matplotlib.rc_context(STYLE)


class Look(NamedTuple):
    """
    The arguments of a contestant's line, and of its point on an interval.

    The colour stands for the solver, dashes and marker for its variant.
    """

    line: dict[str, Any]
    mark: dict[str, Any]


def looks(campaign: Mapping[str, Any]) -> dict[str, Look]:
    """Return the look of every contestant in a campaign's description."""
    names = [about['name'] for about in campaign['contestants'].values()]
    of_solver, found = colours(names), {}
    for n, (label, name) in enumerate(zip(campaign['contestants'], names)):
        variant, colour = names[:n].count(name), of_solver[name]
        found[label] = Look(
            {'color': colour, 'linestyle': DASHES[variant % len(DASHES)]},
            {'color': colour, 'linewidth': 1.4, 'marker': MARKERS[variant % len(MARKERS)],
             'markeredgewidth': 1.2, 'markerfacecolor': 'white' if variant else colour})
    return found


def colours(names: Iterable[str]) -> dict[str, str]:
    """Return a colour of its own for each solver or baseline, however many there are."""
    others = (to_hex(tint(colour, 0.55 ** turn)) for turn in count() for colour in OTHERS)
    return {name: OWN[name] if name in OWN else next(others) for name in dict.fromkeys(names)}


def formulas(links: int) -> tuple[str, ...]:
    """Return the symbols of the numbers of the state as formulas."""
    angles = [rf'\theta_{i}' for i in range(1, links + 1)]
    return tuple(f'${symbol}$' for symbol in (
        'x', *angles, r'\dot x', *(rf'\dot{angle}' for angle in angles)))


def solver_name(solver: str) -> str:
    """Return the name of who controls as it is to be shown."""
    return plain(SOLVERS.get(solver, solver or 'no controller'))


def mark(figure: Figure, text: str) -> None:
    """Write what a reader must know above a picture, in its margin; nothing if it is empty."""
    if text:
        figure.text(0.995, 0.995, plain(text), size=9, weight='bold', color=WARNING, ha='right',
                    va='top', bbox={'color': 'white', 'pad': 1.5}, zorder=10)


def plain(text: str) -> str:
    """Return a text that is none of ours as it is to be shown: its dollars are no formulas."""
    return text.replace('$', r'\$')


def tint(colour: str, strength: float, ground: str = 'white') -> tuple[float, float, float]:
    """Return a colour mixed with that of the ground: 0 is the ground, nothing shines through."""
    red, green, blue = (below - strength * (below - part)
                        for part, below in zip(to_rgb(colour), to_rgb(ground)))
    return red, green, blue


def widths(lines: int) -> list[float]:
    """Return the widths of curves that may lie on each other: the later is the thinner."""
    return np.linspace(3.0, 1.2, lines).tolist()


def panels_of(figure: Figure | SubFigure, count: int, columns: int, rows: int = 0,
              **shared: Any) -> list[Axes]:
    """Return that many axes on a grid, of as many rows as it takes, other places left empty."""
    rows = max(1, rows, math.ceil(count / columns))
    grid = figure.subplots(rows, columns, squeeze=False, **shared)
    for unused in grid.flat[count:]:
        unused.set_axis_off()
    return list(grid.flat[:count])


def in_numbers(axis: Axis) -> None:
    """Let a logarithmic axis show plain numbers, at powers of ten alone."""
    axis.set_major_formatter(FuncFormatter(lambda value, _: f'{value:g}'))
    axis.set_minor_formatter(NullFormatter())


def in_decades(axes: Axes) -> None:
    """Let the vertical axis be logarithmic, from a power of ten to another."""
    axes.set_yscale('log')
    low, high = np.log10(axes.get_ylim())
    axes.set_ylim(10 ** math.floor(low), 10 ** math.ceil(high))


def limit_lines(axes: Axes, limit: float, label: str = '') -> None:
    if math.isfinite(limit):
        axes.axhline(limit, color=FAINT, linestyle='--', linewidth=1, label=label)
        axes.axhline(-limit, color=FAINT, linestyle='--', linewidth=1)


def unit_of_input(drive: str) -> str:
    """Return the unit of what moves the cart, as it is drawn."""
    return acting_unit(drive).replace('^2', '²')


def input_name(drive: str, symbol: str = '') -> str:
    """Return what moves the cart, as an axis is called."""
    return f'{acting(drive)} {symbol}[{unit_of_input(drive)}]'


def as_share(axes: Axes, along: str) -> None:
    """Let an axis go from 0 to 100 %."""
    axis = axes.xaxis if along == 'x' else axes.yaxis
    axis.set_ticks([0.0, 0.25, 0.5, 0.75, 1.0], ['0', '25', '50', '75', '100 %'])
    axes.set(**{f'{along}lim': (-0.02, 1.02)})


def name_lines(figure: Figure, looks: Mapping[str, Mapping[str, Any]],
               place: str = 'lower center', entry: float = 1.3) -> None:
    """Put a legend of lines beside all axes, each entry so wide [inch]."""
    figure.legend(
        handles=[Line2D([], [], label=plain(label), **look) for label, look in looks.items()],
        loc=f'outside {place}', handlelength=2.4,  # type: ignore
        ncols=max(1, min(len(looks), int(figure.get_size_inches()[0] / entry))))


def legend(axes: Axes) -> None:
    axes.legend(loc='lower left', bbox_to_anchor=(0.0, 0.98), ncols=4, borderaxespad=0.0,
                fontsize='small', handlelength=1.4)
