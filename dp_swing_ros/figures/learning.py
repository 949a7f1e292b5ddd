# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Of learned dynamics: how a learner came to hold the pendulum, and how good a model is."""

from collections.abc import Sequence

from matplotlib.figure import Figure
import numpy as np

from dp_swing_ros.figures.style import FAINT, in_numbers, legend, PALETTE, PAPER, styled
from dp_swing_ros.learning.quality import AHEAD, Errors
from dp_swing_ros.learning.trials import OUT, Trial


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
def training(curve: Sequence[tuple[float, float]], own: Errors, analytic: Errors,
             duration: float) -> Figure:
    """
    Draw how a model of so much motion [s] was found, and what its predictions miss.

    curve are the errors of speeds, of what was learned from and of what was held out, a round
    each; own and analytic those of the model and of the equations on what was held out.
    """
    figure = Figure(figsize=(10.2, 3.9), layout='constrained')
    rounds, errors = figure.subplots(1, 2)
    for values, colour, name in zip(zip(*curve), PALETTE, ('learned from', 'held out')):
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
    figure.suptitle(f'A model of {duration:.0f} s of motion')
    return figure
