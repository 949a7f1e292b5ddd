# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What predictions miss, before and after an identification."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.figure import Figure
import numpy as np

from dp_swing_ros.figures.style import CART, FAINT, formulas, legend, LINKS, styled
from dp_swing_ros.pendulum.state import Array

if TYPE_CHECKING:   # it loads half of scipy, which every picture would wait for
    from dp_swing_ros.identification.identify import Identified

GAP = 1.0          # [s] between motions
HEIGHT = 2.0       # [inch] of a panel


@styled
def identification(found: Identified) -> Figure:
    """Draw the errors of predictions over all motions, one after the other, in mm and mrad."""
    links = found.predictions[0].before.shape[-1] - 1
    figure = Figure(figsize=(9.6, 0.8 + HEIGHT * len(found.joints)), layout='constrained')
    panels = figure.subplots(len(found.joints), 1, sharex=True, squeeze=False)[:, 0]
    before, after = (1e3 * found.rms(of) for of in ('before', 'after'))
    for axes, i in zip(panels, found.joints):
        symbol, colour, unit = (formulas(links)[i], (CART, *LINKS)[i], 'mrad' if i else 'mm')
        t, errors = along_time(found, i)
        axes.plot(t, errors[0], color=FAINT, linewidth=1.0,
                  label=f'before, RMS {before[i]:.3g} {unit}')
        axes.plot(t, errors[1], color=colour, linewidth=1.2,
                  label=f'after, RMS {after[i]:.3g} {unit}')
        axes.set_ylabel(f'error of {symbol} [{unit}]')
        axes.grid(True)
        legend(axes)
    panels[-1].set_xlabel('time [s]')
    figure.suptitle('What predictions miss within a segment, before and after the identification')
    return figure


def along_time(found: Identified, i: int) -> tuple[Array, Array]:
    """Return times [s] and errors before and after (2, …) of one position, NaN between lines."""
    start, times, errors = 0.0, list[Array](), list[Array]()
    for each in found.predictions:
        t = start + each.segments.t
        start = float(t.max(initial=start)) + GAP
        errors_of_both = np.stack([each.before, each.after]) - each.segments.Q
        times.append(with_breaks(t[None])[0])
        errors.append(with_breaks(1e3 * errors_of_both[..., i]))
    return np.concatenate(times), np.concatenate(errors, axis=1)


def with_breaks(segments: Array) -> Array:
    """Return segments (2, S, K) as lines (2, S (K + 1)), each with NaN at its end."""
    lines: Array = np.concatenate(
        (segments, np.full((*segments.shape[:2], 1), np.nan)), axis=2).reshape(len(segments), -1)
    return lines
