# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The way of a command to the actuator."""

import pytest

from dp_swing_ros.commands import Commands
from dp_swing_ros.parameters import PlantParameters

LATENESS = 0.1   # [s] at most


def obeyed(seed, sent):
    """Return the forces in the order in which they act, of (time, force) that are sent."""
    commands, forces = Commands(PlantParameters(seed=seed, command_jitter=LATENESS)), []
    for time, force in sent:
        while commands.next_change() <= time:
            commands.change()
            forces.append(commands.force)
        commands.send(time, force)
    while commands.coming:
        commands.change()
        forces.append(commands.force)
    return forces


@pytest.mark.parametrize('seed', range(20))
def test_a_command_is_never_obeyed_after_a_newer_one(seed):
    forces = obeyed(seed, [(0.01 * n, float(n)) for n in range(50)])
    assert forces == sorted(forces)
    assert forces[-1] == 49.0
    assert len(forces) < 50   # some were overtaken


def test_a_command_that_expires_leaves_no_force():
    commands = Commands(PlantParameters())
    commands.send(0.0, 5.0, lasts=0.2)
    commands.change()
    assert (commands.force, commands.expired, commands.next_change()) == (5.0, False, 0.2)
    commands.change()
    assert (commands.force, commands.expired) == (0.0, True)
