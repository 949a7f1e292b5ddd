# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page, from the templates beside this file; all they are given is escaped."""

from base64 import b64encode
from collections.abc import Mapping
from hashlib import sha256
import math
from pathlib import Path
from typing import Any, NamedTuple

from jinja2 import Environment, FileSystemLoader, StrictUndefined
import numpy as np

from dp_swing_ros.evaluation.comparison import rows
from dp_swing_ros.evaluation.metrics import outcome
from dp_swing_ros.figures import style
from dp_swing_ros.figures.pendulum import (
    arrow_size, cart_size, force_at, room_for, states_at, times_of, track_lines)
from dp_swing_ros.pendulum.geometry import drawn_centres, drawn_scale, joint_positions
from dp_swing_ros.pendulum.parameters import acting
from dp_swing_ros.pendulum.units import decimals
from dp_swing_ros.report.recording import Recording
from dp_swing_ros.report.settings import differences, provenances, settings
from dp_swing_ros.simulation.episode import Episode

FOLDER = Path(__file__).parent
FRAME = 0.02   # [s] scaled, between the pictures of the animation
TRAIL = 1.0    # [s] scaled, of the upper tip
FRAMES = 3000  # at most; those of a long run are further apart
KINDS = {1: 'Inverted', 2: 'Double inverted', 3: 'Triple inverted'}   # by number of links
HIGHLIGHTS = ('settling_time', 'largest_force', 'largest_position', 'median_solve_time',
              'p99_solve_time', 'late_ticks')
CAPTIONS = {
    'hero': 'The swing-up as on film that runs past the cart, above the force of each moment.',
    'snapshots': 'The pendulum after equal parts of its motion, and at the end; bold times: '
                 'upright.',
    'squared_error': 'Squared distance of each state from upright at rest, on a logarithmic '
                     'axis; dashed: what counts as upright.',
    'timeline': 'Angles, position, force and the times of the controller over time.',
    'overlay': 'The runs over each other: angles, position, force and solve times over time.'}


class Shown(NamedTuple):
    """A run on the page: what was recorded, and its pictures by their names."""

    recording: Recording
    pictures: Mapping[str, Path]  # PNG; `animation` is a GIF


def page(runs: Mapping[str, Shown], overlay: Path | None = None) -> str:
    """
    Return the page on runs, by their names, as HTML.

    `overlay` is the picture of all of several runs. The page holds all that it shows, and
    forbids the browser to fetch anything and to run any script but its own.
    """
    environment = Environment(
        loader=FileSystemLoader(FOLDER), autoescape=True, trim_blocks=True, lstrip_blocks=True,
        undefined=StrictUndefined)
    player = (FOLDER / 'player.js').read_text(encoding='utf-8')
    names = list(runs)
    return environment.get_template('page.html').render(
        names=names,
        runs=[_run(name, shown) | {'anchor': f'run-{number}'}
              for number, (name, shown) in enumerate(runs.items(), start=1)],
        metrics=rows([shown.recording.metrics for shown in runs.values()],
                     [shown.recording.episode.bodies.drive for shown in runs.values()]).values(),
        differences=differences([shown.recording.configurations for shown in runs.values()]),
        overlay=None if overlay is None else _picture(
            'overlay', overlay, ', '.join(names), ' or '.join(dict.fromkeys(
                acting(shown.recording.episode.bodies.drive) for shown in runs.values()))),
        colours={'accent': style.PALETTE[0], 'ink': style.INK, 'faint': style.FAINT,
                 'paper': style.PAPER},
        player=player, digest=b64encode(sha256(player.encode()).digest()).decode())


def _run(name: str, shown: Shown) -> dict[str, Any]:
    """Return what the template shows of a run."""
    recorded, episode = shown.recording, shown.recording.episode
    drive = episode.bodies.drive
    metrics = rows([recorded.metrics], [drive])
    return {
        'name': name, 'solver': style.SOLVERS.get(episode.solver, name), 'recorded': recorded,
        'kind': KINDS[episode.physical.links],
        'place': '/'.join(recorded.path.resolve().parts[-2:]),
        'outcome': outcome(episode).value, 'acting': acting(drive),
        'length': float(episode.t[-1]),
        'highlights': [metrics[each] for each in HIGHLIGHTS],
        'film': _film(episode),
        'animation': _data(shown.pictures['animation']) if 'animation' in shown.pictures else '',
        'pictures': [_picture(each, shown.pictures[each], name, acting(drive))
                     for each in CAPTIONS if each in shown.pictures],
        'settings': settings(recorded.configurations),
        'provenances': provenances(recorded.configurations)}


def _picture(kind: str, path: Path, of: str, force: str) -> dict[str, str]:
    return {'source': _data(path), 'caption': CAPTIONS[kind].replace('force', force),
            'alt': f'{kind.replace("_", " ").capitalize()} of {of}'}


def _data(path: Path) -> str:
    return f'data:image/{path.suffix[1:]};base64,{b64encode(path.read_bytes()).decode()}'


def _film(episode: Episode) -> dict[str, Any]:
    """
    Return what the player draws, in metres, colours and line widths; what JSON lacks is null.

    A frame is the force [N] and the polyline of the joints, whose pieces are the links.
    """
    physical, scale = episode.physical, drawn_scale(episode.physical)
    period = max(scale.sized(FRAME, 's'), float(episode.t[-1]) / FRAMES)
    times, digits = times_of(episode, period), decimals(1, scale.factor('N'))
    joints = np.round(joint_positions(states_at(episode, times), physical.lengths),
                      decimals(4, scale.length))
    return {
        'period': period, 'trail': scale.sized(TRAIL, 's'), 'digits': digits,
        'unit': style.unit_of_input(episode.bodies.drive),
        'half_width': room_for(episode), 'reach': 1.15 * sum(physical.lengths),
        'track': track_lines(scale, episode.limits).tolist(), 'size': scale.length,
        'cart': cart_size(scale), 'links': style.LINKS[:physical.links],
        'arrow': arrow_size(scale), 'centres': drawn_centres(physical),
        'colours': {'track': style.FAINT, 'cart': style.CART, 'force': style.FORCE},
        'joints': [each.tolist() if np.isfinite(each).all() else None for each in joints],
        'forces': [round(u, digits + 1) if math.isfinite(u) else None
                   for u in (force_at(episode, t) for t in times)]}
