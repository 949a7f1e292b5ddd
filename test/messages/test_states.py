# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""States among other robots' messages, in virtual time."""

from types import SimpleNamespace

import numpy as np
import pytest

from dp_swing_ros.messages.states import by_publisher, FEW, SILENCE, States

OURS = ('cart', 'joint1', 'joint2')
GRIPPER = ('left_finger', 'right_finger')


def message(stamp=0, names=OURS, value=0.0):
    """Return a JointState of a stamp [ns]."""
    return SimpleNamespace(
        header=SimpleNamespace(stamp=SimpleNamespace(sec=stamp // 10 ** 9,
                                                     nanosec=stamp % 10 ** 9)),
        name=list(names), position=[value] * len(names), velocity=[0.0] * len(names), effort=[])


class Topic:
    """Messages of publishers that each count their own."""

    def __init__(self):
        self.said, self.sent = [], {}
        self.states = States(OURS, self.said.append, lambda gid: f'/{gid.decode()}')

    def send(self, publisher, now, message, lost=0, **options):
        """Return whether a message is a new state, after some that were lost."""
        self.sent[publisher] = self.sent.get(publisher, 0) + 1 + lost
        return self.states.picks(message, publisher, self.sent[publisher], now, **options)

    def state(self, publisher, now, value=0.0, lost=0):
        """Return whether a whole state of now is a new one."""
        return self.send(publisher, now, message(round(now * 1e9) + 1, value=value), lost)


@pytest.fixture
def topic():
    """Return a topic that nobody has sent anything on."""
    return Topic()


def test_another_robots_messages_are_no_states_and_leave_no_trace_in_the_count(topic):
    for n in range(100):
        assert topic.state(b'driver', 0.05 * n)
        assert topic.states.number == n + 1
        for _ in range(5):
            assert not topic.send(b'gripper', 0.05 * n, message(names=GRIPPER))
    words, = topic.said
    assert '/gripper names none of [cart, joint1, joint2]' in words
    assert topic.states.others == {b'gripper'}


def test_one_publisher_may_send_the_joints_of_two_robots_in_turn(topic):
    for n in range(10):
        assert topic.state(b'driver', 0.05 * n)
        assert not topic.send(b'driver', 0.05 * n, message(names=GRIPPER))
    assert topic.states.number == 10
    assert not topic.states.others


def test_states_that_were_lost_count(topic):
    assert topic.state(b'driver', 0.0)
    assert topic.state(b'driver', 0.1, lost=3)
    assert topic.states.number == 5


def test_what_names_some_joints_is_refused_in_words_once(topic):
    for n in range(5):
        assert not topic.send(b'driver', 0.05 * n, message(names=OURS[:2]))
        assert 'JointState has no joint2' in topic.states.refusal
    assert topic.said == [topic.states.refusal]
    assert topic.state(b'driver', 1.0)
    assert not topic.states.refusal


def test_of_two_publishers_the_first_is_obeyed_and_the_other_is_named(topic):
    assert topic.state(b'driver', 0.0)
    for n in range(1, 50):
        assert not topic.state(b'zeros', 0.05 * n)
        assert topic.state(b'driver', 0.05 * n)
    assert topic.states.number == 50
    assert topic.said == [
        '/zeros publishes states, too; /driver was heard first, and is obeyed']


def test_where_the_first_falls_silent_the_other_is_obeyed_until_it_is_heard_again(topic):
    assert topic.state(b'first', 0.0)
    assert not topic.state(b'second', 0.1)
    assert not topic.state(b'second', SILENCE)
    assert topic.state(b'second', SILENCE + 0.1)
    assert topic.said[-1] == '/first is obeyed no more; /second is'
    assert topic.state(b'first', SILENCE + 0.2)
    assert not topic.state(b'second', SILENCE + 0.3)
    assert topic.said[-1] == '/second is obeyed no more; /first is'


def test_who_waits_for_an_answer_is_not_silent(topic):
    """As a plant in lockstep, while a solve takes long."""
    assert topic.state(b'plant', 0.0)
    topic.states.caught_up(10.0)
    assert not topic.state(b'zeros', 10.1)
    assert topic.state(b'plant', 10.2)


def test_a_state_that_comes_twice_is_one(topic):
    for n in range(1, 20):
        assert topic.send(b'bridge', 0.05 * n, message(50_000_000 * n, value=n))
        assert not topic.send(b'bridge', 0.05 * n, message(50_000_000 * n, value=n))
        assert topic.states.number == n


def test_a_state_that_is_asked_for_again_is_one_again(topic):
    assert topic.send(b'plant', 0.0, message(5))
    assert topic.send(b'plant', 1.0, message(5), asked_again=True)


@pytest.mark.parametrize('stamps', [[0] * 10, [7] * 10, range(10)])
def test_stamps_that_stand_still_and_contents_that_do_are_states(topic, stamps):
    """A sensor that is dead is found by who knows how the pendulum moves."""
    moving = [topic.send(b'driver', 0.05 * n, message(stamp, value=n))
              for n, stamp in enumerate(stamps)]
    assert all(moving)
    still = [topic.send(b'driver', 1.0 + 0.05 * n, message(stamp, value=99))
             for n, stamp in enumerate(stamps)]
    # of a pendulum at rest, whose stamps stand still but are not zero, a few look like one
    assert still.count(False) == (FEW - 1 if set(stamps) == {7} else 0)
    assert all(still[FEW:])


def test_what_is_said_is_bounded(topic):
    for n in range(1000):
        topic.send(b'gripper', 0.0, message(names=[f'finger{n}']))
    assert len(topic.said) < 50


@pytest.mark.parametrize('rates', [(20, 10), (10, 20), (20, 20), (20, 50)])
@pytest.mark.parametrize('ahead', [0, 3, 40, -40])
def test_publishers_are_told_apart_by_their_numbers(rates, ahead):
    """Also where the one overtakes the other."""
    sent = sorted(
        (n / rate + phase, n + first, name)
        for rate, phase, first, name in zip(rates, (0.001, 0.023), (100, 100 + ahead), 'ab')
        for n in range(10 * rate))
    times, numbers, names = zip(*sent)
    positions = [[0.0, 0.0] if name == 'b' else [np.sin(time), np.pi + np.cos(time)]
                 for time, name in zip(times, names)]
    found = by_publisher(numbers, positions)
    assert len(set(zip(names, found))) == 2


def test_one_publisher_is_one_whatever_was_lost():
    assert set(by_publisher([1, 2, 5, 9], [[0.0], [0.1], [0.4], [0.8]])) == {b''}
    assert set(by_publisher([0, 0, 0], [[0.0], [0.1], [0.2]])) == {b''}


def test_a_message_that_was_lost_makes_no_other_publisher_of_one_that_restarted():
    numbers = [*range(1, 500), *range(501, 1001), *range(1, 700), *range(703, 1500)]
    swing = np.sin(0.01 * np.arange(len(numbers)))[:, None]
    found = by_publisher(numbers, swing)
    assert len(set(found[:999])) == 1 and len(set(found[999:])) == 1
    assert found[0] != found[-1]
    # nor of states that came over two bridges
    twice = np.repeat([*range(1, 50), *range(52, 90)], 2)
    assert len(set(by_publisher(twice.tolist(), np.repeat(swing[:87], 2, axis=0)))) == 2
