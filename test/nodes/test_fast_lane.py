# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The way past the executor: everything that it serves is called back for, and nothing starves."""

import time

from conftest import wait_until
import pytest
from rcl_interfaces.srv import GetParameters
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from std_msgs.msg import Float64

from dp_swing_ros.messages.fields import seconds
from dp_swing_ros.nodes.connections import subscribe
from dp_swing_ros.nodes.fast_lane import FastLane, OFTEN
from dp_swing_ros.topics import DISTURBANCE, FORCE_COMMAND, JOINT_STATES

RATE = 400.0   # [Hz]


def never():
    return False


@pytest.fixture
def lane(peer):
    """Return a busy lane of a subscription, what it heard, and a publisher to it."""
    heard = []
    subscription = subscribe(peer.node, DISTURBANCE, lambda message: heard.append(message.data))
    made = FastLane(peer.context, subscription)
    made.is_busy = True
    return made, heard, peer.publisher(DISTURBANCE)


def test_messages_are_called_back_for_in_their_order(lane):
    one, heard, publisher = lane
    for n in range(5):
        publisher.publish(Float64(data=float(n)))

    def are_there():
        one.serve(never)
        return len(heard) >= 5
    assert wait_until(are_there)
    assert heard == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_a_callback_may_ask_for_the_times_of_a_message(peer):
    heard = []
    subscription = subscribe(peer.node, DISTURBANCE,
                             lambda message, info: heard.append((message.data, info)))
    one = FastLane(peer.context, subscription)
    one.is_busy = True
    peer.publisher(DISTURBANCE).publish(Float64(data=3.0))
    assert wait_until(lambda: one.serve(never) or heard)
    (data, info), = heard
    assert data == 3.0
    assert abs(info['source_timestamp'] / 1e9 - time.time()) < 60.0


def test_timers_have_their_turn(peer):
    steady, ticks = Clock(clock_type=ClockType.STEADY_TIME), []
    timer = peer.node.create_timer(0.001, lambda: ticks.append(1), clock=steady)
    stopped = peer.node.create_timer(0.001, lambda: ticks.append(-1), clock=steady)
    stopped.cancel()
    one = FastLane(peer.context, subscribe(peer.node, DISTURBANCE, lambda message: None),
                   timer, stopped)

    def serve():
        one.note()
        one.note()
        one.serve(never)
    assert wait_until(lambda: serve() or len(ticks) > 20)
    assert -1 not in ticks


def test_it_is_over_when_messages_come_no_more(lane):
    one, heard, publisher = lane
    assert wait_until(lambda: one.serve(never) or not one.is_busy)


def test_it_is_for_what_comes_often_alone(lane):
    one, heard, publisher = lane
    one.note()
    time.sleep(1.5 * OFTEN)
    one.note()
    publisher.publish(Float64(data=1.0))
    time.sleep(0.05)
    one.serve(never)
    assert not heard   # it is the executor's
    assert wait_until(lambda: one.note() or one.note() or one.serve(never) or heard)


def test_a_turn_ends_though_messages_come_on(lane):
    one, heard, publisher = lane
    for _ in range(2000):
        publisher.publish(Float64())
    one.subscription.callback = lambda message: time.sleep(1e-3) or heard.append(message)
    one.serve(never)
    assert len(heard) < 2000


def test_nothing_is_called_back_for_when_all_is_over(lane):
    one, heard, publisher = lane
    publisher.publish(Float64())
    publisher.publish(Float64())
    assert wait_until(lambda: one.serve(lambda: bool(heard)) or heard)
    one.serve(lambda: True)
    assert len(heard) == 1


def test_a_plant_in_a_hurry_answers_services_and_sends_no_sooner(peer, start_node):
    """Against forces that come twice as often as its states go, from a bare publisher."""
    plant = start_node('plant', {'rate': RATE})
    plant.wait_for('states a second')
    states, forces = peer.record(JOINT_STATES), peer.publisher(FORCE_COMMAND)
    peer.node.create_timer(0.5 / RATE, lambda: forces.publish(Float64(data=0.1)))
    assert peer.until(lambda: len(states) > RATE)
    for _ in range(10):
        answer = peer.call(GetParameters, '/plant/get_parameters', names=['rate'])
        assert answer.values[0].double_value == RATE
    stamps = [seconds(state.header.stamp) for state in states]
    # where the first was late, the two after it may come within a period
    assert len(stamps) - 3 <= RATE * (stamps[-1] - stamps[0])
    assert peer.until(lambda: states[-1].effort[0] == pytest.approx(0.1))
    assert plant.stop() == 0
