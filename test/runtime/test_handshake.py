# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""When the first state can be answered, by who is around."""

import pytest

from dp_swing_ros.messages.configuration import Configuration
from dp_swing_ros.runtime.handshake import Handshake, PATIENCE, Peers
from dp_swing_ros.runtime.timing import Timing

NOW = 50.0   # [s]
NOBODY = Peers(set(), set(), set())
DRIVER = Peers({'/driver'}, set(), {'/driver'})
PLANT = Peers({'/plant'}, {'/plant'}, {'/plant'})


def announced(node='/plant', revision=0, resets=0, **parameters):
    return Configuration(node, {'lockstep': False, **parameters}, '', '', '', '', {}, revision,
                         0, resets)


def waiting():
    handshake = Handshake()
    handshake.keep('a state', NOW)
    return handshake


def complete(handshake, peers, now=NOW, timing=None, is_timed=True):
    return handshake.complete(peers, timing or Timing('announced'), is_timed, now)


def test_a_driver_that_announces_nothing_is_answered_at_once():
    handshake = waiting()
    assert complete(handshake, DRIVER) == 'a state'
    assert handshake.done
    assert complete(handshake, DRIVER) is None   # once


def test_without_a_state_there_is_nothing_to_answer():
    assert complete(Handshake(), DRIVER) is None


def test_of_several_the_newest_is_answered():
    handshake = waiting()
    handshake.keep('a newer one', NOW + 1.0)
    assert complete(handshake, DRIVER) == 'a newer one'


def test_who_announces_something_is_waited_for_but_not_for_ever():
    handshake, timing = waiting(), Timing('announced')
    assert complete(handshake, PLANT, timing=timing) is None
    handshake.learn(announced())
    timing.learn(announced(), ['/plant'])
    assert complete(handshake, PLANT, timing=timing) == 'a state'
    handshake = waiting()
    assert complete(handshake, PLANT, NOW + PATIENCE) is None
    assert complete(handshake, PLANT, NOW + PATIENCE + 0.01) == 'a state'


@pytest.mark.parametrize('lockstep', [False, True])
def test_a_plant_of_ours_is_answered_once_it_hears_the_force(lockstep):
    handshake, timing = waiting(), Timing('announced')
    handshake.learn(announced(lockstep=lockstep))
    timing.learn(announced(lockstep=lockstep), ['/plant'])
    assert complete(handshake, PLANT._replace(hearers=set()), timing=timing) is None
    assert complete(handshake, PLANT, timing=timing) == 'a state'


def test_before_a_simulated_clock_is_heard_nothing_is_answered_however_late_it_is():
    handshake = waiting()
    assert complete(handshake, DRIVER, NOW + 9 * PATIENCE, is_timed=False) is None
    assert not handshake.is_late(NOW + PATIENCE)
    assert handshake.is_late(NOW + PATIENCE + 0.01)
    assert complete(handshake, DRIVER, NOW + 9 * PATIENCE) == 'a state'
    assert not handshake.is_late(NOW + 10 * PATIENCE)


def test_a_plant_that_begins_again_is_told_from_one_that_changes():
    handshake = Handshake()
    assert not handshake.learn(announced())
    assert not handshake.learn(announced(revision=1))
    assert handshake.learn(announced(revision=1, resets=1))
    assert not handshake.learn(announced(revision=2, resets=1))
    assert handshake.learn(announced(revision=0, resets=1))    # another process
    assert not handshake.learn(announced('/other'))            # of which nothing was heard
