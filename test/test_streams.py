# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""One seed for plant, controller and scenario, and no number drawn twice."""

import itertools

from controllers import controller, plant
import faults
import numpy as np
import pytest

from dp_swing_ros.evaluation.scenarios import PUSHES, SCENARIOS, START
from dp_swing_ros.solvers import SOLVERS
from dp_swing_ros.streams import Stream, stream

COUNT = 20_000


def generators(seed):
    """Return every generator of a closed loop of one seed, by what it is for."""
    p, c = plant(seed), controller('mppi', seed)
    return {'sensors': p.sensor_noise, 'force': p.force_noise, 'states lost': p.state_loss,
            'commands lost': p.commands.loss, 'commands late': p.commands.lateness,
            'samples': c.planner.solver.random, 'starts': c.planner.starts.random_forces,
            'initial state': np.random.default_rng((START, seed)),
            'pushes': np.random.default_rng((PUSHES, seed))}


@pytest.mark.parametrize('seed', [0, 1, 12345])
def test_streams_of_one_seed_are_independent(seed):
    drawn = {name: random.normal(size=COUNT) for name, random in generators(seed).items()}
    assert len(drawn) == len(Stream) + 2   # all there are
    for (one, a), (other, b) in itertools.combinations(drawn.items(), 2):
        assert not np.isin(a[:100], b).any(), (one, other)
        assert abs(np.corrcoef(a, b)[0, 1]) < 4 / np.sqrt(COUNT), (one, other)


def test_the_same_seed_gives_the_same_numbers_and_another_seed_others():
    for purpose in Stream:
        first, second = (stream(3, purpose).random(5) for _ in range(2))
        np.testing.assert_array_equal(first, second)
        assert not np.isin(first, stream(4, purpose).random(1000)).any()


def test_what_a_number_was_given_to_stays_and_no_other_gets_it():
    given = {each.name: each.value for each in Stream}
    assert given == {'SENSOR_NOISE': 0, 'FORCE_NOISE': 1, 'STATE_LOSS': 2, 'COMMAND_LOSS': 3,
                     'COMMAND_JITTER': 4, 'STARTS': 5, 'SOLVER': 6}   # the next one is 10
    elsewhere = {faults.STATE_CHANNEL, faults.COMMAND_CHANNEL, faults.STATE_NAN}
    assert elsewhere == {7, 8, 9}


def test_a_solver_built_with_a_seed_draws_what_the_controller_s_does():
    c = controller('mppi', 7)
    alone = SOLVERS['mppi'](c.nominal, c.planner.solver_parameters, 7)
    np.testing.assert_array_equal(alone.random.random(5), c.planner.solver.random.random(5))


def test_the_starts_of_the_published_campaigns_stay():
    case = next(SCENARIOS['random'].cases('random', range(1000, 1001), None, 10.0))
    np.testing.assert_allclose(case.plant['initial_state'], (
        -0.6062935572166255, -1.3347630806172368, 1.8855164477572544, -0.06888821529018085,
        -0.3427532901552439, -2.187701357352423), rtol=1e-15)
