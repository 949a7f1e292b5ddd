# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""When a state was measured, whatever its stamp says."""

import math

import numpy as np
import pytest

from dp_swing_ros.messages.configuration import Configuration
from dp_swing_ros.runtime.timing import (
    AGAIN, Clock, LATELY, Latency, LONGEST_TRANSPORT, Setbacks, SLACK, Timing)

NOW = 1000.0   # [s]


def configuration(**parameters):
    return Configuration('/plant', parameters, '', '', '', '', {})


def ages(timing, stamps, arrivals):
    """Return the measured ages of states that come one after the other."""
    return [timing.measured(stamp, now, now).age for stamp, now in zip(stamps, arrivals)]


def test_a_stamp_of_this_clock_tells_the_age():
    measured = Timing('stamps').measured(NOW - 0.12, NOW, NOW)
    assert measured == (NOW - 0.12, pytest.approx(0.12), '')


def test_clocks_that_are_kept_together_may_differ_by_a_little():
    measured = Timing('stamps').measured(NOW + 0.002, NOW, NOW)
    assert measured.age == 0.0
    assert not measured.complaint


@pytest.mark.parametrize('offset', [-3600.0, -5.0, -1.5, 0.1, 5.0, 3600.0])
def test_an_age_that_cannot_be_is_never_obeyed(offset):
    timing = Timing('stamps')
    for n in range(5):
        now = NOW + 0.05 * n
        measured = timing.measured(now + offset, now, now)
        assert measured.age == pytest.approx(0.0)
        assert measured.t == pytest.approx(now)
        assert 'old' in measured.complaint if offset < 0 else 'ahead' in measured.complaint


@pytest.mark.parametrize('offset', [-3600.0, 0.1, 3600.0])
def test_beside_stamps_that_cannot_be_a_state_is_as_old_as_it_came_later(offset):
    late = np.array([0.0, 0.004, 0.0, 0.03, 0.001])
    stamps = NOW + 0.05 * np.arange(5)
    np.testing.assert_allclose(ages(Timing('stamps'), stamps + offset, stamps + late), late,
                               atol=1e-6)


@pytest.mark.parametrize('offset', [-10800.0, -0.06, 0.05, 10800.0])   # of the sender's clock
def test_stamps_of_a_machine_whose_clock_is_off_tell_the_age_all_the_same(offset):
    """The sender's clock says both when a state was measured and when it was sent."""
    timing, latency, way = Timing('stamps'), 0.03, np.array([1e-3, 1e-3, 4e-3, 1e-3])
    for n, late in enumerate(way):
        sent = NOW + 0.05 * n
        measured = timing.measured(sent - latency + offset, sent + late, sent + offset)
        assert measured.age == pytest.approx(latency + late - way.min(), abs=1e-6)
        assert measured.t == pytest.approx(sent - latency, abs=2e-3)
        assert ('behind' if offset < 0 else 'ahead') in measured.complaint


@pytest.mark.parametrize('way', [0.0, 0.001, 0.02])
def test_between_clocks_that_are_kept_together_the_way_is_part_of_the_age(way):
    measured = Timing('stamps').measured(NOW - 0.03, NOW + way, NOW)
    assert measured == (NOW - 0.03, pytest.approx(0.03 + way), '')


@pytest.mark.parametrize('offset', [-10800.0, -3600.0, -0.05, 0.0, 0.05, 0.1, 10800.0, 1e9])
def test_by_arrival_a_constant_offset_is_none(offset):
    late = np.array([0.0, 0.004, 0.0, 0.03, 0.001])
    stamps = NOW + 0.05 * np.arange(5)
    np.testing.assert_allclose(ages(Timing('arrival'), stamps + offset, stamps + late), late,
                               atol=1e-6)


def test_by_arrival_a_state_that_overtakes_is_in_its_place():
    timing = Timing('arrival')
    arrivals = [timing.measured(stamp, now, now) for stamp, now in (
        (0.0, NOW), (0.10, NOW + 0.10), (0.05, NOW + 0.11))]
    np.testing.assert_allclose([each.t - NOW for each in arrivals], [0.0, 0.10, 0.05], atol=1e-9)
    assert not any(each.complaint for each in arrivals)


@pytest.mark.parametrize('offset', [0.0, 0.3, -5.0])   # of the sender's clock
def test_where_stamps_stand_still_the_time_of_sending_counts(offset):
    timing, late = Timing('arrival'), [0.002, 0.001, 0.025, 0.001]
    timing.measured(0.0, NOW, NOW)
    for n, latency in enumerate(late, 1):
        sent = NOW + 0.05 * n
        measured = timing.measured(0.0, sent + latency, sent + offset)
        assert measured.age == pytest.approx(latency - min(late[:n]), abs=1e-6)
        assert 'stand still' in measured.complaint


def test_a_clock_that_is_set_begins_anew():
    timing = Timing('arrival')
    assert ages(timing, [50.0, 50.05, 7.1, 7.15], [NOW, NOW + 0.05, NOW + 0.1, NOW + 0.15]) == [
        pytest.approx(0.0, abs=1e-9)] * 4


def test_the_fastest_state_counts_for_a_while_only():
    """Of two clocks that drift apart by 1 ms a second, no age grows without end."""
    t = NOW + 0.05 * np.arange(2000)
    found = ages(Timing('arrival'), t * (1 - 1e-3), t)
    assert max(found) < 0.01


@pytest.mark.parametrize(('parameters', 'clock', 'delay'), [
    ({'lockstep': True, 'delay': 0.07}, Clock.LOCKSTEP, 0.07),
    ({'lockstep': False, 'delay': 0.07}, Clock.STAMPS, 0.07)])
def test_a_plant_announces_its_clock(parameters, clock, delay):
    timing = Timing('announced')
    assert timing.clock is Clock.ARRIVAL
    timing.learn(configuration(**parameters))
    assert (timing.clock, timing.delay) == (clock, delay)


def test_in_lockstep_a_state_is_as_old_as_announced():
    timing = Timing('announced')
    timing.learn(configuration(lockstep=True, delay=0.07))
    assert timing.measured(3.5, NOW, NOW) == (3.5, 0.07, '')


def test_others_announce_nothing_and_a_parameter_says_more():
    others = Timing('announced')
    others.learn(configuration(lockstep=True))
    others.learn(configuration(solver='ilqr'))
    assert others.clock is Clock.LOCKSTEP
    timing = Timing('arrival')
    timing.learn(configuration(lockstep=True))
    assert timing.clock is Clock.ARRIVAL


def test_a_tick_is_given_what_all_but_the_longest_of_late_took():
    latency = Latency(0.008)
    assert latency.expected(math.inf) == 0.008
    latency.remaining(1.0, first=True)   # which says nothing about the next
    assert latency.expected(math.inf) == 0.008
    for taken in [0.003] * 18 + [0.03, 0.006]:
        latency.remaining(taken, first=False)
    assert latency.expected(math.inf) == pytest.approx(0.006, abs=1e-3)
    # where the next state comes sooner, less, but what it takes to be no longer late
    assert latency.expected(0.005) == 0.005 - SLACK
    assert latency.expected(-0.01) == pytest.approx(0.003, abs=1e-3)


def test_a_force_waits_until_what_the_tick_was_given():
    latency = Latency(0.05)
    assert latency.remaining(0.02, first=True) == pytest.approx(0.03)
    assert latency.remaining(0.06, first=True) == 0.0   # a late one does not wait


def test_a_force_is_expected_to_travel_as_states_do():
    latency = Latency(0.008)
    assert latency.expected(math.inf) == 0.008
    for duration in (0.001, 0.002, 0.04, -3.0, 2 * LONGEST_TRANSPORT):
        latency.add_transport(duration)
    assert latency.transport() == 0.002
    assert latency.expected(math.inf) == pytest.approx(0.01)


def test_a_clock_that_jumps_back_again_and_again_is_told_of_until_it_stops():
    setbacks = Setbacks()
    for n in range(AGAIN):
        assert not setbacks.complaint(NOW)
        setbacks.times.append(NOW)
    assert f'jumped back {AGAIN} times' in setbacks.complaint(NOW + LATELY / 2)
    assert not setbacks.complaint(NOW + LATELY + 1.0)
