# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
The pictures of docs/architecture.md: `python scripts/architecture.py docs/figures`.

The layers are those of the contract in pyproject.toml, with what each package says of itself; the
topics have the names of dp_swing_ros/topics.py. Run by `make docs`.
"""

import ast
from pathlib import Path
import re
import sys
import textwrap

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from dp_swing_ros.figures.style import FAINT, INK, PALETTE, styled, tint
from dp_swing_ros.topics import (
    CONFIGURATION, DIAGNOSTICS, DISTURBANCE, FORCE_COMMAND, JOINT_STATES, PLAN, ROBOT_DESCRIPTION)

TOP = Path(__file__).parents[1]
CONTRACT = r"name = 'imports run one way'.*?^layers = (\[.*?^\])"
WITH_ROS, DRAWING = {'nodes', 'tools'}, {'figures'}
ROW, GAP, WIDTH = 0.58, 0.06, 9.0   # [inch]
BLUE, RED, GREEN = PALETTE[:3]


def contract() -> list[list[str]]:
    """Return the layers, the highest first, each with what lies in it side by side."""
    found = re.search(CONTRACT, (TOP / 'pyproject.toml').read_text(), re.M | re.S)
    assert found, 'pyproject.toml has no contract of the layers'
    return [layer.split(' | ') for layer in ast.literal_eval(found[1])]


def about(name: str) -> str:
    """Return the first sentence of a package or a module of ours on itself."""
    path = TOP / 'dp_swing_ros' / name
    file = path / '__init__.py' if path.is_dir() else path.with_suffix('.py')
    docstring = ast.get_docstring(ast.parse(file.read_text())) or ''
    return ' '.join(docstring.split('\n\n')[0].split()).rstrip('.')


def canvas(width: float, height: float) -> tuple[Figure, Axes]:
    """Return a figure of a size [inch], and axes over all of it in inches."""
    figure = Figure(figsize=(width, height))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0, width), ylim=(0, height))
    axes.set_axis_off()
    return figure, axes


def box(axes: Axes, x: float, y: float, width: float, height: float, colour: str) -> None:
    """Draw a box from its lower left corner."""
    axes.add_patch(FancyBboxPatch(
        (x + 0.05, y + 0.05), width - 0.1, height - 0.1, boxstyle='round,pad=0.04',
        facecolor=tint(colour, 0.12), edgecolor=colour, linewidth=1.2))


def arrow(axes: Axes, begin: tuple[float, float], end: tuple[float, float], text: str = '',
          colour: str = INK, above: bool = True, **line: str) -> None:
    """Draw an arrow with a text at its middle."""
    axes.annotate('', end, begin, arrowprops={
        'arrowstyle': '-|>', 'color': colour, 'linewidth': 1.4, 'shrinkA': 0, 'shrinkB': 0,
        **line})
    if text:
        middle = (begin[0] + end[0]) / 2, (begin[1] + end[1]) / 2 + (0.05 if above else -0.05)
        axes.text(*middle, text, ha='center', va='bottom' if above else 'top', size=8.5,
                  family='monospace', color=INK)


@styled
def layers() -> Figure:
    """Draw the layers; each may import what lies below it, and nothing beside or above."""
    rows = contract()
    left, height = 0.75, len(rows) * (ROW + GAP) + GAP
    figure, axes = canvas(WIDTH, height)
    for number, row in enumerate(rows):
        y, width = height - (number + 1) * (ROW + GAP), (WIDTH - left - 0.1) / len(row)
        for place, name in enumerate(row):
            colour = RED if name in WITH_ROS else GREEN if name in DRAWING else BLUE
            x = left + place * width
            box(axes, x, y, width, ROW, colour)
            letters = int(width * 17.5) - 4
            text = '\n'.join(textwrap.wrap(about(name), letters)[:2]) if len(row) < 4 else ''
            side = len(row) == 1
            axes.text(x + (0.15 if side else width / 2), y + (0.29 if side or not text else 0.44),
                      name, size=10.5, weight='bold', va='center',
                      ha='left' if side else 'center')
            axes.text(x + (1.45 if side else width / 2), y + (0.29 if side else 0.2), text,
                      size=8 if side else 7, va='center', ha='left' if side else 'center')
    arrow(axes, (0.35, height - 0.2), (0.35, 0.2), colour=FAINT)
    axes.text(0.25, height / 2, 'may import', rotation=90, ha='right', va='center', size=9)
    return figure


@styled
def nodes() -> Figure:
    """Draw the nodes, the topics between them, and the bag with its tools."""
    figure, axes = canvas(WIDTH, 5.1)

    def place(x: float, y: float, width: float, name: str, text: str, colour: str = BLUE,
              height: float = 1.0) -> None:
        box(axes, x, y, width, height, colour)
        axes.text(x + width / 2, y + height - 0.28, name, size=11, weight='bold', ha='center',
                  va='center')
        axes.text(x + width / 2, y + height / 2 - 0.15, text, size=8.2, ha='center', va='center')

    place(0.2, 3.4, 2.3, 'plant', 'integrates the pendulum\n(or the driver of your rig)',
          height=1.5)
    place(6.5, 3.4, 2.3, 'mpc', 'a plan for each state,\nits first force sent', height=1.5)
    place(3.35, 1.75, 2.3, 'logger', 'writes what it hears as it is', RED)
    place(3.35, 0.1, 2.3, 'bag', 'MCAP, metadata.yaml', FAINT)
    place(6.5, 0.1, 2.3, 'tools', 'verify, compare, analyse,\nexport, recover', GREEN)
    place(0.2, 0.1, 2.3, 'replay', 'plays a bag back', RED)
    arrow(axes, (2.5, 4.5), (6.5, 4.5), JOINT_STATES.name)
    arrow(axes, (6.5, 3.85), (2.5, 3.85), FORCE_COMMAND.name)
    arrow(axes, (1.0, 2.75), (1.0, 3.42))
    axes.text(1.05, 2.7, f'{DISTURBANCE.name}\n(from anyone)', size=8.5, family='monospace',
              ha='center', va='top')
    # what is recorded, of both
    arrow(axes, (2.1, 3.42), (3.7, 2.75), colour=FAINT)
    arrow(axes, (6.9, 3.42), (5.3, 2.75), colour=FAINT)
    arrow(axes, (4.5, 3.82), (4.5, 2.75), colour=FAINT)
    axes.text(5.85, 2.6, f'{PLAN.name}\n{DIAGNOSTICS.name}, {CONFIGURATION.name}', size=8.5,
              family='monospace', ha='left', va='center')
    axes.text(3.15, 2.25, f'{ROBOT_DESCRIPTION.name}\n{DIAGNOSTICS.name}\n{CONFIGURATION.name}',
              size=8.5, family='monospace', ha='right', va='center')
    arrow(axes, (4.5, 1.77), (4.5, 1.1))
    arrow(axes, (5.65, 0.6), (6.5, 0.6))
    arrow(axes, (3.35, 0.6), (2.5, 0.6))
    arrow(axes, (0.5, 1.1), (0.5, 1.6), linestyle='--')
    axes.text(0.62, 1.42, 'the topics again', size=8.2, ha='left', va='center')
    return figure


if __name__ == '__main__':
    folder = Path(sys.argv[1])
    nodes().savefig(folder / 'nodes.png', facecolor='white')
    layers().savefig(folder / 'layers.png', facecolor='white')
