# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The figure of the benchmark, from its results: time against samples, on logarithmic axes."""

from typing import Any

from matplotlib.figure import Figure

from dp_swing_ros.figures.style import FORCE, in_numbers, PALETTE, styled

# what is measured of whom: its name in the results, its colour and its name here
UPDATES = {'mppi': (FORCE, 'MPPI here'),
           'pytorch_mppi compiled': (PALETTE[0], 'pytorch_mppi, our step through torch.compile'),
           'pytorch_mppi closed': (PALETTE[1], 'pytorch_mppi, our step in torch')}


@styled
def samples(sampling: dict[str, Any]) -> Figure:
    """Draw an update's time against the samples, for us and the best of each way of the peers."""
    figure = Figure(figsize=(6.4, 4.4), layout='constrained')
    axes = figure.subplots()
    sizes = [int(size) for size in sampling]
    for name, (colour, label) in UPDATES.items():
        times = [min(t['value'] for kind, t in found['seconds'].items()
                     if kind.startswith(name)) for found in sampling.values()]
        axes.loglog(sizes, [1e3 * t for t in times], marker='o', markersize=4, color=colour,
                    label=label)
    axes.set(xlabel='samples', ylabel='one update [ms]')
    axes.set_xticks(sizes, [f'{size:,}' for size in sizes])
    axes.minorticks_off()
    in_numbers(axes.yaxis)
    axes.grid(True)
    axes.legend(loc='lower left', bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)
    figure.suptitle("One update's time against the samples")
    return figure
