# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""When a state was measured, when its force acts, and until when to solve."""

import math

import pytest
from std_msgs.msg import Header
from virtual import DAY, VirtualClocks

from dp_swing_ros.messages.fields import BILLION
from dp_swing_ros.nodes.messages import to_stamp
from dp_swing_ros.runtime.schedule import Arrived, Schedule
from dp_swing_ros.runtime.timing import BUSY

PERIOD = 0.05   # [s]


class Message:
    """A message with a header."""

    def __init__(self, t):
        self.header = Header(stamp=to_stamp(round((DAY + t) * BILLION)))


def arrived(schedule, t, way=0.002, number=1, stamp=None):
    """Let a state of a time [s] come on its way [s]; return how it came."""
    schedule.clocks.time = t + way
    sent = round((DAY + t) * BILLION)
    return Arrived(Message(t if stamp is None else stamp), b'', number, sent,
                   sent + round(way * BILLION))


def tick(schedule, *how, limit=0.04, **more):
    """Return the slot of a state."""
    came = arrived(schedule, *how, **more)
    return schedule.slot(came, schedule.arrival(came), limit)


@pytest.fixture
def schedule():
    return Schedule(VirtualClocks(), 'stamps', PERIOD)


def test_a_force_acts_after_what_ticks_take_and_as_long_a_way_as_the_state_had(schedule):
    for n in range(5):
        slot = tick(schedule, PERIOD * n, number=n + 1)
        schedule.clocks.sleep(0.004)   # the solve
        schedule.wait(slot)
    assert slot.t == pytest.approx(DAY + PERIOD * 4)
    assert slot.age == pytest.approx(0.002, abs=1e-6)
    assert slot.delay == pytest.approx(0.002 + 0.004 + 0.002, abs=1e-5)
    assert slot.period == pytest.approx(PERIOD)
    assert schedule.missed_total == 0


def test_a_tick_that_is_done_early_waits_for_the_time_it_was_given(schedule):
    schedule.tick_time = 0.010
    schedule.reset()
    slot = tick(schedule, 0.0)
    schedule.clocks.sleep(0.003)
    schedule.wait(slot)
    assert schedule.taken(slot) == pytest.approx(0.010, abs=1e-6)


@pytest.mark.parametrize(('limit', 'lasts'), [(0.01, 0.01), (1.0, BUSY * PERIOD)])
def test_a_solve_ends_by_its_limit_or_before_the_next_state(schedule, limit, lasts):
    slot = tick(schedule, 0.0, limit=limit)
    assert slot.deadline - slot.began == pytest.approx(lasts, abs=1e-5)


def test_what_waited_for_the_tick_before_has_less_time(schedule):
    came = arrived(schedule, 0.0)
    schedule.clocks.sleep(0.015)
    slot = schedule.slot(came, schedule.arrival(came), 1.0)
    assert slot.deadline - slot.began == pytest.approx(BUSY * PERIOD - 0.015, abs=1e-5)
    assert slot.age == pytest.approx(0.017, abs=1e-5)


def test_states_that_others_overtook_are_counted_and_no_longer_period_is_taken_from_them(schedule):
    tick(schedule, 0.0, number=7)
    slot = tick(schedule, 3 * PERIOD, number=10)
    assert schedule.missed_total == 2
    assert slot.period == pytest.approx(PERIOD)


def test_in_lockstep_nothing_depends_on_the_machine():
    schedule = Schedule(VirtualClocks(), 'lockstep', PERIOD)
    tick(schedule, 0.0, stamp=0.0)
    slot = tick(schedule, 77.0, number=2, stamp=PERIOD)
    assert schedule.lockstep
    assert (slot.deadline, slot.age, slot.delay) == (math.inf, 0.0, 0.0)
    assert slot.period == pytest.approx(PERIOD)


def test_times_are_of_a_simulated_clock_at_its_pace():
    clocks = VirtualClocks(simulated=0.0)
    schedule = Schedule(clocks, 'arrival', PERIOD)
    for n in range(100):   # at half the pace
        clocks.simulated_time = PERIOD * n
        clocks.time = 2 * PERIOD * n
        now = round((DAY + clocks.time) * BILLION)
        message = Message(0.0)
        message.header.stamp = to_stamp(round(clocks.simulated_time * BILLION))
        came = Arrived(message, b'', n + 1, now, now)
        slot = schedule.slot(came, schedule.arrival(came), 0.01)
    assert schedule.pace == pytest.approx(0.5, rel=1e-3)
    assert slot.deadline - slot.began == pytest.approx(0.02, rel=1e-3)   # of the steady clock


def test_a_tick_without_a_state_is_of_now(schedule):
    tick(schedule, 0.0)
    schedule.clocks.time = 0.2
    slot = schedule.silent_slot()
    assert slot.t == pytest.approx(DAY + 0.2)
    assert slot.delay == pytest.approx(0.002, abs=1e-6)
