# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The page, from the templates beside this file; all they are given is escaped."""

from base64 import b64encode
from collections.abc import Mapping
from hashlib import sha256
import math
from pathlib import Path
from typing import Any, NamedTuple

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
import numpy as np

from dp_swing_ros.evaluation.comparison import rows
from dp_swing_ros.evaluation.metrics import measure, outcome
from dp_swing_ros.figures import style
from dp_swing_ros.figures.pendulum import room_for
from dp_swing_ros.figures.sampling import force_at, states_at, times_of
from dp_swing_ros.report.recording import Recording
from dp_swing_ros.report.settings import differences, provenances, settings
from dp_swing_ros.simulation.episode import Episode

FRAME = 0.02   # [s] between the pictures of the animation
FRAMES = 3000  # at most; those of a long run are further apart
TYPES = {'.gif': 'image/gif', '.png': 'image/png'}
HIGHLIGHTS = ('settling_time', 'largest_force', 'largest_position', 'median_solve_time',
              'p99_solve_time', 'late_ticks')
CAPTIONS = {
    'hero': 'The swing-up as on film that runs past the cart, above the force of each moment.',
    'snapshots': 'The pendulum at one moment after another; green times: upright.',
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

    `overlay` is the picture of all of several runs. The page holds all that it shows, and tells
    the browser to fetch nothing and to run no script but its own.
    """
    environment = Environment(
        loader=PackageLoader('dp_swing_ros', 'report'), autoescape=True, trim_blocks=True,
        lstrip_blocks=True, undefined=StrictUndefined)
    player = _source(environment, 'player.js')
    names = list(runs)
    return environment.get_template('page.html').render(
        names=names,
        runs=[_told(name, shown) | {'anchor': f'run-{number}'}
              for number, (name, shown) in enumerate(runs.items(), start=1)],
        metrics=rows([measure(shown.recording.episode) for shown in runs.values()]).values(),
        differences=differences([shown.recording.configurations for shown in runs.values()]),
        overlay=None if overlay is None else _picture('overlay', overlay, ', '.join(names)),
        colours={name: getattr(style, name) for name in (
            'INK', 'FAINT', 'PAPER', 'LINK1', 'LINK2', 'CART', 'FORCE')},
        style=_source(environment, 'style.css'), player=player,
        digest=b64encode(sha256(player.encode()).digest()).decode())


def _source(environment: Environment, name: str) -> Markup:
    assert environment.loader is not None
    return Markup(environment.loader.get_source(environment, name)[0])


def _told(name: str, shown: Shown) -> dict[str, Any]:
    """Return what the template says of a run."""
    recorded, episode = shown.recording, shown.recording.episode
    metrics = rows([measure(episode)])
    told = settings(recorded.configurations)
    stills = [each for each in CAPTIONS if each in shown.pictures]
    return {
        'name': name, 'solver': style.SOLVERS.get(episode.solver, name), 'recorded': recorded,
        'place': '/'.join(recorded.path.resolve().parts[-2:]),
        'outcome': outcome(episode).value,
        'length': float(episode.t[-1] - episode.t[0]),
        'highlights': [metrics[each] for each in HIGHLIGHTS],
        'film': _film(episode),
        'animation': _data(shown.pictures['animation']) if 'animation' in shown.pictures else '',
        'pictures': [_picture(each, shown.pictures[each], name) for each in stills],
        'settings': told, 'changed': [one for one in told if one.changed],
        'provenances': provenances(recorded.configurations)}


def _picture(kind: str, path: Path, of: str) -> dict[str, str]:
    return {'source': _data(path), 'caption': CAPTIONS[kind],
            'alt': f'{kind.replace("_", " ").capitalize()} of {of}'}


def _data(path: Path) -> str:
    return f'data:{TYPES[path.suffix]};base64,{b64encode(path.read_bytes()).decode()}'


def _film(episode: Episode) -> dict[str, Any]:
    """Return what the player needs, numbers that JSON lacks as null."""
    period = max(FRAME, float(episode.t[-1] - episode.t[0]) / FRAMES)
    times = times_of(episode, period)
    bodies, limit = episode.bodies, episode.limits.track_limit
    states = np.round(states_at(episode, times)[:, :3], 4)
    return {'period': period, 'lengths': [bodies.link1_length, bodies.link2_length],
            'half_width': room_for(episode), 'track': limit if math.isfinite(limit) else None,
            'states': [x if np.isfinite(x).all() else None for x in states.tolist()],
            'forces': [round(u, 2) if math.isfinite(u) else None
                       for u in (force_at(episode, t) for t in times)]}
