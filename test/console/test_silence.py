# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who is said to be silent, in virtual time."""

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, String

from dp_swing_ros.console.scene import Scene
from dp_swing_ros.console.silence import PATIENCE, Silence
from dp_swing_ros.messages.configuration import Configuration
from dp_swing_ros.topics import CONFIGURATION, DIAGNOSTICS, FORCE_COMMAND, JOINT_STATES

STATE = JOINT_STATES, JointState(
    name=['cart', 'joint1', 'joint2'], position=[0.0] * 3, velocity=[0.0] * 3)
FORCE = FORCE_COMMAND, Float64()


def status(name, **values):
    return DIAGNOSTICS, DiagnosticArray(status=[DiagnosticStatus(
        name=name, hardware_id='/joint_states', values=[
            KeyValue(key=key, value=str(value)) for key, value in values.items()])])


class Run:
    """A scene and its silence at a time [s] that passes when it is told to."""

    def __init__(self, **parameters):
        self.scene, self.silence, self.now, self.is_there = Scene(), Silence(), 0.0, True
        self.scene.hear(CONFIGURATION, String(data=Configuration(
            '/plant', {'lockstep': False, **parameters}, '', '', '', '', {}).to_text()))
        self.hear(STATE, FORCE)

    def hear(self, *messages):
        for topic, message in messages:
            self.scene.hear(topic, message)
            self.silence.hear(topic, message, self.scene, self.now)

    def wait(self, seconds, *messages):
        """Hear some messages each tenth of a second; return who is silent in the end."""
        for _ in range(round(10 * seconds)):
            self.now = round(self.now + 0.1, 1)
            self.hear(*messages)
        return self.silent()

    def silent(self):
        return self.silence.lasts(self.scene, self.now, self.is_there)


@pytest.mark.parametrize('lives, silent', [
    ([STATE, FORCE], {}), ([FORCE], {'plant': 5}), ([STATE], {'mpc': 5}), ([], {'plant': 5}),
    ([STATE, status('mpc')], {}), ([STATE, status('mpc: topics')], {}),
    ([status('plant'), FORCE], {}), ([STATE, status('plant')], {'mpc': 5})])
def test_who_is_not_heard_is_silent_until_it_is_heard_again(lives, silent):
    run = Run()
    assert run.wait(PATIENCE - 0.2, *lives) == {}
    assert run.wait(3.4, *lives).keys() == silent.keys()
    assert all(4 <= each <= 5 for each in run.silent().values())
    run.hear(STATE, FORCE)
    assert run.silent() == {}


def test_who_was_never_heard_is_not_silent():
    run = Run()
    run.silence = Silence()
    assert run.wait(9.0) == {}
    assert run.wait(9.0, STATE) == {}   # without an mpc


def test_a_plant_that_is_paused_is_not_dead_as_long_as_it_is_there():
    run = Run(lockstep=True)
    run.hear(status('plant', paused=1))
    assert run.wait(60.0) == {}
    run.is_there = False
    assert run.silent() == {'plant': 60}
    run.is_there = True
    run.hear(status('plant', paused=0), STATE)   # it goes on, and the mpc has not answered yet
    assert run.silent() == {}


def test_in_lockstep_it_is_the_mpc_that_is_waited_for():
    run = Run(lockstep=True)
    run.hear(STATE)
    assert run.wait(9.0) == {'mpc': 9}
    run.hear(FORCE)
    assert run.wait(0.5) == {}
    assert run.wait(9.5) == {'plant': 10}


@pytest.mark.parametrize('parameters, seconds', [
    ({'rate': 1.0}, 3.0), ({'lockstep': True, 'pace': 0.01, 'rate': 20.0}, 15.0),
    ({'lockstep': True, 'pace': 0.0}, 2.0)])
def test_slow_states_are_no_silence(parameters, seconds):
    run = Run(**parameters)
    assert run.wait(seconds - 0.2) == {}
    assert run.wait(0.4).keys() == {'plant'}
