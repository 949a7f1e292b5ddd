# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Contestants: who controls the pendulum, and with which parameters."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
import re
from typing import Any

from dp_swing_ros import configuration
from dp_swing_ros.evaluation.baselines import BASELINES
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.parameters.files import value_of
from dp_swing_ros.simulation.closed_loop import Controller
from dp_swing_ros.solvers import SOLVERS

FORMAT = re.compile(r'(?:(?P<label>[^=:]+)=)?(?P<name>[^=:]+)(?::(?P<parts>.+))?')


@dataclass(frozen=True)
class Contestant:
    """A solver in the receding horizon, or a baseline, and the parameters of plant and mpc."""

    label: str
    name: str
    plant: dict[str, Any]
    mpc: dict[str, Any]

    def prepare(self) -> Callable[[int], Controller]:
        """
        Return what makes the controller for a seed, all that seeds share done once.

        Raises ParameterError.
        """
        if self.name in SOLVERS:
            return lambda seed: configuration.controller(
                {**self.mpc, 'solver': self.name, 'seed': seed})
        return BASELINES[self.name](configuration.problem(self.mpc))


def parse(text: str) -> Contestant:
    """
    Read [LABEL=]NAME[:PART[+PART...]], a part being a parameter file or mpc_parameter=value.

    Raises ParameterError.
    """
    match = FORMAT.fullmatch(text)
    names = [*SOLVERS, *BASELINES]
    if match is None or match['name'] not in names:
        raise ParameterError(f'unknown contestant {text!r}; expected [LABEL=]NAME[:PART[+PART...]]'
                             f', a NAME of {", ".join(names)}')
    parts = match['parts'].split('+') if match['parts'] else []
    files = [Path(part) for part in parts if '=' not in part]
    given = [part.split('=', 1) for part in parts if '=' in part]
    values = configuration.read(files)
    mpc = {**values['mpc'], **{name: value_of(value) for name, value in given}}
    shown = '+'.join(part if '=' in part else Path(part).stem for part in parts)
    label = match['label'] or match['name'] + (f':{shown}' if shown else '')
    return Contestant(label, match['name'], values['plant'], mpc)


def parse_all(texts: Iterable[str]) -> list[Contestant]:
    """
    Read several; each must have a label of its own.

    Raises ParameterError.
    """
    contestants: dict[str, Contestant] = {}
    for text in texts:
        contestant = parse(text)
        if contestant.label in contestants:
            raise ParameterError(f'two contestants are called {contestant.label!r}; give one of '
                                 'them another label: LABEL=NAME:...')
        contestants[contestant.label] = contestant
    return list(contestants.values())
