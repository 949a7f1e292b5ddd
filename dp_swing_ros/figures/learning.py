# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""How a learner came to hold the pendulum: experience against what became of it."""

from collections.abc import Sequence

from matplotlib.figure import Figure
import numpy as np

from dp_swing_ros.evaluation.soak import OUT
from dp_swing_ros.figures.style import FAINT, legend, PALETTE, PAPER, styled
from dp_swing_ros.learning.trials import Trial


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
    figure.suptitle('From limits alone: what becomes of the experience')
    axes.grid(True)
    legend(axes)
    return figure
