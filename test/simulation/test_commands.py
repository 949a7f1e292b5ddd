# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The way of a command to the actuator."""

import math

import numpy as np
import pytest

from dp_swing_ros.simulation.plant import Commands, PlantParameters
from dp_swing_ros.streams import Stream, stream

LATENESS = 0.1   # [s] at most


def obeyed(seed, sent):
    """Return when each force acts, and which, of (time, force) that are sent."""
    commands, found = Commands(PlantParameters(seed=seed, command_jitter=LATENESS)), []
    for time, force in [*sent, (math.inf, None)]:
        while commands.next_change() <= time and commands.coming:
            begins = commands.next_change()
            commands.change()
            found.append((begins, commands.force))
        commands.send(time, force)
    return found


@pytest.mark.parametrize('seed', range(20))
def test_a_command_is_obeyed_unless_a_newer_one_acts_before(seed):
    times = 0.01 * np.arange(50)
    begins = times + stream(seed, Stream.COMMAND_JITTER).uniform(0.0, LATENESS, 50)
    expected = [n for n in range(50) if np.all(begins[n] < begins[n + 1:])]
    assert 1 < len(expected) < 50   # some were overtaken
    assert obeyed(seed, [(times[n], float(n)) for n in range(50)]) == [
        (begins[n], float(n)) for n in expected]


def test_a_command_that_expires_leaves_no_force():
    commands = Commands(PlantParameters())
    commands.send(0.0, 5.0, lasts=0.2)
    commands.change()
    assert (commands.force, commands.expired, commands.next_change()) == (5.0, False, 0.2)
    commands.change()
    assert (commands.force, commands.expired) == (0.0, True)


def test_what_comes_after_the_end_of_a_command_acts_from_then_on_and_not_before():
    commands = Commands(PlantParameters())
    commands.send(0.0, 5.0, lasts=0.2)
    commands.change()
    commands.send(0.3, 4.0)
    assert commands.next_change() == 0.2
    commands.change()
    assert (commands.force, commands.expired, commands.next_change()) == (0.0, True, 0.3)
    commands.change()
    assert (commands.force, commands.expired) == (4.0, False)
