# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The figures of the benchmark, from its results; times are on logarithmic axes."""

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from peers_gradient import OURS

from dp_swing_ros.figures.style import (
    as_share, FORCE, in_numbers, INK, PALETTE, PAPER, solver_name, styled)

# what is measured of whom: its name in the results, its colour and its name here
UPDATES = {'mppi': (FORCE, 'MPPI here'),
           'pytorch_mppi compiled': (PALETTE[0], 'pytorch_mppi, our step through torch.compile'),
           'pytorch_mppi closed': (PALETTE[1], 'pytorch_mppi, our step in torch')}


class Look(NamedTuple):
    """How one of two kinds is drawn, and where beside its row."""

    colour: str
    fill: str
    above: float


LOOKS = Look(PALETTE[1], PAPER, -0.14), Look(INK, INK, 0.14)


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
def solves(kinds: Mapping[str, Mapping[str, Any]]) -> Figure:
    """Draw from how many starts each gets to the least cost, and how much longer it takes."""
    names = list(next(iter(kinds.values())))
    figure, there, times = _side_by_side(names)
    for (kind, of), look in zip(kinds.items(), LOOKS):
        _shares(there, {place: of[name]['reached'] for place, name in enumerate(names)},
                kind, look)
        _intervals(times, {place: of[name]['ratios'][OURS[0]] for place, name in enumerate(names)
                           if OURS[0] in of[name]['ratios']}, kind, look)
    there.set(xlabel='gets to the least cost')
    times.set(xscale='log', xlabel=f'times as long as {solver_name(OURS[0])}')
    _finish(figure, there, times)
    return figure


@styled
def loops(found: Mapping[tuple[str, str], Any], kinds: Iterable[str]) -> Figure:
    """
    Draw what each solver holds, with 95 % intervals, and the p99 of its ticks, of each kind.

    found are the Loops of closed_loops.py, by solver and kind.
    """
    names = list(dict.fromkeys(name for name, _ in found))
    figure, held, ticks = _side_by_side(names)
    for kind, look in zip(kinds, LOOKS):
        of = {place: found[name, kind] for place, name in enumerate(names)
              if (name, kind) in found}
        _shares(held, {place: one.held._asdict() for place, one in of.items()}, kind, look)
        _intervals(ticks, {place: dict.fromkeys(('value', 'low', 'high'), one.p99)
                           for place, one in of.items()}, kind, look)
    held.set(xlabel='held')
    ticks.set(xscale='log', xlabel='p99 of a tick [ms]')
    _finish(figure, held, ticks)
    return figure


def _side_by_side(names: list[str]) -> tuple[Figure, Axes, Axes]:
    """Return a figure with a row for each solver, and its left and right half."""
    figure = Figure(figsize=(8.0, 0.5 * len(names) + 1.2), layout='constrained')
    left, right = figure.subplots(1, 2, sharey=True)
    left.set_yticks(range(len(names)), [solver_name(name) for name in names])
    left.invert_yaxis()
    return figure, left, right


def _shares(axes: Axes, rates: Mapping[int, Mapping[str, float]], kind: str, look: Look) -> None:
    """Draw shares of runs by the rows of solvers."""
    _intervals(axes, {place: {'value': of['successes'] / of['runs'], 'low': of['low'],
                              'high': of['high']} for place, of in rates.items()}, kind, look)


def _intervals(axes: Axes, of: Mapping[int, Mapping[str, float]], kind: str, look: Look) -> None:
    """Draw values with their intervals by the rows of solvers."""
    values = [one['value'] for one in of.values()]
    axes.errorbar(
        values, [place + look.above for place in of], fmt='o', color=look.colour,
        markerfacecolor=look.fill, label=kind, xerr=[
            [value - one['low'] for value, one in zip(values, of.values())],
            [one['high'] - value for value, one in zip(values, of.values())]])


def _finish(figure: Figure, shares: Axes, times: Axes) -> None:
    """Give both halves their numbers, and the figure its legend."""
    as_share(shares, 'x')
    times.minorticks_off()
    in_numbers(times.xaxis)
    for axes in (shares, times):
        axes.grid(True, axis='x')
    figure.legend(*shares.get_legend_handles_labels(), loc='outside lower center', ncols=2)


# of a family of results of benchmark.py
DRAWN: dict[str, Callable[[Any], Figure]] = {
    'growth': growth, 'solves': solves, 'sampling': samples}
