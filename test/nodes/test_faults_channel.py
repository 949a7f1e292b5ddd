# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What comes out of a channel with faults, by a clock that the test sets."""

from faults import Channel, ChannelParameters, STATE_CHANNEL
import numpy as np
import pytest

from dp_swing_ros.parameters import ParameterError
from dp_swing_ros.streams import stream

PERIOD, END = 10_000_000, 10 ** 12   # [ns]


def channel(seed=0, **faults):
    return Channel(ChannelParameters(**faults), stream(seed, STATE_CHANNEL))


def sent_through(way, count):
    """Put the numbers from 0 on into a channel, one a period; return what came, and when [ns]."""
    came = []
    for n in range(count):
        way.put(n, n * PERIOD)
        while way.due is not None and way.due < (n + 1) * PERIOD:
            due = way.due
            came += [(each, due) for each in way.take(due)]
    return came + [(each, END) for each in way.take(END)]


def numbers(way, count):
    return [number for number, _ in sent_through(way, count)]


def test_without_faults_each_message_is_due_as_it_comes():
    way = channel()
    assert sent_through(way, 50) == [(n, n * PERIOD) for n in range(50)]
    assert vars(way.counts) == {'heard': 50, 'lost': 0, 'delayed': 0, 'duplicated': 0,
                                'reordered': 0}


@pytest.mark.parametrize('loss', [0.0, 0.3, 1.0])
def test_losses_are_as_many_as_asked_for(loss):
    way = channel(loss=loss)
    came = numbers(way, 5000)
    assert len(came) + way.counts.lost == 5000
    assert way.counts.lost == pytest.approx(loss * 5000, abs=4 * np.sqrt(5000 * 0.25))
    assert came == sorted(came)


def test_duplicates_come_right_after_each_other():
    way = channel(duplication=0.5)
    came = numbers(way, 200)
    twice = [n for n in range(200) if came.count(n) == 2]
    assert came == sorted([*range(200), *twice])
    assert way.counts.duplicated == len(twice) == pytest.approx(100, abs=30)


def test_reordering_swaps_neighbours():
    assert numbers(channel(reordering=1.0), 7) == [1, 0, 3, 2, 5, 4]   # 6 waits for the next
    way = channel(reordering=0.3)
    came = numbers(way, 200)
    early = [n for n, number in enumerate(came) if number > n]
    assert all(came[n:n + 2] == [n + 1, n] for n in early)
    assert way.counts.reordered - len(early) in (0, 1)
    assert len(early) > 30


def test_a_duplicate_is_reordered_whole_and_not_after_a_lost_one():
    assert numbers(channel(reordering=1.0, duplication=1.0), 4) == [1, 1, 0, 0, 3, 3, 2, 2]
    way = channel(reordering=1.0)
    way.put('held', 0)
    way.parameters = ChannelParameters(loss=1.0)
    way.put('lost', 1)
    assert way.due is None
    way.parameters = ChannelParameters()
    way.put('next', 2)
    assert list(way.take(2)) == ['next', 'held']


def test_a_delay_is_constant():
    way = channel(delay=0.025)
    assert sent_through(way, 5)[:2] == [(0, 25_000_000), (1, 35_000_000)]
    assert way.counts.delayed == 5


def test_jitter_keeps_the_order():
    way = channel(delay=0.01, jitter=0.03)
    came = sent_through(way, 500)
    assert [number for number, _ in came] == list(range(500))
    late = np.array([due - number * PERIOD for number, due in came[:-5]])
    assert late.min() >= 10_000_000 and late.max() <= 40_000_000
    assert np.ptp(late) > 20_000_000


def test_order_is_kept_where_a_delay_is_taken_back():
    way = channel(delay=0.5)
    way.put('late', 0)
    way.parameters = ChannelParameters()
    way.put('prompt', PERIOD)
    assert list(way.take(PERIOD)) == []
    assert list(way.take(way.due)) == ['late', 'prompt']


def test_a_fault_does_not_change_whom_another_befalls():
    alone = set(numbers(channel(loss=0.3), 300))
    assert set(numbers(channel(
        loss=0.3, duplication=0.4, delay=0.01, jitter=0.05), 300)) == alone
    assert set(numbers(channel(1, loss=0.3), 300)) != alone


def test_where_the_clock_begins_anew_nothing_is_left_of_before():
    way = channel(delay=0.5, reordering=1.0)
    for n in range(3):
        way.put(n, END + n)
    way.parameters = ChannelParameters(delay=0.1)
    way.put('new', 0)
    assert way.due == 100_000_000
    assert list(way.take(END)) == ['new']


@pytest.mark.parametrize(('faults', 'words'), [
    ({'loss': 1.1}, 'at most 1'), ({'delay': -0.1}, 'at least 0 s'),
    ({'jitter': 1.5}, 'at most 1 s'), ({'reordering': float('nan')}, 'a finite number')])
def test_impossible_faults_are_refused(faults, words):
    with pytest.raises(ParameterError, match=words):
        ChannelParameters(**faults)
