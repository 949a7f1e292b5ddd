# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dp_swing_ros analyse BAG [BAG ...]`: table, pictures and report of recorded runs."""

import argparse
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
import re

from tqdm import tqdm

from dp_swing_ros import figures
from dp_swing_ros.evaluation.comparison import table
from dp_swing_ros.evaluation.metrics import measure
from dp_swing_ros.report import named, page, Recording, recording, Shown
from dp_swing_ros.simulation.episode import Episode
from dp_swing_ros.tools import program
from dp_swing_ros.tools.bag_arguments import add_namespace, add_partial, beside
from dp_swing_ros.tools.exit_codes import exit_code

PICTURES = {
    'hero': figures.hero, 'snapshots': figures.snapshots,
    'squared_error': figures.squared_error, 'timeline': figures.timeline}


def main(argv: Sequence[str] | None = None) -> int:
    """Analyse the bags that the command line names; return the exit code."""
    arguments = _parser().parse_args(argv)
    return exit_code('analyse', lambda: _analyse(arguments))


def _analyse(arguments: argparse.Namespace) -> int:
    runs = named([recording(bag, arguments.partial, arguments.namespace)
                  for bag in arguments.bags])
    print(table({name: measure(run.episode) for name, run in runs.items()}), end='\n\n')
    notice = incomplete(runs)
    if notice:
        print(notice, end='\n\n')
    folder = arguments.output or place_for(arguments.bags)
    for path in write(runs, folder, arguments.animation):
        print(path)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=program('analyse'),
        description='Print the table of recorded runs, draw their pictures, and write it all into '
                    'one page, report.html, from the bags alone.')
    parser.add_argument('bags', type=Path, nargs='+', metavar='BAG',
                        help='folder of a bag with joint_states, or its .mcap file; several are '
                             'shown side by side')
    parser.add_argument('--output', type=Path, metavar='DIR',
                        help='folder for report and pictures (default: BAG_analysis, beside the '
                             'bag; of several bags: comparison_TIME, here)')
    parser.add_argument('--animation', action=argparse.BooleanOptionalAction, default=True,
                        help='write the animation as a GIF too, which takes longest')
    add_partial(parser)
    add_namespace(parser)
    return parser


def incomplete(runs: Mapping[str, Recording]) -> str:
    """Return which runs, by their names, lack messages; empty where none does."""
    return '\n'.join(f'{name}: {run.incomplete}' if len(runs) > 1 else run.incomplete
                     for name, run in runs.items() if run.incomplete)


def place_for(bags: Sequence[Path]) -> Path:
    """Return the folder for what is made of bags."""
    if len(bags) == 1:
        return beside(bags[0], 'analysis')
    return Path(f'comparison_{datetime.now():%Y%m%d_%H%M%S}')


def write(runs: Mapping[str, Recording], folder: Path, animate: bool = True) -> list[Path]:
    """
    Draw runs, by their names, and write the report on them; return the paths of all that is made.

    Of several runs each has a folder of its own for its pictures.
    """
    shown, paths = {}, []
    for number, (name, run) in enumerate(runs.items(), start=1):
        own = folder / f'{number}_{re.sub(r"[^A-Za-z0-9.-]+", "_", name)}'
        drawn = draw(run.episode, own if len(runs) > 1 else folder, animate)
        shown[name] = Shown(run, {path.stem: path for path in drawn})
        paths += drawn
    overlay = None
    if len(runs) > 1:
        overlay = folder / 'overlay.png'
        figure = figures.overlay({name: run.episode for name, run in runs.items()})
        figures.mark(figure, incomplete(runs))
        figure.savefig(overlay)
        paths.append(overlay)
    paths.append(folder / 'report.html')
    paths[-1].write_text(page(shown, overlay), encoding='utf-8')
    return paths


def draw(episode: Episode, folder: Path, animate: bool = True) -> list[Path]:
    """Draw all pictures of a run into a folder and return their paths; show progress."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, picture in tqdm(PICTURES.items(), desc='pictures', leave=False, disable=None):
        paths.append(folder / f'{name}.png')
        figure = picture(episode)
        figures.mark(figure, episode.incomplete)
        figure.savefig(paths[-1])
    if animate:
        paths.append(folder / 'animation.gif')
        figures.animation(episode, paths[-1], lambda times: tqdm(
            times, desc='animation', leave=False, disable=None))
    return paths
