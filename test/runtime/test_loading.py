# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What cannot be loaded is told, whatever is wrong with it, and the next one is loaded."""

import math

import pytest

from dp_swing_ros.control import controllers
from dp_swing_ros.control.receding_horizon import RecedingHorizon
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.runtime.loading import Loaded, Loader

SLOW = -math.inf   # of which every tick is late


class Broken(RecedingHorizon):
    """One whose library asks for the exit."""

    def warm_up(self, most=math.inf):
        """Ask for it."""
        raise SystemExit('no license')


def load(loader, controller, slowest=math.inf):
    """Load a controller; return what is taken."""
    loader.load(controller, {}, slowest)
    if loader.thread is not None:
        loader.thread.join()
    return loader.take()


def test_what_cannot_be_loaded_is_told_and_the_next_is_loaded():
    good = controllers.controller({})
    broken = Broken(good.nominal, good.parameters, good.planner.solver_parameters,
                    good.observer.estimator_parameters)
    loader = Loader(good)   # however busy the machine is
    assert load(loader, broken) == Loaded(broken, {}, 'no license')
    assert load(loader, good) == Loaded(good, {}, '')
    loader.load(broken, {}, math.inf)
    with pytest.raises(ParameterError, match='no license'):
        loader.wait()


def test_one_whose_ticks_would_be_late_whatever_the_deadline_is_refused():
    good = controllers.controller({})
    assert 'time_limit is 0.04 s; expected fewer' in load(Loader(good), good, SLOW).error


def test_samples_beyond_the_memory_are_refused():
    with pytest.raises(ParameterError, match='mppi.samples is 1000000, which over a horizon '
                                             'of 1000 steps take 4 GB; expected 1.1 GB at most'):
        controllers.controller({'solver': 'mppi', 'mppi.samples': 1_000_000, 'horizon': 1000})
