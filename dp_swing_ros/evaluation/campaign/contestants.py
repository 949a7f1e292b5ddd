# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Contestants: who controls the pendulum, with which parameters; and the episodes they play."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
import re
from typing import Any

import numpy as np

from dp_swing_ros import declarations
from dp_swing_ros.control import controllers
from dp_swing_ros.control.receding_horizon import starts_to_warm_up
from dp_swing_ros.dynamics.files import load
from dp_swing_ros.evaluation.baselines import BASELINES
from dp_swing_ros.evaluation.campaign.rows import ERROR, Key, Row, UNKNOWN
from dp_swing_ros.evaluation.metrics import measure, outcome, TIME_LIMIT
from dp_swing_ros.evaluation.scenarios import Case, PERIOD, sized
from dp_swing_ros.parameters import group, ParameterError
from dp_swing_ros.parameters.files import value_of
from dp_swing_ros.pendulum.parameters import PendulumParameters, VELOCITY
from dp_swing_ros.problem.parameters import LEARNED
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import Controller, simulate
from dp_swing_ros.simulation.episode import Episode
from dp_swing_ros.solvers import SOLVERS

FORMAT = re.compile(r'(?:(?P<label>[^=:]+)=)?(?P<name>[^=:]+)(?::(?P<parts>.+))?')
# bodies and kind of drive, of a plant
OF_NOMINAL = ('drive', 'force_limit', 'acceleration_limit', 'track_limit', 'physics_step')
WARM_UP = 4    # ticks before the first that is timed in a process

_ready: dict[str, Callable[[int], Controller]] = {}  # by contestant, in this process


@dataclass(frozen=True)
class Contestant:
    """A solver in the receding horizon, or a baseline, and the parameters of plant and mpc."""

    label: str
    name: str
    plant: dict[str, Any]
    mpc: dict[str, Any]

    def prepare(self) -> Callable[[int], Controller]:
        """Return what makes the controller for a seed; raises ParameterError."""
        if self.name in SOLVERS:
            return lambda seed: controllers.controller(
                {**self.mpc, 'solver': self.name, 'seed': seed})
        return BASELINES[self.name](self.mpc)


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
    values = declarations.read(files)
    mpc = {**values['mpc'], **{name: value_of(value, name) for name, value in given}}
    complete = controllers.MPC.complete(mpc)   # before hundreds of episodes find it out
    plants.PLANT.complete(values['plant'])
    if match['name'] in BASELINES and complete['drive'] == VELOCITY:
        raise ParameterError(f"{match['name']} sends forces or accelerations, and drive is "
                             f'{VELOCITY!r}; expected a solver, or another drive')
    if complete['dynamics'] == LEARNED:   # its file may be another when a campaign goes on
        mpc['model'] = load(complete['model'], complete['links']).to_text()
    shown = '+'.join(part if '=' in part else Path(part).stem for part in parts)
    label = match['label'] or match['name'] + (f':{shown}' if shown else '')
    return Contestant(label, match['name'], values['plant'], mpc)


def parse_all(texts: Iterable[str]) -> list[Contestant]:
    """Read several, each with a label of its own; raises ParameterError."""
    contestants: dict[str, Contestant] = {}
    for text in texts:
        contestant = parse(text)
        if contestant.label in contestants:
            raise ParameterError(f'two contestants are called {contestant.label!r}; give one of '
                                 'them another label: LABEL=NAME:...')
        contestants[contestant.label] = contestant
    return list(contestants.values())


def key(contestant: Contestant, case: Case) -> Key:
    """Return what the row of an episode is called."""
    return Key(contestant.label, case.scenario, case.parameter, case.level, case.seed)


def play(contestant: Contestant, case: Case) -> Row:
    """Run an episode and measure it; one that raises is a row as well."""
    try:
        # what leaves the numbers shows in the outcome
        with np.errstate(all='ignore'):
            return measured(contestant, case, simulated(contestant, case))
    except Exception as error:
        detail = ' '.join(f'{type(error).__name__}: {error}'.split())
        return Row(key(contestant, case), ERROR, detail, UNKNOWN, np.zeros(0))


def simulated(contestant: Contestant, case: Case) -> Episode:
    """Run an episode; raises ParameterError, and ValueError for a case that does not fit."""
    rate = case.plant.get('rate', contestant.plant.get('rate', 1 / PERIOD))
    nominal = group(PendulumParameters, contestant.mpc)
    case = of_inertias(sized(case, nominal, 1 / rate), nominal)
    if case.told or case.mpc:
        contestant = replace(contestant, mpc={**contestant.mpc, **case.told, **case.mpc})
    controller = ready(contestant)(case.seed)
    # what is off are the bodies, and not the drive, the track or the integrator with them
    usual = plants.PLANT.complete(nominal.by_name)
    plant = plants.plant({**{name: usual[name] for name in OF_NOMINAL}, **contestant.plant,
                          **case.told, **case.plant, 'seed': case.seed})
    episode = simulate(plant, controller, case.duration, contestant.name,
                       pushes=np.array(case.pushes) if case.pushes else None,
                       resets={n: np.array(x) for n, x in case.resets},
                       goal=controllers.cost(contestant.mpc).x_r)
    return replace(episode, nominal=nominal)


def of_inertias(case: Case, nominal: PendulumParameters) -> Case:
    """Return a case whose inertias are off by as much, of links whose inertia is told."""
    plant = dict(case.plant)
    for i in range(1, nominal.links + 1):
        told = getattr(nominal, f'link{i}_inertia')
        if told and (factor := plant.pop(f'link{i}_inertia_factor', None)) is not None:
            plant[f'link{i}_inertia'] = factor * told
    return replace(case, plant=plant)


def measured(contestant: Contestant, case: Case, episode: Episode) -> Row:
    """Return the row of an episode."""
    metrics = measure(episode, contestant.mpc.get('time_limit', TIME_LIMIT))
    return Row(key(contestant, case), outcome(episode).name, '', metrics,
               episode.ticks.solve_time)


def ready(contestant: Contestant) -> Callable[[int], Controller]:
    """Return what makes its controllers, compiled and loaded here; raises ParameterError."""
    name = repr(contestant)
    if name not in _ready:
        make = contestant.prepare()
        controller = make(0)
        links = plants.plant(contestant.plant).physical.links
        # the one start needs what the other does not
        for start in starts_to_warm_up(links):
            plant = plants.plant({**contestant.plant, 'initial_state': start.tolist()})
            simulate(plant, controller, WARM_UP * PERIOD)
        controller.fallback(WARM_UP * PERIOD)
        _ready[name] = make
    return _ready[name]
