# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The paper's figures over many runs: one run whole, and what lies between all of them.

Both take ensembles by the name of their set-up, which share one axis of time.
"""

from collections.abc import Mapping
import math

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator, NullLocator
import numpy as np
from paper_ensemble import Band, Ensemble

from dp_swing_ros.evaluation.metrics import settling_time
from dp_swing_ros.figures.curves import ERROR_FLOOR, name_errors
from dp_swing_ros.figures.film import snapshot
from dp_swing_ros.figures.pendulum import room_for, times_of
from dp_swing_ros.figures.style import ALARM, FAINT, FORCE, INK, panels_of, styled, tint
from dp_swing_ros.pendulum.state import angles, Array, links_of, to_turn_of, upright
from dp_swing_ros.simulation.episode import Episode

SHADES = (FORCE, ALARM)  # of the set-ups
ROWS, COLUMNS = 3, 4     # of the pictures of a run
STEPS = (0.1, 0.2, 0.25, 0.5, 1.0)  # [s] between two of them
CEILING = 1e6            # squared errors above are not looked for


@styled
def swing_ups(ensembles: Mapping[str, Ensemble], heading: str) -> Figure:
    """Draw each set-up's run at some moments, and below, how far from upright all its runs are."""
    half_width = max(room_for(one.shown) for one in ensembles.values())
    reach = max(1.1 * sum(one.shown.physical.lengths) for one in ensembles.values())
    picture = 5.0 / COLUMNS * reach / half_width + 0.2  # [inch] high
    figure = Figure(figsize=(10.4, 3.0 + ROWS * picture),
                    layout=ConstrainedLayoutEngine(w_pad=0.03, h_pad=0.03))
    halves = figure.subfigures(1, len(ensembles), squeeze=False, wspace=0.04)
    for half, colour, (name, one) in zip(halves.flat, SHADES, ensembles.items()):
        half.suptitle(f'{name}\n{_count(one)}', size='medium', color=colour, weight='bold')
        film, below = half.subfigures(2, 1, squeeze=False,
                                      height_ratios=(ROWS * picture, 1.9)).flat
        _draw_film(film, one, half_width)
        _draw_angle(below.subplots(), one, colour)
    figure.suptitle(f'{heading}: the way up and the end (bold: upright), and the angles of all '
                    'runs')
    return figure


def _count(one: Ensemble) -> str:
    held = one.held
    strongest = max(trial.metrics.largest_force for trial in one.trials)
    return (f'{held.successes} of {held.runs} upright to the end '
            f'({100 * held.low:.0f}-{100 * held.high:.0f} %), force up to {strongest:.0f} N')


def moments(episode: Episode) -> Array:
    """
    Return the times (M,) [s] that show most of a run: evenly until it has settled, and the last.

    As close to each other as the pictures allow.
    """
    t, pictures = np.asarray(episode.t, dtype=float), ROWS * COLUMNS
    settled = settling_time(t, episode.errors)
    until = float(t[-1] if math.isnan(settled) else settled) - t[0]
    period = next((step for step in STEPS if until <= (pictures - 2) * step + 1e-9),
                  until / (pictures - 2))
    found = times_of(episode, period, period * math.ceil(until / period - 1e-9))
    return found if found[-1] > t[-1] - 1e-9 else np.append(found, t[-1])


def _draw_film(film: SubFigure, one: Ensemble, half_width: float) -> None:
    times = moments(one.shown)
    panels = panels_of(film, len(times), COLUMNS, ROWS, sharex=True, sharey=True)
    for axes, t in zip(panels, times):
        snapshot(axes, one.shown, t, half_width)
        axes.tick_params(labelleft=False, labelbottom=False)
    _draw_scale(panels[0], half_width)


def _draw_scale(axes: Axes, half_width: float) -> None:
    """Draw a metre."""
    bottom, _ = axes.get_ylim()
    left, height = -0.95 * half_width, 0.93 * bottom
    axes.plot([left, left + 1.0], [height, height], color=INK, linewidth=2, zorder=6)
    axes.text(left + 0.5, height, '1 m', size='small', ha='center', va='bottom', zorder=6)


def _draw_angle(axes: Axes, one: Ensemble, colour: str) -> None:
    """Draw the largest angle of all runs, and of the one that is shown above."""
    t, errors = one.shown.t, np.abs(_errors(one.shown))
    _draw_band(axes, t, one.angle, colour)
    axes.plot(t, errors[:, angles(errors)].max(axis=1), color=tint(colour, 0.5, 'black'),
              linewidth=0.9)
    axes.axhline(0.1, color=FAINT, linestyle='--', linewidth=1)
    axes.set(ylim=(0, 1.04 * np.pi), xlim=(t[0], t[-1]), xlabel='time [s]',
             ylabel='largest angle [rad]')
    axes.set_yticks([0.0, np.pi / 2, np.pi], ['0', 'π/2', 'π'])
    axes.grid(True)
    axes.legend(handles=_handles(one, colour), fontsize='small', loc='lower left', ncols=3,
                bbox_to_anchor=(0.0, 0.98), borderaxespad=0.0)


def _errors(episode: Episode) -> Array:
    """Return the distances (N, 2n + 2) of the states from upright."""
    return to_turn_of(episode.X, upright(links_of(episode.X)))


def _draw_band(axes: Axes, t: Array, band: Band, colour: str, floor: float = -np.inf) -> None:
    low, median, high = (np.clip(part, floor, CEILING) for part in band)
    axes.fill_between(t, low, high, color=tint(colour, 0.28), linewidth=0)
    axes.plot(t, median, color=colour, linewidth=2.2)


def _handles(one: Ensemble, colour: str) -> list[Artist]:
    return [Line2D([], [], color=tint(colour, 0.5, 'black'), linewidth=0.9, label='the run shown'),
            Line2D([], [], color=colour, linewidth=2.2, label=f'median of {one.held.runs}'),
            Patch(color=tint(colour, 0.28), linewidth=0, label='10-90 %')]


@styled
def squared_errors(ensembles: Mapping[str, Ensemble], heading: str) -> Figure:
    """Draw the squared distance of the states from upright, set-up beside set-up."""
    links = max(one.shown.physical.links for one in ensembles.values())
    figure = Figure(figsize=(10.4 / 3 * (links + 1), 5.8), layout='constrained')
    panels = figure.subplots(2, links + 1, sharex=True)
    for i, axes in enumerate(panels.flat):
        for colour, one in zip(SHADES, ensembles.values()):
            _draw_error(axes, one, i, colour)
    name_errors(panels)
    for axes in panels.flat:
        axes.set_xlim(0.0, one.shown.t[-1])
        axes.yaxis.set_major_locator(LogLocator(numticks=8))
        axes.yaxis.set_minor_locator(NullLocator())
    for place, colour, (name, one) in zip(('left', 'right'), SHADES, ensembles.items()):
        legend = figure.legend(
            handles=_handles(one, colour), loc=f'outside lower {place}', ncols=3,  # type: ignore
            title=f'{name}\n{_count(one)}', title_fontproperties={'weight': 'bold'})
        legend.get_title().set(color=colour, ha='center')
    figure.suptitle(f'{heading}: squared errors of the states (dashed: what counts as upright)')
    return figure


def _draw_error(axes: Axes, one: Ensemble, i: int, colour: str) -> None:
    t = one.shown.t
    _draw_band(axes, t, Band(*(part[:, i] for part in one.error)), colour, ERROR_FLOOR)
    shown = _errors(one.shown)[:, i] ** 2
    axes.plot(t, np.maximum(shown, ERROR_FLOOR), color=tint(colour, 0.5, 'black'), linewidth=0.9)
