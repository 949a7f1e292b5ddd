# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""When a period of a plant in lockstep may pass; times in [ns]."""

from dp_swing_ros.runtime.pace import Pace

LASTS = 100


def begun(now=1000, lasts=LASTS):
    pace = Pace()
    pace.due = now   # the period before was in time
    pace.begin(now, lasts)
    return pace


def test_without_a_force_it_waits_for_one_and_then_for_its_time():
    pace = begun()
    assert pace.wait(1050) is None
    pace.ready = True
    assert pace.wait(1050) == 50
    assert pace.wait(1100) == pace.wait(2000) == 0


def test_as_fast_as_it_can_where_a_period_lasts_no_time():
    pace = begun(lasts=0)
    pace.ready = True
    assert pace.wait(1000) == 0


def test_what_one_period_took_too_long_the_next_makes_up_for_but_no_more():
    pace = begun()                # due at 1100
    pace.begin(1130, LASTS)       # 30 late
    pace.ready = True
    assert pace.wait(1130) == 70
    pace.begin(5000, LASTS)       # by far too late
    pace.ready = True
    assert pace.wait(5000) == 0
    pace.begin(5000, LASTS)
    pace.ready = True
    assert pace.wait(5000) == LASTS


def test_a_faster_pace_counts_at_once():
    pace = begun(lasts=10_000)
    pace.change(1000, LASTS)
    pace.ready = True
    assert pace.wait(1000) == LASTS


def test_paused_it_takes_a_step_at_a_time():
    pace = begun()
    assert not pace.step().success and 'call plant/pause first' in pace.step().message
    assert pace.pause(True).message == 'paused'
    pace.ready = True
    assert pace.wait(9999) is None
    assert pace.step().success
    assert pace.wait(1000) == 0   # before its time
    pace.begin(1000, LASTS)
    assert pace.step().message == 'a period passes with the next force'
    assert pace.wait(1000) is None
    assert pace.pause(False).message == 'going on'
    pace.ready = True
    assert pace.wait(9999) == 0
