# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What came of each random start, over the angles that it started with."""

from collections.abc import Sequence
import math

from matplotlib.figure import Figure
from matplotlib.ticker import MultipleLocator
import numpy as np

from dp_swing_ros.campaign.rows import Row
from dp_swing_ros.campaign.summary import Summary
from dp_swing_ros.figures.curves import in_turns
from dp_swing_ros.figures.style import INK, styled
from dp_swing_ros.scenarios import SCENARIOS

SCENARIO = 'random'
EDGE = 1.06 * math.pi  # [rad]


@styled
def starts(summary: Summary, rows: Sequence[Row]) -> Figure | None:
    """Draw the random starts, coloured by settling time, failures crossed; None without any."""
    groups = {label: [row for row in rows if row.key[:2] == (label, SCENARIO)]
              for label in summary.campaign['contestants']}
    groups = {label: group for label, group in groups.items() if group}
    if not groups:
        return None
    columns = min(len(groups), 3)
    lines = math.ceil(len(groups) / columns)
    figure = Figure(figsize=(1.2 + 3.0 * columns, 0.9 + 3.1 * lines), layout='constrained')
    panels = figure.subplots(lines, columns, sharex=True, sharey=True, squeeze=False)
    for axes, (label, group) in zip(panels.flat, groups.items()):
        angles = np.array([_angles(row, summary.campaign['duration']) for row in group])
        times = np.array([row.metrics.settling_time for row in group])
        failed = np.isnan(times)
        points = axes.scatter(*angles[~failed].T, c=times[~failed], s=12, vmin=0.0, vmax=6.0,
                              cmap='viridis_r', linewidths=0)
        axes.plot(*angles[failed].T, 'x', color=INK, markersize=6, markeredgewidth=1.8)
        axes.set_title(f'{label}: {np.count_nonzero(~failed)} of {len(group)}', size=9)
        axes.set(xlim=(-EDGE, EDGE), ylim=(-EDGE, EDGE), aspect='equal')
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(MultipleLocator(np.pi))
            axis.set_major_formatter(in_turns)
    for unused in panels.flat[len(groups):]:
        unused.set_axis_off()
    figure.colorbar(points, ax=panels, extend='max', shrink=0.8, label='settling time [s]')
    figure.supxlabel(r'$\theta_1$ at the start [rad]')
    figure.supylabel(r'$\theta_2$ at the start [rad]')
    figure.suptitle('Random starts; crosses were not held')
    return figure


def _angles(row: Row, duration: float) -> tuple[float, float]:
    """Return the angles at the start, which follow from the seed."""
    seed = row.key.seed
    case, = SCENARIOS[SCENARIO].cases(SCENARIO, range(seed, seed + 1), 0, duration)
    return case.plant['initial_state'][1:3]
