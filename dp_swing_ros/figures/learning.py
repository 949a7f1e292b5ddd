# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Of learned dynamics: how a learner came to hold the pendulum, and how good a model is."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
import numpy as np

from dp_swing_ros.dynamics.files import LearnedModel
from dp_swing_ros.evaluation.soak import OUT
from dp_swing_ros.figures.style import (
    FAINT, formulas, in_numbers, INK, legend, PALETTE, PAPER, styled)
from dp_swing_ros.learning.experience import Experience
from dp_swing_ros.learning.quality import AHEAD, disagreement, Errors
from dp_swing_ros.learning.trials import Trial
from dp_swing_ros.pendulum.state import Array, hanging, to_turn_of

TRUSTED = 0.1        # of the slopes, by which the members of a model may differ
GRID = 41            # points along a map of that
BEYOND = 1.5         # times the largest speed of the experience, to where a map goes
SHOWN = 2000         # states of the experience in a map


@styled
def learning(trials: Sequence[Trial], first: float) -> Figure:
    """Draw the largest error of an angle over the experience; forces are random at first [s]."""
    figure = Figure(figsize=(9.6, 3.4), layout='constrained')
    axes = figure.subplots()
    axes.axvspan(0, first, color=PAPER, label='random forces')
    axes.axhline(OUT, color=FAINT, linewidth=1.0, label=f'held: below {OUT:g} rad')
    for n, trial in enumerate(trials):
        axes.plot(trial.experience, np.maximum(trial.deviation, 1e-3),
                  color=PALETTE[n % len(PALETTE)],
                  label=f'trial {trial.number}' if len(trials) > 1 else 'as it goes on')
    axes.set(yscale='log', xlabel='experience [s]', ylabel='largest error of an angle [rad]',
             xlim=(0, trials[-1].experience[-1]))
    figure.suptitle('From random forces on: what becomes of the experience')
    axes.grid(True)
    legend(axes)
    return figure


@styled
def training(model: LearnedModel, course: Sequence[tuple[float, float]], own: Errors,
             analytic: Errors, seen: Experience) -> Figure:
    """
    Draw how training went, what predictions miss, and where the slopes can be trusted.

    course are the errors of speeds, of what was learned from and of what was held out, a round
    each; own and analytic those of the model and of the equations on what was held out.
    """
    figure = Figure(figsize=(10.2, 7.4), layout='constrained')
    (rounds, errors), maps = figure.subplots(2, 2)
    for values, colour, name in zip(zip(*course), PALETTE, ('learned from', 'held out')):
        rounds.plot(range(1, len(values) + 1), values, color=colour, label=name)
    rounds.set(yscale='log', xlabel='round', ylabel='error of speeds, RMS [m/s, rad/s]')
    for found, colour, name in zip((own, analytic), (PALETTE[0], FAINT), ('learned', 'equations')):
        off = np.sort(found.ahead)
        errors.plot(np.maximum(off, 1e-4), np.arange(1, len(off) + 1) / max(len(off), 1),
                    color=colour, label=name)
    errors.set(xscale='log', ylim=(0, 1), ylabel='share of the predictions',
               xlabel=f'error of an angle {AHEAD} steps ahead, held out [rad]')
    for axes in (rounds, errors):
        axes.grid(True)
        legend(axes)
    for axis in (rounds.yaxis, errors.xaxis):
        in_numbers(axis)
    n = model.dynamics.links
    largest = BEYOND * model.largest
    planes = (('at rest', range(1, n + 1), [np.pi] * n),
              ('hanging', range(n + 2, 2 * n + 2), largest[:n]))
    for axes, (title, where, limits) in zip(maps, planes):
        axes.set_title(f'{title}; along the line members differ by {100 * TRUSTED:g} %')
        shown = _map(axes, model, seen, [*where][:2], np.array(limits)[:2])
    figure.colorbar(shown, ax=maps, label='slopes of a step: members differ by', shrink=0.9)
    figure.suptitle(f'A {model.kind.replace("_", " ")} model of {seen.duration:.0f} s of motion')
    return figure


def _map(axes: Axes, model: LearnedModel, seen: Experience, where: list[int],
         limits: Array) -> AxesImage:
    """Draw how far the members differ along one or two numbers of a state that hangs at rest."""
    n = model.dynamics.links
    centre, names = hanging(n), formulas(n)
    along = [np.linspace(centre[i] - limit, centre[i] + limit, GRID)
             for i, limit in zip(where, limits)]
    grids = np.meshgrid(*along) if len(where) > 1 else [np.tile(along[0], (2, 1))]
    X = np.tile(centre, (grids[0].size, 1))
    X[:, where] = np.column_stack([grid.ravel() for grid in grids])
    off = disagreement(model, X, np.zeros(len(X))).reshape(grids[0].shape)
    low, high = (along[1][0], along[1][-1]) if len(where) > 1 else (0.0, 1.0)
    shown = axes.imshow(off, origin='lower', aspect='auto', cmap='cividis_r',
                        norm=LogNorm(1e-3, 1.0, clip=True),
                        extent=(along[0][0], along[0][-1], low, high))
    if len(where) > 1:
        axes.contour(*along, off, [TRUSTED], colors=INK, linewidths=1.2)
        points = to_turn_of(seen.X[::max(len(seen.X) // SHOWN, 1)], centre)
        axes.plot(*points[:, where].T, '.', color='white', markersize=1.2, alpha=0.6)
        axes.set(ylabel=names[where[1]], ylim=(low, high))
    axes.set(xlabel=names[where[0]], xlim=(along[0][0], along[0][-1]))
    return shown
