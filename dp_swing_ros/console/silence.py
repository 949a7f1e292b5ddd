# Copyright 2026 the dp_swing_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Who is silent that should be heard: a plant without states, an mpc without answers."""

from typing import Any

from dp_swing_ros.console.scene import Scene
from dp_swing_ros.messages.configuration import CONTROLLER, PLANT
from dp_swing_ros.topics import COMMAND_TOPICS, DIAGNOSTICS, JOINT_STATES, PLAN, Topic

PATIENCE = 2.0   # [s] without a word, at least
PERIODS = 3      # without one, at least


class Silence:
    """When plant and mpc were last heard; times are those of any steady clock [s]."""

    def __init__(self) -> None:
        """Begin where nobody was heard yet."""
        self._heard: dict[str, float] = {}   # by role
        self._asked: float | None = None     # when the first state came that nobody answered

    def hear(self, topic: Topic, message: Any, scene: Scene, now: float) -> None:
        """Take a message that the scene has taken."""
        if topic is JOINT_STATES:
            self._heard[PLANT] = now
            self._asked = now if self._asked is None else self._asked
        said = {CONTROLLER} if topic in (*COMMAND_TOPICS, PLAN) else set()
        if topic is DIAGNOSTICS:
            whose = {status.name.partition(':')[0] for status in message.status}
            said = {role for role in (PLANT, CONTROLLER) if scene.node(role) in whose}
        for role in said:
            self._heard[role] = now
        if CONTROLLER in said:
            if self._asked is not None and is_lockstep(scene):
                self._heard[PLANT] = now   # it has waited for that
            self._asked = None

    def lasts(self, scene: Scene, now: float, is_there: bool) -> dict[str, int]:
        """
        Return for how many whole seconds each has been silent that should be heard.

        A plant that is paused is not, as long as it is there; nor one in lockstep that waits for
        an answer, and the mpc only where there is a state to answer.
        """
        since = dict(self._heard)
        lockstep = is_lockstep(scene)
        if scene.paused and is_there or lockstep and self._asked is not None:
            since.pop(PLANT, None)
        if CONTROLLER in since:
            since[CONTROLLER] = now if self._asked is None else self._asked
        pace = scene.value(PLANT, 'pace', 1.0) if lockstep else 1.0
        patience = max(PATIENCE, PERIODS * scene.period / (pace or 1.0))
        return {role: int(now - then) for role, then in since.items() if now - then >= patience}


def is_lockstep(scene: Scene) -> bool:
    """Return whether the plant waits for an answer to each state."""
    return bool(scene.value(PLANT, 'lockstep', False))
