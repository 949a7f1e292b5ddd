# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Palette and style of all pictures."""

from collections.abc import Callable
import functools
import math
from typing import Any, ParamSpec, TypeVar

import matplotlib
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

from dp_swing_ros.simulation.episode import Episode

# Okabe and Ito's palette: told apart by colour-blind readers, on white and in grey
INK, FAINT, PAPER = '#26323e', '#9aa5b1', '#f4f6f8'
LINK1, LINK2, CART, FORCE, ALARM = '#0072B2', '#D55E00', '#26323e', '#009E73', '#CC79A7'
WARNING = '#b3261e'
COLOURS = (CART, LINK1, LINK2) * 2  # of the six states
SYMBOLS = ('$x$', r'$\theta_1$', r'$\theta_2$',
           r'$\dot x$', r'$\dot\theta_1$', r'$\dot\theta_2$')
SQUARES = ('m²', 'rad²', 'rad²', 'm²/s²', 'rad²/s²', 'rad²/s²')  # units of their squared errors
SOLVERS = {'ilqr': 'iLQR', 'ddp': 'DDP', 'mppi': 'MPPI'}
STYLE: dict[Any, Any] = {
    'axes.axisbelow': True, 'axes.edgecolor': FAINT, 'axes.labelcolor': INK,
    'axes.spines.right': False, 'axes.spines.top': False, 'axes.titlesize': 'medium',
    'figure.dpi': 120, 'figure.labelsize': 'medium', 'figure.titlesize': 'large',
    'font.size': 9.0, 'grid.color': '#e3e7eb', 'grid.linewidth': 0.8, 'legend.frameon': False,
    'lines.linewidth': 1.6, 'text.color': INK, 'xtick.color': INK, 'ytick.color': INK}

P = ParamSpec('P')
R = TypeVar('R')


def styled(draw: Callable[P, R]) -> Callable[P, R]:
    """Draw in the house style without touching the settings of the caller."""
    @functools.wraps(draw)
    def inside(*args: P.args, **kwargs: P.kwargs) -> R:
        with matplotlib.rc_context(STYLE):
            return draw(*args, **kwargs)
    return inside


def title(episode: Episode) -> str:
    """Return the name of who controlled a run."""
    return plain(SOLVERS.get(episode.solver, episode.solver or 'no controller'))


def mark(figure: Figure, text: str) -> None:
    """Write what a reader must know above a picture, in its margin; nothing if it is empty."""
    if text:
        figure.text(0.995, 0.995, plain(text), size=9, weight='bold', color=WARNING, ha='right',
                    va='top', bbox={'color': 'white', 'pad': 1.5}, zorder=10)


def plain(text: str) -> str:
    """Return a text that is none of ours as it is to be shown: its dollars are no formulas."""
    return text.replace('$', r'\$')


def tint(colour: str, strength: float) -> tuple[float, float, float]:
    """Return a colour mixed with white: 0 is white, and nothing shines through."""
    red, green, blue = (1 - strength * (1 - part) for part in to_rgb(colour))
    return red, green, blue


def dark(colour: str) -> tuple[float, float, float]:
    """Return a colour mixed with as much black."""
    red, green, blue = (0.5 * part for part in to_rgb(colour))
    return red, green, blue


def limit_lines(axes: Axes, limit: float, label: str) -> None:
    if math.isfinite(limit):
        axes.axhline(limit, color=FAINT, linestyle='--', linewidth=1, label=label)
        axes.axhline(-limit, color=FAINT, linestyle='--', linewidth=1)


def legend(axes: Axes) -> None:
    axes.legend(loc='lower left', bbox_to_anchor=(0.0, 0.98), ncols=4, borderaxespad=0.0,
                fontsize='small', handlelength=1.4)
