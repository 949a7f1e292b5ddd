# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The figures of the benchmark, from its results: time against size, on logarithmic axes."""

from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dp_swing_ros.figures.style import (
    colours, FORCE, in_numbers, INK, PALETTE, solver_name, styled)

# what is measured of whom: its name in the results, its colour and its name here
UPDATES = {'mppi': (FORCE, 'MPPI here'),
           'pytorch_mppi compiled': (PALETTE[0], 'pytorch_mppi, our step through torch.compile'),
           'pytorch_mppi closed': (PALETTE[1], 'pytorch_mppi, our step in torch'),
           'pytorch_mppi twin': (INK, 'pytorch_mppi, the step by a linear solve')}


def draw(results: dict[str, Any], folder: Path) -> None:
    """Write the figures of what was measured."""
    if 'growth' in results:
        horizon(results['growth']).savefig(folder / 'benchmark_horizon.png')
    if 'sampling' in results:
        samples(results['sampling']).savefig(folder / 'benchmark_samples.png')


@styled
def horizon(growth: dict[str, Any]) -> Figure:
    """Draw an iteration's time against the horizon."""
    figure = Figure(figsize=(6.4, 4.4), layout='constrained')
    axes = figure.subplots()
    colour = colours(growth['horizon'])
    for name, grown in growth['horizon'].items():
        growth_rate = f'steps$^{{{grown["exponent"]["value"]:.2f}}}$'
        axes.loglog(grown['sizes'], [1e3 * t for t in grown['seconds']], marker='o',
                    markersize=4, color=colour[name],
                    label=f'{solver_name(name)} here: grows as {growth_rate}')
    axes.set(xlabel='horizon [steps]', ylabel='one iteration [ms]')
    axes.set_xticks(grown['sizes'], [str(size) for size in grown['sizes']])
    _finish(axes, "One iteration's time against the horizon")
    return figure


@styled
def samples(sampling: dict[str, Any]) -> Figure:
    """Draw an update's time against the samples, for us and the best of each way of the peers."""
    figure = Figure(figsize=(6.4, 4.4), layout='constrained')
    axes = figure.subplots()
    sizes = [int(size) for size in sampling]
    for name, (colour, label) in UPDATES.items():
        times = [min(t['value'] for kind, t in found['ticks']['seconds'].items()
                     if kind.startswith(name)) for found in sampling.values()]
        axes.loglog(sizes, [1e3 * t for t in times], marker='o', markersize=4, color=colour,
                    label=label)
    axes.set(xlabel='samples', ylabel='one update [ms]')
    axes.set_xticks(sizes, [f'{size:,}' for size in sizes])
    _finish(axes, "One update's time against the samples")
    return figure


def _finish(axes: Axes, heading: str) -> None:
    """Name the picture and its lines, and let times read as numbers."""
    axes.minorticks_off()
    in_numbers(axes.yaxis)
    axes.grid(True)
    axes.legend(loc='lower left', bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)
    axes.figure.suptitle(heading)  # type: ignore
