# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0

from echo import ECHO
import numpy as np
import pytest

from dp_swing_ros.messages.fields import seconds
from dp_swing_ros.nodes.messages import to_joint_state, to_stamp
from dp_swing_ros.topics import JOINT_STATES


def test_every_state_is_answered_with_its_stamp(start_node, peer):
    echo = start_node('echo.py')
    echo.wait_for('ready')
    answers, states = peer.record(ECHO), peer.publisher(JOINT_STATES)

    def send(stamp):
        states.publish(to_joint_state(stamp, np.zeros(6), 0.0))
    # discovery goes one way at a time
    assert peer.until(lambda: send(to_stamp(0)) or answers)

    def answered():
        return [answer.data for answer in answers if answer.data]
    stamps = [to_stamp(1_795_569_067_000_000_000 + 2_000_001 * n) for n in range(5)]
    for n, stamp in enumerate(stamps):
        send(stamp)
        assert peer.until(lambda: len(answered()) > n)
    assert answered() == [seconds(stamp) for stamp in stamps]
    assert echo.stop() == 0


@pytest.mark.parametrize('name', ['rate', 'solver'])
def test_it_has_no_parameters_of_plant_or_mpc(start_node, name):
    echo = start_node('echo.py', {name: 1})
    assert echo.wait() == 2
    assert f"echo.py: error: unknown parameter '{name}'" in echo.output()
