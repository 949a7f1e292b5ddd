# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`ros2 run dp_swing_ros analyse BAG`: the table and the pictures of a recorded run."""

import argparse
from collections.abc import Sequence
from pathlib import Path
import sys

from tqdm import tqdm

from dp_swing_ros import figures
from dp_swing_ros.bags import read_episode
from dp_swing_ros.comparison import table
from dp_swing_ros.episode import Episode
from dp_swing_ros.errors import UserError
from dp_swing_ros.metrics import measure

PICTURES = {
    'hero': figures.hero, 'snapshots': figures.snapshots,
    'squared_error': figures.squared_error, 'timeline': figures.timeline}


def main(argv: Sequence[str] | None = None) -> int:
    """Analyse the bag that the command line names; return the exit code."""
    arguments = _parser().parse_args(argv)
    try:
        episode = read_episode(arguments.bag, partial=arguments.partial)
        print(table({episode.solver or 'no controller': measure(episode)}), end='\n\n')
        folder = arguments.output or beside(arguments.bag)
        for path in draw(episode, folder, animate=arguments.animation):
            print(path)
    except (UserError, OSError) as error:
        print(f'analyse: error: {error}', file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='ros2 run dp_swing_ros analyse',
        description='Print the table of a recorded run and draw its pictures from the bag alone.')
    parser.add_argument('bag', type=Path, metavar='BAG',
                        help='folder of a bag with joint_states, or its .mcap file')
    parser.add_argument('--output', type=Path, metavar='DIR',
                        help='folder for the pictures (default: BAG_analysis, beside the bag)')
    parser.add_argument('--animation', action=argparse.BooleanOptionalAction, default=True,
                        help='draw the animation, which takes longest')
    parser.add_argument('--partial', action='store_true',
                        help='read what there is of a bag whose logger was killed')
    return parser


def beside(bag: Path) -> Path:
    """Return the folder for the pictures of a bag: beside it, where rosbag2 does not look."""
    bag = bag.resolve()
    return bag.with_name(f'{bag.stem if bag.suffix == ".mcap" else bag.name}_analysis')


def draw(episode: Episode, folder: Path, animate: bool = True) -> list[Path]:
    """Draw all pictures of a run into a folder and return their paths; show progress."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, picture in tqdm(PICTURES.items(), desc='pictures', leave=False):
        paths.append(folder / f'{name}.png')
        picture(episode).savefig(paths[-1])
    if animate:
        paths.append(folder / 'animation.gif')
        figures.animation(episode, paths[-1],
                          lambda times: tqdm(times, desc='animation', leave=False))
    return paths
