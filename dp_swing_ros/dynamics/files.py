# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
A learned model and its file.

The file is JSON: numbers and words, which nothing executes. Numbers read back the same to the bit.
"""

from collections.abc import Mapping
from dataclasses import dataclass
import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from dp_swing_ros.dynamics.structured import harmonics, links, Structured
from dp_swing_ros.errors import one_line, SHOWN
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.parameters.files import SCALAR
from dp_swing_ros.pendulum.drive import HISTORY
from dp_swing_ros.pendulum.parameters import DIRECT, Drive
from dp_swing_ros.pendulum.state import Array, LINKS

FORMAT = 'dp_swing_ros learned dynamics, 1'
LARGEST_FILE = SCALAR    # [bytes]; a configuration, which holds it, can hold no more
DEPTH = 8                # of nested lists and objects
KIND = 'structured'      # of dynamics; others, with a network, were written before


@dataclass(frozen=True, eq=False)
class LearnedModel:
    """
    Dynamics, and the experience that they are from.

    The forces of the experience came by a drive that has a delay and a lag alone.
    Shapes: noise (n + 1,) [m/s, rad/s] standard deviations of the speeds after a transition from
    those predicted.
    """

    dynamics: Structured
    noise: Array
    about: Mapping[str, Any]   # where it is from, and how good it is
    drive: Drive = DIRECT

    def to_text(self) -> str:
        """Return the text of its file."""
        return json.dumps({
            'format': FORMAT, 'kind': KIND, 'links': self.dynamics.links,
            'about': dict(self.about), 'noise': self.noise.tolist(), 'delay': self.drive.delay,
            'time_constant': self.drive.time_constant,
            'dynamics': numbers_of(self.dynamics)}) + '\n'


def load(model: str, links: int) -> LearnedModel:
    """
    Read a file, or the text of one, for so many links.

    Raises ParameterError, which says what is wrong with it.
    """
    try:
        found = from_text(model if model.startswith('{') else text_of(Path(model).expanduser()))
        if found.dynamics.links != links:
            raise ValueError(f'it is of {found.dynamics.links} links, and links is {links}')
    except Exception as error:
        why = isinstance(error, OSError) and error.strerror or one_line(error)
        raise ParameterError(
            f"parameter 'model' is {model[:SHOWN]!r}: {why}; expected, with dynamics learned, a "
            'file that `ros2 run dp_swing_ros train` wrote') from None
    return found


def text_of(path: Path) -> str:
    """Return the text of a regular file, not too long; raises OSError or ValueError."""
    if not (path.is_file() or path.is_dir()) and path.exists():
        raise ValueError('it is no regular file')
    # should it be a pipe by now, nobody waits for who writes into it
    with open(path, 'rb', opener=lambda path, flags: os.open(path, flags | os.O_NONBLOCK)) as file:
        return file.read(LARGEST_FILE + 1).decode()


def from_text(text: str) -> LearnedModel:
    """Read the text of a file; raises ValueError."""
    if len(text) > LARGEST_FILE:
        raise ValueError(f'it has more than {LARGEST_FILE} bytes')
    try:
        content = json.loads(text, parse_constant=_not_finite)
        check_depth(content, DEPTH)
    except RecursionError:
        raise ValueError(f'it nests deeper than {DEPTH} levels') from None
    if not isinstance(content, dict) or content.get('format') != FORMAT:
        raise ValueError(f'its format is not {FORMAT!r}')
    try:
        n, kind = content['links'], content['kind']
        if kind != KIND:
            raise ValueError(f'its dynamics are {kind!r}, of which no plans are made any more; '
                             'learn them anew: train makes structured ones of the same bags')
        if n not in LINKS:
            raise ValueError(f'it is of {n!r} links; expected one of {", ".join(map(str, LINKS))}')
        return LearnedModel(
            dynamics_of(n, content['dynamics']), array(content['noise'], n + 1),
            dict(content['about']), Drive(*(
                time_of(content, name) for name in ('delay', 'time_constant'))))
    except (AttributeError, KeyError, OverflowError, TypeError) as error:
        raise ValueError(f'it is incomplete ({type(error).__name__}: {error})') from None


def check_depth(content: Any, most: int) -> None:
    """Raise RecursionError where lists and objects are nested deeper than so many levels."""
    below = content.values() if isinstance(content, dict) else content
    if isinstance(content, (dict, list)):
        if most == 0:
            raise RecursionError
        for each in below:
            check_depth(each, most - 1)


def time_of(content: Mapping[str, Any], name: str) -> float:
    """Return a time [s] of a drive; raises ValueError where it is none."""
    found = float(array(content[name]))
    if not 0 <= found <= HISTORY:
        raise ValueError(f'{name} is {found:g} s; expected 0 to {HISTORY:g} s')
    return found


def _not_finite(text: str) -> float:
    raise ValueError(f'it holds {text}, which is no finite number')


def numbers_of(dynamics: Structured) -> dict[str, Any]:
    """Return the numbers of dynamics by their names, for JSON."""
    return {name: np.asarray(getattr(dynamics, name)).tolist()
            for name in ('inertia', 'potential', 'friction', 'dry', 'sharpness')}


def dynamics_of(n: int, numbers: Mapping[str, Any]) -> Structured:
    """Return the dynamics of n links that have these numbers; raises ValueError, or KeyError."""
    count = len(harmonics([0.0] * n, [1.0] * n))
    return Structured(
        links(n), array(numbers['inertia'], (n + 1) * (n + 2) // 2, count),
        array(numbers['potential'], count), array(numbers['friction'], n + 1),
        array(numbers['dry'], n + 1), array(np.broadcast_to(numbers['sharpness'], n + 1), n + 1))


def array(values: Any, *shape: int) -> Array:
    """Return finite numbers of a shape; raises ValueError where they are none."""
    found = np.array(values, dtype=float)
    if found.shape != shape or not np.all(np.isfinite(found)):
        raise ValueError(f'numbers of shape {found.shape}; expected finite ones, {shape}')
    return found
