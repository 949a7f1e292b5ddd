# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The figures of the benchmark, from its results; times are on logarithmic axes."""

from collections.abc import Iterable, Mapping
from typing import Any

from matplotlib.figure import Figure
from peers_gradient import OURS

from dp_swing_ros.figures.style import (
    as_share, FORCE, in_numbers, INK, PALETTE, PAPER, solver_name, styled)

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


@styled
def growth(races: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Draw an iteration's time over horizon and links, for us and the peers."""
    figure = Figure(figsize=(8.0, 4.4), layout='constrained')
    panels = figure.subplots(1, 2, sharey=True)
    for axes, (by, of) in zip(panels, races.items()):
        counts = [int(count) for count in of]
        for name in next(iter(of.values()))['seconds']:
            axes.plot(counts, [1e3 * race['seconds'][name]['value'] for race in of.values()],
                      marker='o', markersize=4, label=solver_name(name),
                      linewidth=2.0 if name in OURS else 1.0)
        axes.set(xscale='log' if by == 'horizon' else 'linear', yscale='log',
                 xlabel={'horizon': 'horizon [steps]'}.get(by, by))
        axes.set_xticks(counts, [f'{count:,}' for count in counts])
        axes.minorticks_off()
        in_numbers(axes.yaxis)
        axes.grid(True)
    panels[0].set_ylabel('one iteration [ms]')
    figure.legend(*panels[0].get_legend_handles_labels(), loc='outside lower center', ncols=3)
    figure.suptitle("One iteration's time over horizon and links, near the goal")
    return figure


@styled
def loops(found: Mapping[tuple[str, str], Any], kinds: Iterable[str]) -> Figure:
    """
    Draw what each solver holds, with 95 % intervals, and the p99 of its ticks, of each kind.

    found are the Loops of closed_loops.py, by solver and kind.
    """
    names = list(dict.fromkeys(name for name, _ in found))
    figure = Figure(figsize=(8.0, 0.5 * len(names) + 1.2), layout='constrained')
    held, ticks = figure.subplots(1, 2, sharey=True)
    for kind, colour, fill, above in zip(kinds, (PALETTE[1], INK), (PAPER, INK), (-0.14, 0.14)):
        places, of = zip(*((place + above, found[name, kind])
                           for place, name in enumerate(names) if (name, kind) in found))
        shares = [one.held.successes / one.held.runs for one in of]
        held.errorbar(shares, places, xerr=[[share - one.held.low for share, one in zip(
            shares, of)], [one.held.high - share for share, one in zip(shares, of)]], fmt='o',
            color=colour, markerfacecolor=fill, label=kind)
        ticks.plot([one.p99 for one in of], places, 'o', color=colour, markerfacecolor=fill)
    held.set_yticks(range(len(names)), [solver_name(name) for name in names])
    held.invert_yaxis()
    held.set(xlabel='held')
    as_share(held, 'x')
    ticks.set(xscale='log', xlabel='p99 of a tick [ms]')
    ticks.minorticks_off()
    in_numbers(ticks.xaxis)
    for axes in (held, ticks):
        axes.grid(True, axis='x')
    figure.legend(loc='outside lower center', ncols=2)
    return figure
