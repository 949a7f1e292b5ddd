# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One episode of a campaign: a contestant and a case make a row."""

from collections.abc import Callable

import numpy as np

from dp_swing_ros import configuration
from dp_swing_ros.control.receding_horizon import starts_to_warm_up
from dp_swing_ros.evaluation.campaign.contestants import Contestant
from dp_swing_ros.evaluation.campaign.rows import ERROR, Key, Row, UNKNOWN
from dp_swing_ros.evaluation.metrics import measure, outcome, TIME_LIMIT
from dp_swing_ros.evaluation.scenarios import Case, PERIOD
from dp_swing_ros.simulation.closed_loop import Controller, simulate
from dp_swing_ros.simulation.episode import Episode

WARM_UP = 4    # ticks before the first that is timed in a process

_ready: dict[str, Callable[[int], Controller]] = {}  # by contestant, in this process


def key(contestant: Contestant, case: Case) -> Key:
    """Return what the row of an episode is called."""
    return Key(contestant.label, case.scenario, case.parameter, case.level, case.seed)


def play(contestant: Contestant, case: Case) -> Row:
    """Run an episode and measure it; one that raises is a row as well."""
    try:
        # what leaves the numbers shows in the outcome
        with np.errstate(all='ignore'):
            return measured(contestant, case, simulated(contestant, case))
    except Exception as error:  # noqa: B902
        detail = ' '.join(f'{type(error).__name__}: {error}'.split())
        return Row(key(contestant, case), ERROR, detail, UNKNOWN, np.zeros(0))


def simulated(contestant: Contestant, case: Case) -> Episode:
    """
    Run an episode.

    Raises ParameterError, and ValueError where the case does not fit the plant.
    """
    controller = ready(contestant)(case.seed)
    plant = configuration.plant({**contestant.plant, **case.plant, 'seed': case.seed})
    return simulate(plant, controller, case.duration, contestant.name,
                    pushes=np.array(case.pushes) if case.pushes else None)


def measured(contestant: Contestant, case: Case, episode: Episode) -> Row:
    """Return the row of an episode."""
    metrics = measure(episode, contestant.mpc.get('time_limit', TIME_LIMIT))
    return Row(key(contestant, case), outcome(episode).name, '', metrics,
               episode.ticks.solve_time)


def ready(contestant: Contestant) -> Callable[[int], Controller]:
    """
    Return what makes the contestant's controllers, compiled and loaded in this process.

    Raises ParameterError.
    """
    name = repr(contestant)
    if name not in _ready:
        make = contestant.prepare()
        controller = make(0)
        links = configuration.plant(contestant.plant).physical.links
        # the one start needs what the other does not
        for start in starts_to_warm_up(links):
            plant = configuration.plant({**contestant.plant, 'initial_state': start.tolist()})
            simulate(plant, controller, WARM_UP * PERIOD)
        controller.fallback(WARM_UP * PERIOD)
        _ready[name] = make
    return _ready[name]
