# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What of a bag is played and when, by a clock that the test sets."""

import struct

from made_bags import START, write_bag
import pytest

from dp_swing_ros.bags.reader import Bag
from dp_swing_ros.errors import BagError
from dp_swing_ros.nodes.playback import excerpt, Playback
from dp_swing_ros.parameters.nodes import ReplayParameters

SECOND = 1_000_000_000
MESSAGES = [(0.0, '/a', 0), (0.1, '/b', 1), (0.25, '/a', 2), (0.25, '/b', 3), (1.0, '/a', 4)]


@pytest.fixture
def bag(tmp_path):
    return Bag(write_bag(tmp_path / 'bag', MESSAGES), topics=[''])


def schedule(bag, **selection):
    return excerpt(bag, ReplayParameters(**selection))


def number(message):
    return struct.unpack('<d', message.entry.data[4:])[0]


def numbers(messages):
    return [number(message) for message in messages]


@pytest.mark.parametrize('selection, expected', [
    ({}, [0, 1, 2, 3, 4]), ({'topics': ['/b']}, [1, 3]), ({'topics': ['a']}, [0, 2, 4]),
    ({'start_offset': 0.1}, [1, 2, 3, 4]), ({'start_offset': 0.11}, [2, 3, 4]),
    ({'playback_duration': 0.25}, [0, 1, 2, 3]), ({'playback_duration': -1.0}, [0, 1, 2, 3, 4]),
    ({'topics': ['/a'], 'start_offset': 0.1, 'playback_duration': 0.5}, [2])])
def test_part_of_a_bag(bag, selection, expected):
    assert numbers(schedule(bag, **selection)) == expected


def test_topics_that_replay_makes_itself_are_left_out(bag):
    assert numbers(excerpt(bag, ReplayParameters(), {'/a'})) == [1, 3]
    with pytest.raises(BagError, match='nothing to play'):
        excerpt(bag, ReplayParameters(topics=['/a']), {'/a'})


@pytest.mark.parametrize('selection, reason', [
    ({'topics': ['/a', '/c', 'd']}, 'nothing on /c, /d; it holds messages of /a, /b'),
    ({'start_offset': 1.1}, 'lasts 1.000 s and has nothing to play from 1.1 s on'),
    ({'topics': ['/b'], 'start_offset': 0.5}, 'nothing to play from 0.5 s on')])
def test_nothing_to_play_is_refused(bag, selection, reason):
    with pytest.raises(BagError, match=reason):
        schedule(bag, **selection)


def test_bag_without_messages_is_refused(tmp_path):
    with pytest.raises(BagError, match='holds no message'):
        schedule(Bag(write_bag(tmp_path / 'bag', [])))


def test_order_of_sending_and_of_receipt(tmp_path):
    bag = Bag(write_bag(tmp_path / 'bag', [
        (-60.0, '/latched', 1, 0.0), (0.30, '/b', 3, 0.41), (0.10, '/a', 2, 0.40)]),
              topics=[''])
    sent, received = schedule(bag), schedule(bag, message_order='received')
    assert numbers(sent) == [1, 2, 3]  # what was sent long before begins with the recording
    assert [message.time - START for message in sent] == [0, SECOND // 10, 3 * SECOND // 10]
    assert numbers(received) == [1, 2, 3]
    assert [message.time - START for message in received] == [
        0, 40 * SECOND // 100, 41 * SECOND // 100]


def test_unknown_time_of_sending_is_that_of_receipt(tmp_path):
    unknown = -START / SECOND
    bag = Bag(write_bag(tmp_path / 'bag', [(0.0, '/a', 0), (unknown, '/a', 1, 0.5)]),
              topics=[''])
    assert [message.time - START for message in schedule(bag)] == [0, SECOND // 2]


def played(playback, now):
    """Return what is due now."""
    found = []
    while (due := playback.due()) is not None and due <= now:
        found.append(number(playback.take(now)))
    return found


def test_messages_are_due_as_recorded_however_late_the_others_were(bag):
    playback = Playback(schedule(bag), rate=2.0)
    assert playback.due() is None  # it stands still
    playback.pause(7 * SECOND, False)
    assert playback.due() == 7 * SECOND
    assert played(playback, 7 * SECOND + 1_000_000) == [0]
    assert playback.due() == 7 * SECOND + SECOND // 20
    assert played(playback, 7 * SECOND + SECOND // 5) == [1, 2, 3]
    assert playback.due() == 7 * SECOND + SECOND // 2
    assert played(playback, 7 * SECOND + SECOND // 2) == [4]
    assert playback.done and playback.due() is None
    assert playback.played == {'/a': 3, '/b': 2}
    assert (playback.late, playback.largest_lateness) == (3, 150_000_000)


def test_a_pause_shifts_what_follows(bag):
    playback = Playback(schedule(bag), rate=1.0)
    playback.pause(0, False)
    assert played(playback, SECOND // 10) == [0, 1]
    playback.pause(SECOND // 5, True)
    playback.pause(SECOND // 4, True)  # again, which changes nothing
    assert playback.due() is None
    assert playback.at(3 * SECOND) == START + SECOND // 5
    playback.pause(9 * SECOND, False)
    playback.pause(10 * SECOND, False)
    assert playback.due() == 9 * SECOND + SECOND // 20


def test_a_step_takes_the_bag_to_the_time_of_its_message(bag):
    playback = Playback(schedule(bag), rate=1.0)
    assert [number(playback.step(SECOND)) for _ in range(3)] == [0, 1, 2]
    assert playback.at(5 * SECOND) == START + SECOND // 4
    playback.pause(6 * SECOND, False)
    assert playback.due() == 6 * SECOND
    assert played(playback, 6 * SECOND) == [3]
    assert playback.due() == 6 * SECOND + 3 * SECOND // 4
    assert playback.late == 0


def test_time_does_not_pass_a_message_that_is_to_come(bag):
    playback = Playback(schedule(bag), rate=1.0)
    playback.pause(0, False)
    assert playback.at(SECOND) == START
    played(playback, SECOND // 10)
    assert playback.at(SECOND // 5) == START + SECOND // 5
    assert playback.at(SECOND) == START + SECOND // 4
    played(playback, SECOND)
    assert playback.at(2 * SECOND) == START + SECOND


def test_a_loop_begins_again_when_the_last_was_played(bag):
    playback = Playback(schedule(bag), rate=1.0, loop=True)
    playback.pause(0, False)
    assert played(playback, SECOND)[:5] == [0, 1, 2, 3, 4]
    assert not playback.done
    assert playback.due() == SECOND + SECOND // 10
