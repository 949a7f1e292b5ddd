# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Every declared bound of plant and mpc, alone: it works, or is refused for what it goes with."""

import math

import numpy as np
import pytest

from dp_swing_ros.control import controllers
from dp_swing_ros.declarations import DECLARATIONS
from dp_swing_ros.estimators import ESTIMATORS
from dp_swing_ros.evaluation.metrics import measure, outcome
from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.pendulum.state import DEFAULT_LINKS
from dp_swing_ros.simulation import plants
from dp_swing_ros.simulation.closed_loop import simulate
from dp_swing_ros.solvers import SOLVERS

BASE = {'horizon': 8, 'mppi.samples': 32}
FIELDS = {node: each.fields(DEFAULT_LINKS) for node, each in DECLARATIONS.items()}
# where more than one parameter decides, in what words
REFUSED = {
    'link1_length': "'step' is 0.05", 'link2_length': "'step' is 0.05", 'step': "'step' is 1",
    'gravity': 'and gravity', 'force_limit': 'force_limit is 0',
    'state_weights': 'a positive weight on the position of the cart', 'pace': "'pace' is 100"}


def bounds(node):
    """Yield the names and values of all bounds that are numbers, or infinite where that may be."""
    for name, field in FIELDS[node].items():
        about, default = field.metadata, field.default
        listed = isinstance(default, tuple)
        kind = type(default[0] if listed else default)
        for value in {about['minimum'], about['maximum']} if kind in (int, float) else ():
            if name != 'links' and (math.isfinite(value) or not about['finite'] and value > 0):
                yield name, (kind(value),) * len(default) if listed else kind(value)


CASES = [(nodes, *each) for nodes in (('plant',), ('mpc',), tuple(DECLARATIONS))
         for each in bounds(nodes[0]) if all(each[0] in FIELDS[node] for node in nodes)]


def played(plant, mpc, duration=0.25):
    """Return an episode of a plant and an mpc with these parameters."""
    with np.errstate(all='ignore'):
        return simulate(plants.plant(plant), controllers.controller({**BASE, **mpc}),
                        duration)


@pytest.mark.parametrize('nodes, name, value', CASES)
def test_every_bound_works_or_is_refused(nodes, name, value):
    plant, mpc = ({name: value} if node in nodes else {} for node in DECLARATIONS)
    for kind, names in (('solver', SOLVERS), ('estimator', ESTIMATORS)):
        if name.split('.')[0] in names:
            mpc = {**mpc, kind: name.split('.')[0]}
    try:
        episode = played(plant, mpc, 0.05 if name.endswith('samples') else 0.25)
    except ParameterError as error:
        assert REFUSED.get(name, 'nothing') in str(error)
        return
    assert np.all(np.isfinite(episode.X)) and np.all(np.isfinite(episode.U))
    # the controller is alive, unless no state reaches it
    assert set(episode.ticks.status) != {'ZERO'} or name == 'state_loss'


@pytest.mark.parametrize('plant, mpc', [({}, True), (None, True), (None, False)])
@pytest.mark.parametrize('solver', ['ilqr', 'mppi'])
def test_light_links_do_not_end_it(plant, mpc, solver):
    """What the estimator believes then is no parameter that anybody gave."""
    light = dict.fromkeys(('cart_mass', 'link1_mass', 'link2_mass'), 0.001)
    episode = played(light if plant is None else plant, {**(light if mpc else {}),
                                                         'solver': solver}, 1.0)
    assert np.all(np.isfinite(episode.X))


WILD = [
    {'initial_state': [0.0, 3.0, 3.0, 0.0, 1e4, 0.0]},
    {'initial_state': [0.0, 3.0, 3.0, 1e300, 0.0, 0.0]},
    {'initial_state': [0.0, 1e300, 3.0, 0.0, 0.0, 0.0]},
    {'initial_state': [1e308, 3.0, 3.0, 0.0, 0.0, 0.0]}, {'force_bias': 1e9},
    {'force_bias': -1e308}, {'position_noise': 1e300}, {'gravity': 1e300},
    {'link1_length': 0.001, 'link2_length': 0.001}]


@pytest.mark.parametrize('wild', WILD, ids=str)
def test_what_diverges_is_measured_as_not_held(wild):
    episode = played(wild, {}, 1.0)
    metrics = measure(episode)
    assert not metrics.success and outcome(episode).value
    assert len(episode.t) == 21 and np.all(np.abs(episode.X[:, 0][1:]) <= 2.4)


@pytest.mark.parametrize('x, limit', [
    (1e308, 2.4), (1e308, math.inf), (-2.41, 2.4), (math.nan, 2.4), (math.inf, math.inf)])
def test_a_reference_that_is_not_on_the_track_is_refused(x, limit):
    with pytest.raises(ParameterError, match="parameter '?reference'? .*expected"):
        controllers.controller({'track_limit': limit, 'reference': [x, 0, 0, 0, 0, 0]})


def test_a_reference_at_the_end_of_the_track_is_one():
    problem = controllers.problem({'reference': [2.4, 0, 0, 0, 0, 0]})
    assert problem.x_r[0] == problem.parameters.limits.track_limit == 2.4
