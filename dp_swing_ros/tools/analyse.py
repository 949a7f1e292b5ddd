# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dp_swing_ros analyse BAG [BAG ...]`: table, pictures and report of recorded runs."""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
import re

from dp_swing_ros import figures
from dp_swing_ros.evaluation.comparison import table
from dp_swing_ros.report.page import page, Shown
from dp_swing_ros.report.recording import named, Recording, recording
from dp_swing_ros.simulation.episode import Episode
from dp_swing_ros.tools.command_lines import bag_parser, beside, dated, execute, OK, progress

PICTURES = {
    'hero': figures.hero, 'snapshots': figures.snapshots,
    'squared_error': figures.squared_error, 'timeline': figures.timeline}


def main(argv: Sequence[str] | None = None) -> int:
    """Analyse the bags that the command line names; return the exit code."""
    parser = bag_parser(
        'analyse', 'Print the table of recorded runs, draw their pictures, and write it all into '
        'one page, report.html, from the bags alone.',
        nargs='+', help='folder of a bag with joint_states, or its .mcap file; several are shown '
                        'side by side')
    parser.add_argument('--output', type=Path, metavar='DIR',
                        help='folder for report and pictures (default: BAG_analysis, beside the '
                             'bag; of several bags: comparison_TIME, here)')
    parser.add_argument('--animation', action=argparse.BooleanOptionalAction, default=True,
                        help='write the animation as a GIF too, which takes longest')
    return execute(parser, _analyse, argv)


def _analyse(arguments: argparse.Namespace) -> int:
    bags = arguments.bag
    runs = named([recording(bag, arguments.partial, arguments.namespace, arguments.node)
                  for bag in bags])
    print(table({name: run.metrics for name, run in runs.items()},
                [run.episode.bodies.drive for run in runs.values()]), end='\n\n')
    notice = _incomplete(runs)
    if notice:
        print(notice, end='\n\n')
    folder = arguments.output or (
        beside(bags[0], 'analysis') if len(bags) == 1 else Path(dated('comparison')))
    for path in write(runs, folder, arguments.animation):
        print(path)
    return OK


def _incomplete(runs: Mapping[str, Recording]) -> str:
    """Return which runs, by their names, lack messages; empty where none does."""
    return '\n'.join(f'{name}: {run.incomplete}' if len(runs) > 1 else run.incomplete
                     for name, run in runs.items() if run.incomplete)


def write(runs: Mapping[str, Recording], folder: Path, animate: bool = True) -> list[Path]:
    """
    Draw runs, by their names, and write the report on them; return the paths of all that is made.

    Of several runs each has a folder of its own for its pictures.
    """
    shown, paths = {}, []
    for number, (name, run) in enumerate(runs.items(), start=1):
        own = folder / f'{number}_{re.sub(r"[^A-Za-z0-9.-]+", "_", name)}'
        drawn = _draw(run.episode, own if len(runs) > 1 else folder, animate)
        shown[name] = Shown(run, {path.stem: path for path in drawn})
        paths += drawn
    overlay = None
    if len(runs) > 1:
        overlay = folder / 'overlay.png'
        figure = figures.overlay({name: run.episode for name, run in runs.items()})
        figures.mark(figure, _incomplete(runs))
        figure.savefig(overlay)
        paths.append(overlay)
    paths.append(folder / 'report.html')
    paths[-1].write_text(page(shown, overlay), encoding='utf-8')
    return paths


def _draw(episode: Episode, folder: Path, animate: bool) -> list[Path]:
    """Draw all pictures of a run into a folder and return their paths; show progress."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, picture in progress(PICTURES.items(), desc='pictures'):
        paths.append(folder / f'{name}.png')
        figure = picture(episode)
        figures.mark(figure, episode.incomplete)
        figure.savefig(paths[-1])
    if animate:
        paths.append(folder / 'animation.gif')
        figures.animation(episode, paths[-1], lambda times: progress(times, desc='animation'))
    return paths
