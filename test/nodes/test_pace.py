# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A plant in lockstep that is paused, stepped and slowed down."""

import time

import pytest
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from std_msgs.msg import Float64
from std_srvs.srv import SetBool, Trigger

from dp_swing_ros.messages.fields import from_diagnostics, seconds
from dp_swing_ros.topics import DIAGNOSTICS, FORCE_COMMAND, JOINT_STATES


class Answering:
    """A controller that answers the n-th state with n newtons, and a plant in lockstep."""

    def __init__(self, peer, start_node, **parameters):
        self.peer, self.states = peer, peer.record(JOINT_STATES)
        self.reports, self.answered = peer.record(DIAGNOSTICS), 0
        self.node = start_node('plant', {'lockstep': True, **parameters})
        self.forces = peer.publisher(FORCE_COMMAND)
        assert peer.until(lambda: self.states), self.node.output()

    def answer(self):
        """Answer what has not been answered; return how many states there are."""
        if self.answered < len(self.states):
            self.answered = len(self.states)
            self.forces.publish(Float64(data=float(self.answered)))
        return len(self.states)

    def until(self, count):
        assert self.peer.until(lambda: self.answer() >= count), self.node.output()

    def rest(self, duration=0.3):
        """Return how many states there are after a time [s] in which all are answered."""
        end = time.monotonic() + duration
        self.peer.until(lambda: self.answer() and time.monotonic() > end)
        return len(self.states)

    def pause(self, paused):
        answer = self.peer.call(SetBool, 'plant/pause', data=paused)
        return answer.success, answer.message

    def step(self):
        answer = self.peer.call(Trigger, 'plant/step')
        return answer.success, answer.message

    def paused(self):
        report = from_diagnostics(self.reports[-1], 'plant')
        return report.values['paused'], report.message


def set_pace(peer, pace):
    client = AsyncParameterClient(peer.node, 'plant')
    assert peer.until(client.services_are_ready)
    done = client.set_parameters_atomically([Parameter('pace', value=pace)])
    assert peer.until(done.done)
    return done.result().result


def test_it_stops_between_two_periods_and_goes_on_as_if_nothing_had_been(peer, start_node):
    run = Answering(peer, start_node)
    run.until(3)
    assert run.pause(True) == (True, 'paused')
    paused_at = run.rest()
    assert run.rest() == paused_at
    assert peer.until(lambda: run.paused() == (1, 'paused'))
    assert run.pause(False) == (True, 'going on')
    run.until(paused_at + 20)
    assert peer.until(lambda: run.paused()[0] == 0)
    for n, state in enumerate(run.states):
        assert seconds(state.header.stamp) == pytest.approx(0.05 * n, abs=1e-9)
        assert state.effort[0] == min(n, 20)   # none was obeyed twice, and none left out


def test_a_step_lets_one_period_pass(peer, start_node):
    run = Answering(peer, start_node)
    assert run.step() == (False, 'not paused; call plant/pause first')
    run.pause(True)
    before = run.rest()
    for n in range(1, 4):
        assert run.step() == (True, 'a period has passed')
        assert run.rest(0.1) == before + n
    # before its force is there
    assert run.step()[0]
    assert peer.until(lambda: len(run.states) == before + 4)
    assert run.step() == (True, 'a period passes with the next force')
    assert run.rest() == before + 5


def test_a_pace_is_kept_and_can_change(peer, start_node):
    run = Answering(peer, start_node, pace=0.5)
    run.until(3)
    began = time.monotonic()
    run.until(13)
    assert time.monotonic() - began == pytest.approx(1.0, abs=0.3)   # half a second of its own
    assert set_pace(peer, 0.01).successful   # 5 s a period
    run.rest(0.2)
    assert run.rest() == run.rest(0.5)
    assert set_pace(peer, 0.0).successful
    began = time.monotonic()
    run.until(len(run.states) + 40)
    assert time.monotonic() - began < 1.5


def test_a_reset_while_it_is_paused_brings_the_first_state_and_stays_paused(peer, start_node):
    run = Answering(peer, start_node)
    run.until(5)
    run.pause(True)
    before = run.rest()
    assert peer.call(Trigger, 'plant/reset').success
    assert run.rest() == before + 1
    assert seconds(run.states[-1].header.stamp) == 0.0
    assert run.step()[0]
    assert run.rest() == before + 2
    assert run.states[-1].effort[0] == min(before + 1, 20)   # the answer to the first state


def test_real_time_cannot_be_stopped_and_says_so(peer, start_node):
    states = peer.record(JOINT_STATES)
    start_node('plant')
    assert peer.until(lambda: len(states) > 2)
    for answer in (peer.call(SetBool, 'plant/pause', data=True), peer.call(Trigger, 'plant/step')):
        assert not answer.success
        assert 'lockstep:=true, or all by `make play LOCKSTEP=1`' in answer.message
    refused = set_pace(peer, 0.5)
    assert not refused.successful
    assert 'lockstep:=true' in refused.reason
    before = len(states)
    assert peer.until(lambda: len(states) > before + 2)


def test_a_pace_in_real_time_is_refused_at_the_start(start_node):
    node = start_node('plant', {'pace': 1.0})
    assert node.wait() == 2
    assert "parameter 'pace' is 1; expected 0 in real time" in node.complaint()
