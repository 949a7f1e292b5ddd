# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Latency, memory and angles of a soak."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure
import numpy as np
from soak import Soak

from dp_swing_ros.figures.style import (
    ALARM, CART, FAINT, in_decades, in_numbers, legend, PALETTE, solver_name, styled)
from dp_swing_ros.learning.trials import OUT
from dp_swing_ros.pendulum.state import Array

BINS = 1000     # of a curve over time; of more states each is drawn by the largest in a bin
MPC, ECHO, SOLVE = PALETTE[0], PALETTE[1], FAINT
PROCESSES = {'plant': CART, 'mpc': MPC, 'echo': ECHO}
GROWTH = 5.0    # [MB] of memory that an axis shows at least
LEAST = 1e-4    # [rad] smaller deviations are drawn here


@styled
def draw(found: Soak) -> Figure:
    """Draw the distribution of the latencies, and latency, deviation and memory over time."""
    figure = Figure(figsize=(10.8, 7.2), layout='constrained')
    (distribution, latency), (memory, deviation) = figure.subplots(2, 2, width_ratios=(1.0, 1.4))
    _draw_distribution(distribution, found)
    _draw_latency(latency, found)
    _draw_memory(memory, found)
    _draw_deviation(deviation, found)
    for axes in (latency, memory, deviation):
        axes.set_xlabel('time [s]')
    for axes in (distribution, latency, memory, deviation):
        axes.grid(True)
        legend(axes)
    figure.suptitle(f'{solver_name(found.solver)}: {len(found.t)} states at '
                    f'{1 / found.period:g} Hz')
    return figure


def _draw_distribution(axes: Axes, found: Soak) -> None:
    """Draw which share of the answers took longer than a time, both logarithmic."""
    for times, colour, name in ((found.latency, MPC, 'state to force'),
                                (found.echo, ECHO, 'echo'),
                                (found.solve_time, SOLVE, 'solve')):
        known = np.sort(times[np.isfinite(times)])
        if len(known):
            longer = 1 - np.arange(len(known)) / len(known)
            axes.step(1e3 * known, longer, where='post', color=colour, label=name)
    axes.axvline(1e3 * found.period, color=FAINT, linestyle='--', linewidth=1, label='period')
    axes.set(xscale='log', yscale='log', xlabel='time [ms]', ylabel='share that took longer')
    in_numbers(axes.xaxis)
    in_numbers(axes.yaxis)


def _draw_latency(axes: Axes, found: Soak) -> None:
    for times, colour, name in ((found.latency, MPC, 'state to force'),
                                (found.echo, ECHO, 'echo')):
        t, largest = binned(found.t, 1e3 * times)
        axes.plot(t, largest, '.', color=colour, markersize=3, label=name)
    late = found.late
    if late.any():
        axes.plot(*binned(found.t[late], 1e3 * found.latency[late]), '.', color=ALARM,
                  markersize=5,
                  label=f'late ({late.sum()}, {found.late_by_itself.sum()} by itself)')
    axes.axhline(1e3 * found.period, color=FAINT, linestyle='--', linewidth=1, label='period')
    if len(found.t):
        in_decades(axes)
    in_numbers(axes.yaxis)
    axes.set_ylabel('time [ms]')


def _draw_deviation(axes: Axes, found: Soak) -> None:
    t, largest = binned(found.t, found.deviation)
    axes.plot(t, np.maximum(largest, LEAST), color=CART, linewidth=1.0, label='largest |angle|')
    axes.axhline(OUT, color=FAINT, linestyle='--', linewidth=1, label=f'{OUT:g} rad')
    axes.set_yscale('log')
    in_numbers(axes.yaxis)
    axes.set_ylabel('angle [rad]')


def _draw_memory(axes: Axes, found: Soak) -> None:
    for name, usage in found.usage.items():
        if name in PROCESSES:
            t, resident = binned(usage.t, usage.resident / 1e6)
            begin = resident[0] if len(resident) else 0.0
            axes.plot(t, resident - begin, color=PROCESSES[name],
                      label=f'{name} ({begin:.0f} MB)')
    low, high = axes.get_ylim()
    axes.set(ylim=(min(low, -GROWTH), max(high, GROWTH)), ylabel='growth of resident memory [MB]')


def binned(t: Array, values: Array) -> tuple[Array, Array]:
    """
    Return times and values, of more than BINS the largest of each bin, at its end.

    Shapes: t and values (N,) -> both (N,) or (BINS,).
    """
    if len(t) <= BINS:
        return t, values
    begins = np.linspace(0, len(t), BINS, endpoint=False).astype(int)
    known = np.where(np.isfinite(values), values, -np.inf)
    largest = np.maximum.reduceat(known, begins)
    return t[begins], np.where(np.isfinite(largest), largest, np.nan)
